#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vestibule/pipeline/config.hpp"

namespace vestibule::tuning {

/// Every number of the configuration by its dotted name ("ekf.gyro.noise_rad_sqrt_s"), in the unit
/// of the YAML file. It is read off describe(), so a new parameter is tunable without a word here.
class ParameterTree {
 public:
  explicit ParameterTree(const pipeline::Config& config);

  /// Empty for an unknown name and for what is no number.
  [[nodiscard]] std::optional<double> value(const std::string& name) const;
  /// "" for a number, else why it cannot be tuned.
  [[nodiscard]] std::string whyNot(const std::string& name) const;

 private:
  std::map<std::string, double> numbers_;
  std::vector<std::string> others_;  ///< words, lists, switches
};

using NamedValues = std::vector<std::pair<std::string, double>>;

/// The configuration with these values on top. Throws ConfigError for a value out of range, of the
/// wrong kind or with an unknown name.
[[nodiscard]] pipeline::Config withValues(
    const pipeline::Config& config, const NamedValues& values);

/// The values as a YAML file for --config: only what differs, nested as config/default.yaml.
[[nodiscard]] std::string asYaml(const NamedValues& values);

/// A number with six significant digits, as YAML and JSON write it.
[[nodiscard]] std::string shortNumber(double value);

}  // namespace vestibule::tuning
