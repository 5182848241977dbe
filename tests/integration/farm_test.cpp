// The mission through both doors of the shipped farm, in closed loop.

#include "farm_drive.hpp"

namespace vestibule::test {
namespace {

class Farm : public testing::TestWithParam<FarmDrive> {};

TEST_P(Farm, FeedingRound) { expectGoodDrive(GetParam()); }

INSTANTIATE_TEST_SUITE_P(
    FewSeeds, Farm, testing::Values(rtkDrive(1), rtkDrive(2), singlePointDrive(1)), nameOf);

}  // namespace
}  // namespace vestibule::test
