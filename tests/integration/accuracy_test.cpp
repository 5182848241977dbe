// Accuracy on the real recordings that Debian and the repository ship.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "test_files.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/pipeline/fuse.hpp"
#include "vestibule/pipeline/localize.hpp"

namespace vestibule::test {
namespace {

const std::string kMrptDatasets = "/usr/share/mrpt/datasets/";

void noProgress(double /*share*/, double /*data_s*/) {}

pipeline::LocalizeResult localize(
    const std::string& log, const std::string& map, const std::optional<Pose2>& init) {
  return pipeline::localize(
      kMrptDatasets + log,
      {},
      std::make_shared<const grid::OccupancyMap>(io::loadMap(kMrptDatasets + map)),
      init,
      {},
      {},
      noProgress);
}

TEST(Indoors, TracksTheUwbRecording) {
  // One row `index x y yaw` per motion: row i is where scan i + 1 was taken, as the lengths of the
  // steps tell. The robot stood still until after the second scan, so row 0 is the start, too.
  std::istringstream rows(readFile(kMrptDatasets + "uwb_ro-localization_demo_GT.txt"));
  std::vector<Pose2> reference;
  double index = 0.0;
  for (Pose2 p; rows >> index >> p.x >> p.y >> p.phi;) reference.push_back(p);
  ASSERT_EQ(reference.size(), 342U);

  const auto result = localize(
      "uwb_ro-localization_demo.rawlog",
      "uwb_ro-localization_demo_map.gridmap.gz",
      reference.at(0));
  ASSERT_EQ(result.trajectory.size(), reference.size() + 1);
  std::vector<double> errors_m;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    errors_m.push_back(distance(result.trajectory[i + 1].pose, reference[i]));
  }
  const auto figures = metrics::statistics(errors_m);
  // Its reference is itself only good to 0.15 m.
  EXPECT_LE(figures.rmse, 0.16) << "[m]; median " << figures.median << ", max " << figures.max;
  EXPECT_TRUE(result.trusted_at_end);
  testing::Test::RecordProperty("rmse_m", std::to_string(figures.rmse));
}

TEST(Indoors, FindsItselfInTheDemoMap) {
  const auto result =
      localize("localization_demo.rawlog", "localization_demo.simplemap.gz", std::nullopt);
  ASSERT_FALSE(result.trajectory.empty());
  const Pose2 end = result.trajectory.back().pose;
  // Where the recording is documented to end.
  const double miss_m = distance(end, {15.89, -10.0, 0.0});
  EXPECT_LE(miss_m, 0.15) << "[m]; ends at (" << end.x << ", " << end.y << ")";
  EXPECT_TRUE(result.trusted_at_end);
  testing::Test::RecordProperty("end_miss_m", std::to_string(miss_m));
}

TEST(Outdoors, FusesTheHuskyRecording) {
  const auto result =
      pipeline::fuse(shipped("datasets/husky_gnss/test1.bag"), {}, {}, {}, {}, noProgress);
  ASSERT_TRUE(result.ready_after_s) << result.waiting_for;
  EXPECT_LE(*result.ready_after_s, 60.0);
  ASSERT_TRUE(result.gnss_gap_m);
  EXPECT_LE(*result.gnss_gap_m, 3.0) << "[m] start-to-end, estimate against GNSS";
  EXPECT_LE(result.largest_jump_m, 0.3) << "[m] between consecutive outputs";
  // One output per wheel message, 10 per second.
  EXPECT_GT(result.trajectory.size(), 3900U);
  EXPECT_GT(result.fixes_accepted, 10 * result.fixes_refused);
  testing::Test::RecordProperty("gap_m", std::to_string(*result.gnss_gap_m));
  testing::Test::RecordProperty("jump_m", std::to_string(result.largest_jump_m));
}

TEST(Outdoors, TheHuskysOwnConfigurationIsTheDefaultWithItsInputsNamed) {
  const auto named = pipeline::loadConfig(shipped("config/filters/husky.yaml"));
  const pipeline::Config plain;
  const auto fused = [](const pipeline::Config& config) {
    return pipeline::fuse(shipped("datasets/husky_gnss/test1.bag"), {}, config, {}, {}, noProgress);
  };
  const auto a = fused(named);
  const auto b = fused(plain);
  ASSERT_EQ(a.trajectory.size(), b.trajectory.size());
  for (std::size_t i = 0; i < a.trajectory.size(); ++i) {
    ASSERT_EQ(distance(a.trajectory[i].pose, b.trajectory[i].pose), 0.0) << "pose " << i;
  }
  EXPECT_EQ(a.fixes_accepted, b.fixes_accepted);
  // The file counts: the compass it names can be left out.
  pipeline::Config without = named;
  without.ekf.use.heading.clear();
  EXPECT_NE(fused(without).trajectory.back().pose.x, a.trajectory.back().pose.x);
}

TEST(Outdoors, ClimbsWithTheJackalRecording) {
  const auto config = pipeline::loadConfig(shipped("config/filters/attitude_sensor.yaml"));
  const auto result =
      pipeline::fuse(shipped("datasets/husky_gnss/test2.bag"), {}, config, {}, {}, noProgress);
  ASSERT_FALSE(result.poses.empty());
  const Pose3& end = result.poses.back().T;
  // Where the tests of the package the recording comes from expect it, and how near.
  const double miss_m = std::hypot(end.x - 1.0206, end.y - 3.4292, end.z - 0.7419);
  EXPECT_LE(miss_m, 0.138) << "[m] after 84 m";
  testing::Test::RecordProperty("miss_m", std::to_string(miss_m));
}

}  // namespace
}  // namespace vestibule::test
