#pragma once

#include <optional>

#include "vestibule/core/time.hpp"
#include "vestibule/ekf/params.hpp"

namespace vestibule::ekf {

/// By how much measurements of one kind err more than they claim, learnt slowly from how far they
/// lie from the estimate before any gate: data that are refused count as well, cut off, so that
/// refusing them cannot make the filter surer. Never below one: claims are floors. For the weight
/// of what passed the gate, not for the gate: that would open for what it is to keep out.
class NoiseScale {
 public:
  /// \param params outlives it and its copies
  explicit NoiseScale(const FilterParams& params) : params_(&params) {}

  /// \param nis_per_dof  of a test against the claims
  void note(Timestamp stamp, double nis_per_dof);
  /// Of the variance.
  [[nodiscard]] double value() const;

 private:
  const FilterParams* params_;
  double ratio_ = 1.0;  ///< running mean of the squared error over the claim
  std::optional<Timestamp> last_;
};

}  // namespace vestibule::ekf
