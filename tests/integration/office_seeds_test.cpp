// The particle localization in the office's changed map: people in the way, odometry that counts
// wrongly, scans that come late; several seeds of each.

#include <gtest/gtest.h>

#include <cstdio>

#include "office_drive.hpp"

namespace vestibule::test {
namespace {

class OfficeSeeds : public testing::TestWithParam<const char*> {};

TEST_P(OfficeSeeds, AccurateNeverLostAndAsWrongAsItSays) {
  constexpr std::uint64_t kSeeds = 5;
  std::vector<double> errors_m;
  double nees_sum = 0.0;
  std::size_t nees_count = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const OfficeResult result = driveOffice(GetParam(), seed);
    errors_m.insert(errors_m.end(), result.errors_m.begin(), result.errors_m.end());
    EXPECT_LE(result.longest_loss_s, 1.0) << "seed " << seed;
    for (const double nees : result.nees) nees_sum += nees;
    nees_count += result.nees.size();
  }
  const auto figures = metrics::statistics(errors_m);
  const double nees = nees_sum / static_cast<double>(nees_count);
  std::printf(
      "%s: RMSE %.4f m, 95 %% %.4f, max %.4f; NEES %.2f of %zu\n",
      GetParam(),
      figures.rmse,
      figures.p95,
      figures.max,
      nees,
      nees_count);
  EXPECT_LE(figures.rmse, 0.022) << "[m]";
  // Errors of the map are the same at every visit: the samples are far from independent, and the
  // bounds of as many independent ones would be too narrow.
  EXPECT_GE(nees, 1.5);
  EXPECT_LE(nees, 4.5);
}

INSTANTIATE_TEST_SUITE_P(
    Scenarios,
    OfficeSeeds,
    testing::Values(
        "office_nominal",
        "office_occluded",
        "office_odometry_long",
        "office_odometry_short",
        "office_late_scans"),
    [](const auto& name) { return std::string(name.param); });

}  // namespace
}  // namespace vestibule::test
