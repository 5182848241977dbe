// The GNSS filter on the simulator's scenarios, a few seeds each. The slow suite has thirty.

#include "filter_bars.hpp"

namespace vestibule::test {
namespace {

constexpr std::uint64_t kSeeds = 2;

TEST(FilterScenarios, NothingGoesWrongUnderAnOpenSky) { expectNominal("open_sky", kSeeds); }
TEST(FilterScenarios, NothingGoesWrongWithRtk) { expectNominal("open_sky_rtk", kSeeds); }
TEST(FilterScenarios, ASpikeOf700MetresMovesNothing) { expectSpikeRefused(kSeeds); }
TEST(FilterScenarios, ComesBackAfterAnOutage) { expectOutage("outage_60s_turns", 60.0, kSeeds); }

/// So long that the incident of each has begun; outages of every length begin alike.
class BothEngines : public testing::TestWithParam<const char*> {};

TEST_P(BothEngines, AreEqualTo1e9) {
  const EngineDifference difference = engineDifference(GetParam(), 95.0);
  EXPECT_GT(difference.compared, 500U);
  EXPECT_LT(difference.state, 1e-9);
  EXPECT_LT(difference.covariance, 1e-9);
}

INSTANTIATE_TEST_SUITE_P(
    EveryScenario,
    BothEngines,
    testing::Values(
        "open_sky",
        "open_sky_rtk",
        "canyon",
        "multipath_walk",
        "outage_10s_straight",
        "outage_10s_turns",
        "outage_bad_return",
        "lever_arm_1m",
        "gnss_delay_50ms",
        "gnss_delay_200ms",
        "gnss_spike_700m",
        "stationary_10min",
        "reverse_start",
        "slip_burst",
        "imu_bias_step",
        "reboot_moving"),
    [](const auto& each) { return std::string(each.param); });

}  // namespace
}  // namespace vestibule::test
