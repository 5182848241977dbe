#include "vestibule/tuning/search_space.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "vestibule/core/errors.hpp"

namespace vestibule::tuning {
namespace {

/// Whether the configuration takes nothing but whole numbers here: it is asked.
bool isWhole(const TunedParameter& p) {
  const double between = std::floor(0.5 * (p.from + p.to)) + 0.5;
  try {
    (void)withValues({}, {{p.name, between}});
  } catch (const ConfigError& e) {
    return std::string(e.what()).find("whole number") != std::string::npos;
  }
  return false;
}

double rounded(double value) { return std::strtod(shortNumber(value).c_str(), nullptr); }

}  // namespace

SearchSpace::SearchSpace(std::vector<TunedParameter> parameters, const ParameterTree& base)
    : parameters_(std::move(parameters)) {
  for (const TunedParameter& p : parameters_) {
    const double value = base.value(p.name).value_or(0.0);
    defaults_.push_back(value);
    whole_.push_back(isWhole(p));
    std::vector<double> ratios;
    for (const std::string& tie : p.ties) ratios.push_back(base.value(tie).value_or(0.0) / value);
    tie_ratios_.push_back(std::move(ratios));
  }
}

std::vector<double> SearchSpace::values(const std::vector<double>& cube) const {
  std::vector<double> values;
  for (std::size_t i = 0; i < size(); ++i) {
    const TunedParameter& p = parameters_[i];
    const double u = std::clamp(cube[i], 0.0, 1.0);
    double value = p.log ? p.from * std::pow(p.to / p.from, u) : p.from + u * (p.to - p.from);
    value = rounded(whole_[i] ? std::round(value) : value);
    values.push_back(std::clamp(value, p.from, p.to));
  }
  return values;
}

std::vector<double> SearchSpace::cube(const std::vector<double>& values) const {
  std::vector<double> cube;
  for (std::size_t i = 0; i < size(); ++i) {
    const TunedParameter& p = parameters_[i];
    const double v = std::clamp(values[i], p.from, p.to);
    cube.push_back(
        p.log ? std::log(v / p.from) / std::log(p.to / p.from) : (v - p.from) / (p.to - p.from));
  }
  return cube;
}

NamedValues SearchSpace::named(const std::vector<double>& values) const {
  NamedValues named;
  for (std::size_t i = 0; i < size(); ++i) {
    named.emplace_back(parameters_[i].name, values[i]);
    for (std::size_t t = 0; t < parameters_[i].ties.size(); ++t) {
      named.emplace_back(parameters_[i].ties[t], rounded(values[i] * tie_ratios_[i][t]));
    }
  }
  return named;
}

}  // namespace vestibule::tuning
