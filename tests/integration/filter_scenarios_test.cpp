// The GNSS filter on the simulator's scenarios, a few seeds each. The slow suite has thirty.

#include "filter_bars.hpp"

namespace vestibule::test {
namespace {

constexpr std::uint64_t kSeeds = 2;

TEST(FilterScenarios, NothingGoesWrongUnderAnOpenSky) { expectNominal("open_sky", kSeeds); }
TEST(FilterScenarios, NothingGoesWrongWithRtk) { expectNominal("open_sky_rtk", kSeeds); }
TEST(FilterScenarios, ASpikeOf700MetresMovesNothing) { expectSpikeRefused(kSeeds); }
TEST(FilterScenarios, ComesBackAfterAnOutage) { expectOutage("outage_60s_turns", 60.0, kSeeds); }

}  // namespace
}  // namespace vestibule::test
