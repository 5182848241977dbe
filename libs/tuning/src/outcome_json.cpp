#include "outcome_json.hpp"

#include <limits>

namespace vestibule::tuning {

nlohmann::ordered_json toJson(const Outcome& outcome) {
  nlohmann::ordered_json json;
  if (!outcome.failure.empty()) json["failure"] = outcome.failure;
  auto& objectives = json["scores"] = nlohmann::ordered_json::array();
  for (const auto& scores : outcome.objectives) {
    auto list = nlohmann::ordered_json::array();
    for (const Score& s : scores) list.push_back({s.block, s.value});
    objectives.push_back(std::move(list));
  }
  return json;
}

Outcome outcomeFrom(const nlohmann::ordered_json& json) {
  Outcome outcome;
  outcome.failure = json.value("failure", "");
  outcome.cpu_s = json.value("cpu_s", 0.0);
  for (const auto& list : json.at("scores")) {
    std::vector<Score> scores;
    for (const auto& s : list) {
      // JSON has no NaN or infinity: they are written as null.
      const double value =
          s.at(1).is_null() ? std::numeric_limits<double>::quiet_NaN() : s.at(1).get<double>();
      scores.push_back({s.at(0).get<int>(), value});
    }
    outcome.objectives.push_back(std::move(scores));
  }
  return outcome;
}

}  // namespace vestibule::tuning
