#include "vestibule/metrics/relations.hpp"

#include <cmath>
#include <sstream>

#include "lookup.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::metrics {
namespace {

std::vector<std::string> wordsOf(const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

double finiteNumber(const std::string& word, const std::string& where) {
  std::size_t used = 0;
  double value = 0.0;
  try {
    value = std::stod(word, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used != word.size() || !std::isfinite(value)) {
    throw InputError(where + ": '" + word + "' is not a finite number");
  }
  return value;
}

Timestamp stampOf(const std::string& word, const std::string& where) {
  const auto stamp = parseSeconds(word);
  if (!stamp) throw InputError(where + ": '" + word + "' is not a time in seconds");
  return *stamp;
}

}  // namespace

std::vector<Relation> parseRelations(std::istream& in, const std::string& name) {
  std::vector<Relation> relations;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    const auto words = wordsOf(line);
    if (words.empty() || words.front().front() == '#') continue;
    const std::string where = name + ":" + std::to_string(number);
    if (words.size() != 8) {
      throw InputError(
          where + ": a relation has 8 numbers (t1 t2 x y z roll pitch yaw), this line has " +
          std::to_string(words.size()));
    }
    Relation relation{stampOf(words[0], where), stampOf(words[1], where), {}};
    double values[6] = {};
    for (std::size_t i = 0; i < 6; ++i) values[i] = finiteNumber(words[i + 2], where);
    relation.T_first_second = Pose2(values[0], values[1], wrapToPi(values[5]));
    relations.push_back(relation);
  }
  return relations;
}

RelationErrors relationErrors(
    const Trajectory& estimate, const std::vector<Relation>& relations, Duration max_dt) {
  const StampIndex index(estimate);
  RelationErrors result;
  result.relations = relations.size();
  std::vector<double> translation_m;
  std::vector<double> yaw_rad;
  for (const Relation& relation : relations) {
    const auto first = index.nearest(relation.first, max_dt);
    const auto second = index.nearest(relation.second, max_dt);
    if (!first || !second) continue;
    const Pose2 T_first_second = between(estimate[*first].pose, estimate[*second].pose);
    const Pose2 error = between(relation.T_first_second, T_first_second);
    translation_m.push_back(translationNorm(error));
    yaw_rad.push_back(std::abs(error.phi));
  }
  result.matched = translation_m.size();
  result.translation_m = statistics(std::move(translation_m));
  result.yaw_rad = statistics(std::move(yaw_rad));
  return result;
}

}  // namespace vestibule::metrics
