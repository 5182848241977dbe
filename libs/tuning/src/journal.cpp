#include "vestibule/tuning/journal.hpp"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "outcome_json.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::tuning {
namespace {

using Json = nlohmann::ordered_json;

Json toJson(const std::string& set, const Evaluation& e, double cost, bool with_cpu) {
  Json line;
  line["set"] = set;
  line["values"] = e.values;
  line["cost"] = cost;
  const std::string failure = e.failure();
  if (!failure.empty()) line["failure"] = failure;
  Json& runs = line["runs"] = Json::array();
  for (std::size_t i = 0; i < e.cases.size(); ++i) {
    Json run;
    run["drive"] = e.cases[i].drive;
    run["seed"] = e.cases[i].seed;
    run.update(tuning::toJson(e.outcomes[i]));
    if (with_cpu) run["cpu_s"] = e.outcomes[i].cpu_s;
    runs.push_back(std::move(run));
  }
  return line;
}

Evaluation fromJson(const Json& line) {
  Evaluation e;
  e.values = line.at("values").get<std::vector<double>>();
  for (const Json& run : line.at("runs")) {
    e.cases.push_back({run.at("drive").get<std::size_t>(), run.at("seed").get<std::uint64_t>()});
    e.outcomes.push_back(outcomeFrom(run));
  }
  return e;
}

}  // namespace

Journal::Journal(std::string path, const std::string& fingerprint, bool with_cpu)
    : path_(std::move(path)), fingerprint_(fingerprint), with_cpu_(with_cpu) {
  if (path_.empty()) return;
  std::error_code ec;
  if (std::filesystem::exists(path_, ec)) read();
}

void Journal::read() {
  std::ifstream in(path_, std::ios::binary);
  std::string line;
  std::size_t number_of_line = 0;
  std::uintmax_t good_bytes = 0;
  while (std::getline(in, line)) {
    if (in.eof()) break;  // no newline: cut off by a kill
    ++number_of_line;
    try {
      const Json json = Json::parse(line);
      if (number_of_line == 1) {
        if (json.at("session") != fingerprint_) {
          throw ConfigError(
              path_ +
              ": belongs to another session (or to this one before it was changed); give "
              "another --out or remove the file");
        }
      } else {
        Evaluation e = fromJson(json);
        auto key = std::make_pair(json.at("set").get<std::string>(), e.values);
        known_.insert_or_assign(std::move(key), std::move(e));
        ++resumed_;
      }
    } catch (const Json::exception&) {
      throw ConfigError(
          path_ + ":" + std::to_string(number_of_line) +
          ": not a line of a tuning session; give another --out or remove the file");
    }
    good_bytes += line.size() + 1;
  }
  in.close();
  if (number_of_line == 0) {
    std::filesystem::remove(path_);
  } else {
    std::filesystem::resize_file(path_, good_bytes);
  }
}

void Journal::open() {
  std::error_code ec;
  const bool is_new = !std::filesystem::exists(path_, ec);
  out_.open(path_, std::ios::binary | std::ios::app);
  if (is_new) out_ << Json{{"session", fingerprint_}}.dump() << "\n";
}

const Evaluation* Journal::find(const std::string& set, const std::vector<double>& values) const {
  const auto it = known_.find({set, values});
  return it == known_.end() ? nullptr : &it->second;
}

void Journal::append(const std::string& set, const Evaluation& evaluation, double cost) {
  known_.insert_or_assign({set, evaluation.values}, evaluation);
  if (path_.empty()) return;
  if (!out_.is_open()) open();
  out_ << toJson(set, evaluation, cost, with_cpu_).dump() << "\n" << std::flush;
  if (!out_) throw ConfigError(path_ + ": cannot be written (disk full?)");
}

}  // namespace vestibule::tuning
