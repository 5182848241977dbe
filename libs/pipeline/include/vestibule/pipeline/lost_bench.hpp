#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "vestibule/amcl/lost_model.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/progress.hpp"

namespace vestibule::pipeline {

/// What makes a simulated drive hard for the localizer.
enum class Trouble { kNone, kCrowd, kKidnap, kWrongStart, kWrongMap };
[[nodiscard]] std::string_view toString(Trouble trouble);

/// The localizer's judgement of itself at one moment, beside the truth.
struct LostSample {
  Trouble trouble = Trouble::kNone;
  amcl::LostEvidence evidence;
  double probability = 0.0;  ///< that it is lost, as it says
  bool lost = false;         ///< farther than 0.5 m or 10 degrees from the truth
};

/// Drives of the scenario with one trouble each, in turn, at random strengths; the localizer is
/// left alone with it (nothing searches again). One sample per second.
/// \param scenario one with a site and a given map, e.g. office_nominal
[[nodiscard]] std::vector<LostSample> sampleLost(
    const std::string& scenario,
    const std::string& scenario_folder,
    int drives,
    const Config& config,
    const Progress& progress);

/// Reliability of the probability: samples by what it said, against how often that was so.
struct Reliability {
  struct Bin {
    std::size_t samples = 0;
    double mean_probability = 0.0;
    double lost_share = 0.0;
  };
  std::vector<Bin> bins;  ///< of equal width over [0, 1]
  double expected_calibration_error = 0.0;
  double brier_score = 0.0;
  double lost_share = 0.0;
};
[[nodiscard]] Reliability reliabilityOf(const std::vector<LostSample>& samples, int bins = 10);

}  // namespace vestibule::pipeline
