#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "vestibule/amcl/lost_model.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/place_bench.hpp"
#include "vestibule/pipeline/progress.hpp"

namespace vestibule::pipeline {

/// What makes a simulated drive hard for the localizer.
enum class Trouble { kNone, kCrowd, kKidnap, kWrongStart, kWrongMap };
[[nodiscard]] std::string_view toString(Trouble trouble);

/// The localizer's judgement of itself at one moment, beside the truth.
struct LostSample {
  int drive = 0;
  double driven_m = 0.0;
  Trouble trouble = Trouble::kNone;
  amcl::LostEvidence evidence;
  double probability = 0.0;  ///< that it is lost, as it says
  double error_m = 0.0;
  double error_rad = 0.0;
  bool lost = false;  ///< farther than 0.5 m or 10 degrees from the truth
};

/// Lets a robot wander through a place, 40 m in each drive, with one trouble each, in turn, at
/// random strengths: none, people hiding 20 to 75 % of the view, being carried elsewhere, a wrong
/// start, and a map with left and right swapped. The localizer is left alone with it (nothing
/// searches again). One sample per second; the same ones for any number of threads.
[[nodiscard]] std::vector<LostSample> sampleLost(
    const LostPlace& place,
    const Config& config,
    int drives,
    std::uint64_t seed,
    const Progress& progress);

/// Reliability of the probability: samples by what it said, against how often that was so.
struct Reliability {
  struct Bin {
    double weight = 0.0;  ///< of its samples
    double mean_probability = 0.0;
    double lost_share = 0.0;
  };
  std::vector<Bin> bins;  ///< of equal width over [0, 1]
  double expected_calibration_error = 0.0;
  double brier_score = 0.0;
  double skill =
      0.0;  ///< share of the Brier score of always saying the mean that is gone; 1 = best
  double lost_share = 0.0;
};
/// Every place counts the same, however many samples it has. \pre no place is without samples
[[nodiscard]] Reliability reliabilityOf(
    const std::vector<std::vector<LostSample>>& places, int bins = 10);

/// The weights of amcl::lostFeatures() that explain the samples best (logistic regression with a
/// slight pull to zero, by Newton's method); every place counts the same.
[[nodiscard]] amcl::LostFeatures fitLostModel(const std::vector<std::vector<LostSample>>& places);

/// The samples with the probabilities that a model fitted to all *other* places gives them: how
/// right the probability can be expected to be where nobody fitted it. \pre two places at least
[[nodiscard]] std::vector<std::vector<LostSample>> judgedByOthers(
    std::vector<std::vector<LostSample>> places);

}  // namespace vestibule::pipeline
