// The GNSS filter on the simulator's scenarios, thirty seeds each, against its bars.

#include "filter_bars.hpp"

namespace vestibule::test {
namespace {

constexpr std::uint64_t kSeeds = 30;

TEST(FilterSeeds, open_sky) { expectNominal("open_sky", kSeeds); }
TEST(FilterSeeds, open_sky_rtk) { expectNominal("open_sky_rtk", kSeeds); }
TEST(FilterSeeds, lever_arm_1m) { expectNominal("lever_arm_1m", kSeeds); }
TEST(FilterSeeds, gnss_delay_50ms) { expectNominal("gnss_delay_50ms", kSeeds); }
TEST(FilterSeeds, gnss_delay_200ms) { expectNominal("gnss_delay_200ms", kSeeds); }
TEST(FilterSeeds, reverse_start) { expectNominal("reverse_start", kSeeds); }
TEST(FilterSeeds, gnss_spike_700m) { expectSpikeRefused(kSeeds); }
TEST(FilterSeeds, multipath_walk) { expectWalkResisted(kSeeds); }
TEST(FilterSeeds, outage_10s_straight) { expectOutage("outage_10s_straight", 10.0, kSeeds); }
TEST(FilterSeeds, outage_10s_turns) { expectOutage("outage_10s_turns", 10.0, kSeeds); }
TEST(FilterSeeds, outage_30s_straight) { expectOutage("outage_30s_straight", 30.0, kSeeds); }
TEST(FilterSeeds, outage_30s_turns) { expectOutage("outage_30s_turns", 30.0, kSeeds); }
TEST(FilterSeeds, outage_60s_straight) { expectOutage("outage_60s_straight", 60.0, kSeeds); }
TEST(FilterSeeds, outage_60s_turns) { expectOutage("outage_60s_turns", 60.0, kSeeds); }
TEST(FilterSeeds, outage_200s_straight) { expectOutage("outage_200s_straight", 200.0, kSeeds); }
TEST(FilterSeeds, outage_200s_turns) { expectOutage("outage_200s_turns", 200.0, kSeeds); }
TEST(FilterSeeds, outage_bad_return) { expectBadReturnResisted(kSeeds); }
TEST(FilterSeeds, stationary_10min) { expectStandsStill(kSeeds); }
TEST(FilterSeeds, canyon) { expectBounded("canyon", kSeeds, 15.0); }
TEST(FilterSeeds, slip_burst) { expectBounded("slip_burst", kSeeds, 5.0); }
TEST(FilterSeeds, imu_bias_step) { expectBounded("imu_bias_step", kSeeds, 10.0); }
TEST(FilterSeeds, reboot_moving) { expectBounded("reboot_moving", kSeeds, 15.0); }

}  // namespace
}  // namespace vestibule::test
