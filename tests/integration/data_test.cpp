// Accuracy on recordings that are too large or not free to ship. VESTIBULE_DATA names the folder
// that has them:
//   nclt_1hz/*.csv, radish/mit-csail.clf.bz2, radish_corrected/csail-corrected.log.gz

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "test_files.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/pipeline/fuse.hpp"
#include "vestibule/pipeline/localize.hpp"
#include "vestibule/pipeline/map.hpp"

namespace vestibule::test {
namespace {

void noProgress(double /*share*/, double /*data_s*/) {}

/// The folder of development recordings; says so where it is not given.
std::optional<std::string> dataFolder() {
  const char* folder = std::getenv("VESTIBULE_DATA");
  if (folder != nullptr && *folder != '\0') return std::string(folder) + "/";
  std::cout << "NOTICE: VESTIBULE_DATA is not set, so this accuracy was NOT checked: it needs "
               "recordings that the project does not ship\n";
  testing::Test::RecordProperty("checked", "no: VESTIBULE_DATA is not set");
  return std::nullopt;
}

void expectNcltError(const std::string& file, double bar_m) {
  const auto folder = dataFolder();
  if (!folder) return;
  const std::string log = *folder + "nclt_1hz/" + file;
  io::RecordingOptions options;
  options.csv_mapping = shipped("config/csv/nclt_1hz.yaml");
  const auto result = pipeline::fuse(log, options, {}, {}, {}, noProgress);
  ASSERT_TRUE(result.ready_after_s) << result.waiting_for;

  metrics::Trajectory reference;
  const auto own_reference = io::readReference(log, options);
  ASSERT_TRUE(own_reference);
  for (const io::StampedPose& p : *own_reference) {
    reference.push_back({p.stamp, toPose2(p.T)});
  }
  metrics::AssociationOptions association;
  association.matching = metrics::Matching::kInterpolated;
  association.max_dt = std::chrono::seconds(2);
  const auto matches = metrics::associate(result.trajectory, reference, association);
  EXPECT_GT(matches.size(), reference.size() * 9 / 10);
  const auto errors = metrics::absoluteErrors(matches, metrics::Alignment::kNone).translation_m;
  EXPECT_LE(errors.rmse, bar_m) << "[m]; median " << errors.median << ", 95 % " << errors.p95
                                << ", max " << errors.max;
  testing::Test::RecordProperty("rmse_m", std::to_string(errors.rmse));
}

TEST(NeedsData, NcltShort) { expectNcltError("nclt_2013-01-10_1hz.csv", 8.0); }
TEST(NeedsData, NcltLong) { expectNcltError("nclt_2012-11-04_1hz.csv", 18.0); }

/// A scan with the pose its log gives it.
struct PosedScan {
  std::vector<float> ranges_m;
  Pose2 T_log_base;
};

std::vector<PosedScan> posedScans(const std::string& log) {
  std::vector<PosedScan> scans;
  const auto reader = io::openRecording(log, {});
  while (const auto record = reader->next()) {
    const auto* scan = std::get_if<LaserScan>(&record->measurement);
    if (scan != nullptr) scans.push_back({scan->ranges_m, scan->T_log_base.value()});
  }
  return scans;
}

TEST(NeedsData, CsailStaysOnTheMapOfItsCorrectedLog) {
  const auto folder = dataFolder();
  if (!folder) return;
  const std::string raw_log = *folder + "radish/mit-csail.clf.bz2";
  const std::string corrected_log = *folder + "radish_corrected/csail-corrected.log.gz";

  // The stamps of the two logs have nothing in common, the ranges are identical.
  std::map<std::vector<float>, Pose2> corrected;
  for (const PosedScan& scan : posedScans(corrected_log)) {
    corrected[scan.ranges_m] = scan.T_log_base;
  }
  const std::vector<PosedScan> raw = posedScans(raw_log);
  std::vector<std::pair<std::size_t, Pose2>> reference;  // index of the raw scan, corrected pose
  for (std::size_t i = 0; i < raw.size(); ++i) {
    const auto same = corrected.find(raw[i].ranges_m);
    if (same != corrected.end()) reference.emplace_back(i, same->second);
  }
  ASSERT_GE(reference.size(), 400U);

  // Odometry leads from the first corrected scan back to the first raw one.
  const Pose2 init = compose(
      reference.front().second,
      between(raw[reference.front().first].T_log_base, raw.front().T_log_base));
  const auto map = pipeline::mapFromKnownPoses(corrected_log, {}, {}, {}, noProgress);
  const auto result = pipeline::localize(
      raw_log, {}, std::make_shared<const grid::OccupancyMap>(map.map), init, {}, {}, noProgress);
  ASSERT_EQ(result.trajectory.size(), raw.size());
  std::vector<double> errors_m;
  for (const auto& [i, T_map_base] : reference) {
    errors_m.push_back(distance(result.trajectory[i].pose, T_map_base));
  }
  const auto figures = metrics::statistics(errors_m);
  EXPECT_LE(figures.max, 0.5) << "[m]; rmse " << figures.rmse << " over " << figures.count;
  testing::Test::RecordProperty("max_m", std::to_string(figures.max));
  testing::Test::RecordProperty("rmse_m", std::to_string(figures.rmse));
}

}  // namespace
}  // namespace vestibule::test
