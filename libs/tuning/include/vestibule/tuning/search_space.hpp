#pragma once

#include <string>
#include <vector>

#include "vestibule/pipeline/config.hpp"
#include "vestibule/tuning/parameter_tree.hpp"
#include "vestibule/tuning/session.hpp"

namespace vestibule::tuning {

/// The tuned parameters as a unit cube, log or linear. Values are rounded to six digits (and whole
/// numbers where the parameter is one), so that what is written is what was tried.
class SearchSpace {
 public:
  SearchSpace(std::vector<TunedParameter> parameters, const ParameterTree& base);

  [[nodiscard]] std::size_t size() const { return parameters_.size(); }
  [[nodiscard]] const std::vector<TunedParameter>& parameters() const { return parameters_; }

  /// One value per parameter, in the unit of the YAML.
  [[nodiscard]] std::vector<double> values(const std::vector<double>& cube) const;
  [[nodiscard]] std::vector<double> cube(const std::vector<double>& values) const;
  /// With the ties.
  [[nodiscard]] NamedValues named(const std::vector<double>& values) const;
  /// The values before tuning, as they are in the base configuration (perhaps out of the range).
  [[nodiscard]] const std::vector<double>& defaults() const { return defaults_; }

 private:
  std::vector<TunedParameter> parameters_;
  std::vector<bool> whole_;
  std::vector<double> defaults_;
  std::vector<std::vector<double>> tie_ratios_;
};

}  // namespace vestibule::tuning
