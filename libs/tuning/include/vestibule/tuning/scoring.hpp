#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "vestibule/tuning/session.hpp"
#include "vestibule/tuning/subject.hpp"

namespace vestibule::tuning {

/// A run of a candidate in a set of runs.
struct Case {
  std::size_t drive = 0;
  std::uint64_t seed = 0;
};

/// What a candidate did in all runs of a set.
struct Evaluation {
  std::vector<double> values;
  std::vector<Case> cases;
  std::vector<Outcome> outcomes;  ///< one per case
  /// The first failure among the outcomes; empty when none failed.
  [[nodiscard]] std::string failure() const;
};

/// What a failed candidate costs. Finite, so that the search goes on.
inline constexpr double kPenalty = 1000.0;

/// The cost of a candidate against the defaults on the same runs: the weighted mean over the
/// objectives of
/// - errors in metres: their level over that of the defaults, the level being
///   (mean + half the mean of the worst fifth) / 1.5;
/// - logarithms (likelihoods, consistency): exp(difference to the defaults).
/// So 1 is as good as the defaults, whatever the units; kPenalty for a failed candidate.
[[nodiscard]] double relativeCost(
    const std::vector<Objective>& objectives, const Evaluation& defaults, const Evaluation& other);
/// Why `other` cannot be compared with the defaults: its failure, or too few of the blocks that the
/// defaults gave a number for. Empty when it can.
[[nodiscard]] std::string whyNotComparable(const Evaluation& defaults, const Evaluation& other);

/// Level of one objective over all runs, in its own unit.
[[nodiscard]] double level(Measure measure, const Evaluation& evaluation, std::size_t objective);

/// A gain and what it is worth.
struct Gain {
  double gain = 0.0;  ///< 1 - relative cost
  double low = 0.0;   ///< bounds of the bootstrap interval
  double high = 0.0;
  double p_value = 1.0;    ///< of so large a gain by chance: swapping default and candidate
  std::size_t blocks = 0;  ///< independent pieces of data behind it
  std::string failure;     ///< why there is no gain to speak of
  [[nodiscard]] bool significant(double confidence) const;
};
/// Fewer pieces of data than this never make a gain significant.
inline constexpr std::size_t kFewestBlocks = 8;

/// Paired comparison. The pieces that are resampled and swapped are blocks of a drive, with all
/// seeds and objectives of the block together; runs with one number are pieces of their own.
[[nodiscard]] Gain compare(
    const std::vector<Objective>& objectives,
    const Evaluation& defaults,
    const Evaluation& other,
    double confidence,
    std::uint64_t seed);

}  // namespace vestibule::tuning
