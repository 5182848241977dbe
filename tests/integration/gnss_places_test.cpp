// How wrong a single-point receiver is at different places of the campus, as a table.

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <vector>

#include "test_files.hpp"
#include "vestibule/metrics/statistics.hpp"
#include "vestibule/sim/gnss.hpp"
#include "vestibule/sim/world.hpp"

namespace vestibule {
namespace {

struct Place {
  const char* name;
  Eigen::Vector3d p_map_antenna;
};

struct Result {
  double share = 0.0;      ///< of the time with a fix
  double claimed_m = 0.0;  ///< median
  metrics::Statistics error_m;
};

TEST(GnssByPlace, TheCampusHasGoodAndBadCorners) {
  const sim::World world = sim::loadWorld(test::shipped("config/worlds/campus.yaml"));
  const sim::WorldGeometry geometry(world);
  const sim::Moment moment = geometry.momentAt(0.0);
  const std::vector<Place> places{
      {"open ground", {72, -16, 1}},
      {"courtyard", {52, 36, 1}},
      {"beside a tree", {-6, 14.5, 1}},
      {"beside the facade", {15, -1.5, 1}},
      {"beside the library", {70, 10, 1}},
      {"ramp", {82, 10, -0.2}},
      {"west doorway", {0, 7, 1}},
      {"passage", {35, 7, 1}},
      {"hall", {15, 7, 1}},
      {"garage", {94, 10, -1}}};
  sim::GnssParams params;
  params.receiver = sim::GnssClass::kSingle;
  const geo::TangentPlane plane(world.datum);
  std::map<std::string, Result> results;
  std::printf(
      "%-20s %8s %8s %8s %8s %8s\n", "place", "fix [%]", "median", "95 %", "max", "claimed");
  for (const Place& place : places) {
    std::vector<double> errors;
    std::vector<double> claimed;
    int fixes = 0;
    for (std::uint64_t seed = 1; seed <= 30; ++seed) {
      sim::GnssModel gnss(geometry, world.datum, params, seed);
      for (int i = 0; i < 100; ++i, ++fixes) {
        const Timestamp stamp =
            Timestamp{1'700'000'000'000'000'000} + std::chrono::milliseconds(200 * i);
        const GnssFix fix = gnss.measure(stamp, moment, place.p_map_antenna);
        if (fix.type == GnssFixType::kNone) continue;
        const Eigen::Vector3d enu = plane.toEnu(std::get<Geodetic>(fix.position));
        errors.push_back((enu - place.p_map_antenna).head<2>().norm());
        claimed.push_back(std::sqrt(fix.cov_enu->topLeftCorner<2, 2>().trace()));
      }
    }
    Result& result = results[place.name];
    result.share = static_cast<double>(errors.size()) / fixes;
    if (!errors.empty()) {
      result.error_m = metrics::statistics(errors);
      result.claimed_m = metrics::statistics(claimed).median;
    }
    std::printf(
        "%-20s %8.1f %8.2f %8.2f %8.2f %8.2f\n",
        place.name,
        100.0 * result.share,
        result.error_m.median,
        result.error_m.p95,
        result.error_m.max,
        result.claimed_m);
  }
  const Result& open = results.at("open ground");
  EXPECT_EQ(open.share, 1.0);
  EXPECT_LT(open.error_m.median, 2.5);
  // Beside walls fixes are off by metres and claim to be about as good as in the open.
  for (const char* wall : {"beside the facade", "beside the library", "west doorway"}) {
    SCOPED_TRACE(wall);
    const Result& result = results.at(wall);
    EXPECT_GT(result.error_m.median, 1.8 * result.claimed_m);
    EXPECT_LT(result.claimed_m, 1.5 * open.claimed_m);
    EXPECT_GT(result.error_m.p95, 3.0 * open.error_m.p95);
  }
  EXPECT_EQ(results.at("garage").share, 0.0) << "under the ground";
  EXPECT_LT(results.at("passage").share, 0.5) << "under a roof, with an open side";
  // Behind glass there are fixes, and they are bad.
  EXPECT_GT(results.at("hall").error_m.median, 3.0 * open.error_m.median);
}

}  // namespace
}  // namespace vestibule
