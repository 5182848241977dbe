// Twenty seeds of the farm mission with each receiver: all of them must keep all bars.

#include <algorithm>

#include "farm_drive.hpp"

namespace vestibule::test {
namespace {

constexpr std::uint64_t kSeeds = 20;

std::vector<FarmDrive> allDrives() {
  std::vector<FarmDrive> drives;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) drives.push_back(rtkDrive(seed));
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) drives.push_back(singlePointDrive(seed));
  return drives;
}

class FarmSeeds : public testing::TestWithParam<FarmDrive> {};

TEST_P(FarmSeeds, FeedingRound) { expectGoodDrive(GetParam()); }

INSTANTIATE_TEST_SUITE_P(TwentySeeds, FarmSeeds, testing::ValuesIn(allDrives()), nameOf);

}  // namespace
}  // namespace vestibule::test
