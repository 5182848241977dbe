#pragma once

#include <string>
#include <vector>

#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/tuning/session.hpp"
#include "vestibule/tuning/subject.hpp"
#include "vestibule/tuning/subjects.hpp"

namespace vestibule::tuning {

/// One drive of a recording or of a scenario.
struct DriveSpec {
  const RecordingSpec* recording = nullptr;
  std::uint64_t seed = 0;  ///< of a simulated drive
  [[nodiscard]] std::string name() const;
};

/// The drives of each role, in the order of the session.
[[nodiscard]] std::vector<DriveSpec> drivesOf(const Session& session, Role role);

/// Whether a block counts for an entry of the session.
[[nodiscard]] bool counts(Blocks blocks, int block);

/// Scores of a trajectory against a reference, one per block that counts.
struct BlockGrid {
  Timestamp first;
  double block_s = 60.0;
  Blocks blocks = Blocks::kAll;
  [[nodiscard]] int blockOf(Timestamp stamp) const;
  [[nodiscard]] bool scored(Timestamp stamp) const { return counts(blocks, blockOf(stamp)); }
};

/// Means per block, in the order of the blocks.
class BlockMeans {
 public:
  void add(int block, double value);
  [[nodiscard]] std::vector<Score> means() const;
  /// Square roots of the means.
  [[nodiscard]] std::vector<Score> roots() const;

 private:
  struct Sum {
    int block;
    double sum;
    double count;
  };
  std::vector<Sum> sums_;
};

/// Position error of `estimate`, root mean square per block [m].
[[nodiscard]] std::vector<Score> apeScores(
    const metrics::Trajectory& estimate,
    const metrics::Trajectory& reference,
    const BlockGrid& grid);
/// Error of the relative position over `step_s`, root mean square per block [m].
[[nodiscard]] std::vector<Score> rpeScores(
    const metrics::Trajectory& estimate,
    const metrics::Trajectory& reference,
    double step_s,
    const BlockGrid& grid);

/// The reference of an entry: its file, else the recording's own. Empty when there is none.
[[nodiscard]] metrics::Trajectory referenceOf(
    const RecordingSpec& recording, const SensorRig& rig, const Folders& folders);

/// As trajectory.tum in the folder, which is made. Throws InputError when it cannot be written.
void writeTrajectory(const metrics::Trajectory& trajectory, const std::string& folder);

/// Whether the session asks for an objective.
[[nodiscard]] bool wants(const Session& session, Measure measure);

}  // namespace vestibule::tuning
