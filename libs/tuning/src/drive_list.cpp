#include "drive_list.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "vestibule/core/errors.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/io/trajectory.hpp"

namespace vestibule::tuning {
namespace {

std::vector<metrics::Match> matched(
    const metrics::Trajectory& estimate, const metrics::Trajectory& reference) {
  metrics::AssociationOptions association;
  association.matching = metrics::Matching::kInterpolated;
  association.max_dt = std::chrono::seconds(2);
  return metrics::associate(estimate, reference, association);
}

}  // namespace

std::string DriveSpec::name() const {
  return recording->name() + (recording->scenario.empty() ? "" : " #" + std::to_string(seed));
}

std::vector<DriveSpec> drivesOf(const Session& session, Role role) {
  std::vector<DriveSpec> drives;
  for (const RecordingSpec& r : session.recordings.of(role)) {
    const int n = r.scenario.empty() ? 1 : r.drives;
    for (int i = 0; i < n; ++i)
      drives.push_back({&r, r.first_seed + static_cast<std::uint64_t>(i)});
  }
  return drives;
}

bool counts(Blocks blocks, int block) {
  return blocks == Blocks::kAll || (block % 2 == 0) == (blocks == Blocks::kEven);
}

int BlockGrid::blockOf(Timestamp stamp) const {
  return static_cast<int>(std::floor(toSeconds(stamp - first) / block_s));
}

void BlockMeans::add(int block, double value) {
  const auto it = std::find_if(
      sums_.rbegin(), sums_.rend(), [block](const Sum& s) { return s.block == block; });
  if (it == sums_.rend()) {
    sums_.push_back({block, value, 1.0});
  } else {
    it->sum += value;
    it->count += 1.0;
  }
}

std::vector<Score> BlockMeans::means() const {
  std::vector<Score> scores;
  for (const Sum& s : sums_) scores.push_back({s.block, s.sum / s.count});
  std::sort(scores.begin(), scores.end(), [](const Score& a, const Score& b) {
    return a.block < b.block;
  });
  return scores;
}

std::vector<Score> BlockMeans::roots() const {
  std::vector<Score> scores = means();
  for (Score& s : scores) s.value = std::sqrt(s.value);
  return scores;
}

std::vector<Score> apeScores(
    const metrics::Trajectory& estimate,
    const metrics::Trajectory& reference,
    const BlockGrid& grid) {
  BlockMeans squares;
  for (const metrics::Match& m : matched(estimate, reference)) {
    if (!grid.scored(m.stamp)) continue;
    const double e = distance(m.estimate, m.reference);
    squares.add(grid.blockOf(m.stamp), e * e);
  }
  return squares.roots();
}

std::vector<Score> rpeScores(
    const metrics::Trajectory& estimate,
    const metrics::Trajectory& reference,
    double step_s,
    const BlockGrid& grid) {
  const std::vector<metrics::Match> matches = matched(estimate, reference);
  BlockMeans squares;
  std::size_t j = 0;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    j = std::max(j, i);
    while (j < matches.size() && toSeconds(matches[j].stamp - matches[i].stamp) < step_s) ++j;
    if (j == matches.size()) break;
    if (!grid.scored(matches[i].stamp)) continue;
    const double e = translationNorm(between(
        between(matches[i].reference, matches[j].reference),
        between(matches[i].estimate, matches[j].estimate)));
    squares.add(grid.blockOf(matches[i].stamp), e * e);
  }
  return squares.roots();
}

metrics::Trajectory referenceOf(
    const RecordingSpec& recording, const SensorRig& rig, const Folders& folders) {
  io::Trajectory poses;
  if (!recording.ref.empty()) {
    poses = io::readTum(recording.ref);
  } else if (!recording.log.empty()) {
    io::RecordingOptions options;
    options.rig = rig;
    options.csv_mapping_dir = folders.csv_mappings;
    poses = io::readReference(recording.log, options).value_or(io::Trajectory{});
  }
  metrics::Trajectory reference;
  for (const io::StampedPose& p : poses) reference.push_back({p.stamp, toPose2(p.T)});
  return reference;
}

void writeTrajectory(const metrics::Trajectory& trajectory, const std::string& folder) {
  std::error_code ec;
  std::filesystem::create_directories(folder, ec);
  const std::string path = folder + "/trajectory.tum";
  std::ofstream out(path, std::ios::binary);
  for (const metrics::TimedPose& p : trajectory) {
    out << io::formatTumLine({p.stamp, toPose3(p.pose)});
  }
  if (!out.flush()) throw InputError(path + ": cannot be written (disk full, no such folder?)");
}

bool wants(const Session& session, Measure measure) {
  return std::any_of(
      session.objectives.begin(), session.objectives.end(), [measure](const Objective& o) {
        return o.measure == measure;
      });
}

}  // namespace vestibule::tuning
