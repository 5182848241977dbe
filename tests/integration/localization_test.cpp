// The particle localization against exact truth: a simulated recording that Debian ships, in a map
// made from another one, and drives in the simulator.

#include <gtest/gtest.h>

#include <sstream>

#include "office_drive.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/mapping/known_poses_mapper.hpp"
#include "vestibule/pipeline/localize.hpp"

namespace vestibule::test {
namespace {

const std::string kRecordings =
    "/usr/share/mrpt/datasets/graphslam-engine-demos/action_observations_map/";

/// One row `time x y yaw` per scan.
std::vector<Pose2> truthOf(const std::string& name) {
  std::istringstream rows(readFile(kRecordings + name + ".rawlog.GT.txt"));
  std::vector<Pose2> truth;
  double time = 0.0;
  for (Pose2 p; rows >> time >> p.x >> p.y >> p.phi;) truth.push_back(p);
  return truth;
}

TEST(Localization, NoisyRangesInACleanMap) {
  // GIVEN a map from every fifth scan of `simul` (sigma 1 cm) at its true pose
  const auto mapped = truthOf("simul");
  mapping::KnownPosesMapper mapper({});
  const auto reader = io::openRecording(kRecordings + "simul.rawlog", {});
  std::size_t k = 0;
  while (const auto record = reader->next()) {
    const auto* scan = std::get_if<LaserScan>(&record->measurement);
    if (scan == nullptr) continue;
    if (k % 5 == 0 && k < mapped.size()) mapper.add(mapped[k], *scan);
    ++k;
  }
  const auto map = std::make_shared<const grid::OccupancyMap>(mapper.build());
  // WHEN the recording with a range noise of 0.30 m is localized in it
  const auto truth = truthOf("range_030_bearing_015");
  const auto result = pipeline::localize(
      kRecordings + "range_030_bearing_015.rawlog",
      {},
      map,
      truth.at(0),
      {},
      {},
      [](double, double) {});
  // THEN it is right to a few centimetres. Its truth runs ahead of scans and odometry by up to
  // 0.3 m in the steps in which the recorder stalled, hence no limit on the largest error.
  std::vector<double> errors_m;
  for (std::size_t i = 0; i < std::min(truth.size(), result.trajectory.size()); ++i) {
    errors_m.push_back(distance(result.trajectory[i].pose, truth[i]));
  }
  const auto figures = metrics::statistics(errors_m);
  EXPECT_LE(figures.rmse, 0.052) << "[m]; 95 % " << figures.p95 << ", max " << figures.max;
  testing::Test::RecordProperty("rmse_m", std::to_string(figures.rmse));
}

TEST(Localization, InTheChangedMapOfTheOffice) {
  const OfficeResult result = driveOffice("office_nominal", 1);
  const auto figures = metrics::statistics(result.errors_m);
  EXPECT_LE(figures.rmse, 0.022) << "[m]; 95 % " << figures.p95 << ", max " << figures.max;
  EXPECT_EQ(result.longest_loss_s, 0.0);
}

}  // namespace
}  // namespace vestibule::test
