#include "vestibule/tuning/scoring.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>

#include "vestibule/core/random.hpp"
#include "vestibule/tuning/parameter_tree.hpp"

namespace vestibule::tuning {
namespace {

constexpr int kResamplings = 2000;
/// A candidate must give a number for this share of the blocks that the defaults gave one for.
constexpr double kFewestShare = 0.9;

/// A number of the defaults and of the candidate for the same block, seed and objective.
struct Pair {
  std::size_t objective;
  double before;
  double after;
};
using Piece = std::vector<Pair>;

using Key =
    std::tuple<std::size_t, std::size_t, std::uint64_t, int>;  // objective, drive, seed, block

std::map<Key, double> byKey(const Evaluation& e) {
  std::map<Key, double> scores;
  for (std::size_t c = 0; c < e.cases.size(); ++c) {
    for (std::size_t o = 0; o < e.outcomes[c].objectives.size(); ++o) {
      for (const Score& s : e.outcomes[c].objectives[o]) {
        scores[{o, e.cases[c].drive, e.cases[c].seed, s.block}] = s.value;
      }
    }
  }
  return scores;
}

/// What both have a number for, in pieces that are taken for independent.
std::vector<Piece> piecesOf(const Evaluation& defaults, const Evaluation& other) {
  const auto before = byKey(defaults);
  const auto after = byKey(other);
  std::map<std::tuple<std::size_t, int, std::uint64_t>, Piece> pieces;
  for (const auto& [key, value] : before) {
    const auto it = after.find(key);
    if (it == after.end()) continue;
    const auto& [objective, drive, seed, block] = key;
    pieces[{drive, block, block == kWholeRun ? seed : 0}].push_back({objective, value, it->second});
  }
  std::vector<Piece> list;
  for (auto& entry : pieces) list.push_back(std::move(entry.second));
  return list;
}

bool isLogarithm(Measure m) {
  return m == Measure::kInnovation || m == Measure::kScanLikelihood || m == Measure::kNees ||
         m == Measure::kNis;
}

double mean(const std::vector<double>& v) {
  return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
}

/// \pre not empty
double levelOf(Measure measure, std::vector<double> v) {
  switch (measure) {
    case Measure::kInnovation:
    case Measure::kScanLikelihood:
      return mean(v);
    case Measure::kNees:
    case Measure::kNis:
      return std::abs(std::log(std::max(mean(v), 1e-12)));
    default:
      break;
  }
  const auto worst = std::max<std::size_t>(1, v.size() / 5);
  std::sort(v.begin(), v.end());
  const double tail = std::accumulate(v.end() - static_cast<std::ptrdiff_t>(worst), v.end(), 0.0) /
                      static_cast<double>(worst);
  return (mean(v) + 0.5 * tail) / 1.5;
}

/// Cost of the pieces `chosen`, each with before and after swapped where `swapped` says so.
template <class Chosen, class Swapped>
double costOf(
    const std::vector<Objective>& objectives,
    const std::vector<Piece>& pieces,
    std::size_t n,
    const Chosen& chosen,
    const Swapped& swapped) {
  std::vector<std::vector<double>> before(objectives.size());
  std::vector<std::vector<double>> after(objectives.size());
  for (std::size_t i = 0; i < n; ++i) {
    const bool swap = swapped(i);
    for (const Pair& p : pieces[chosen(i)]) {
      before[p.objective].push_back(swap ? p.after : p.before);
      after[p.objective].push_back(swap ? p.before : p.after);
    }
  }
  double sum = 0.0;
  double weights = 0.0;
  for (std::size_t o = 0; o < objectives.size(); ++o) {
    if (before[o].empty()) continue;
    const Measure m = objectives[o].measure;
    const double d = levelOf(m, before[o]);
    const double t = levelOf(m, after[o]);
    const double relative = isLogarithm(m) ? std::exp(t - d) : t / std::max(d, 1e-12);
    sum += objectives[o].weight * relative;
    weights += objectives[o].weight;
  }
  return weights > 0.0 ? std::min(sum / weights, kPenalty) : kPenalty;
}

double costOf(const std::vector<Objective>& objectives, const std::vector<Piece>& pieces) {
  return costOf(
      objectives,
      pieces,
      pieces.size(),
      [](std::size_t i) { return i; },
      [](std::size_t) { return false; });
}

}  // namespace

std::string Evaluation::failure() const {
  for (const Outcome& o : outcomes) {
    if (!o.failure.empty()) return o.failure;
  }
  return "";
}

std::string whyNotComparable(const Evaluation& defaults, const Evaluation& other) {
  std::string failure = other.failure();
  if (!failure.empty()) return failure;
  const auto before = byKey(defaults);
  const auto after = byKey(other);
  std::size_t common = 0;
  for (const auto& [key, value] : after) {
    if (!std::isfinite(value)) return "a score is not finite";
    common += before.count(key);
  }
  if (static_cast<double>(common) < kFewestShare * static_cast<double>(before.size())) {
    return "gives a number for " + std::to_string(common) + " of " + std::to_string(before.size()) +
           " blocks only";
  }
  return before.empty() ? "the defaults give no number" : "";
}

double relativeCost(
    const std::vector<Objective>& objectives, const Evaluation& defaults, const Evaluation& other) {
  if (!whyNotComparable(defaults, other).empty()) return kPenalty;
  return costOf(objectives, piecesOf(defaults, other));
}

double level(Measure measure, const Evaluation& evaluation, std::size_t objective) {
  std::vector<double> values;
  for (const Outcome& outcome : evaluation.outcomes) {
    if (objective >= outcome.objectives.size()) continue;
    for (const Score& s : outcome.objectives[objective]) values.push_back(s.value);
  }
  return values.empty() ? 0.0 : levelOf(measure, std::move(values));
}

bool Gain::significant(double confidence) const {
  return failure.empty() && blocks >= kFewestBlocks && low > 0.0 &&
         p_value <= 0.5 * (1.0 - confidence);
}

Gain compare(
    const std::vector<Objective>& objectives,
    const Evaluation& defaults,
    const Evaluation& other,
    double confidence,
    std::uint64_t seed) {
  Gain result;
  result.failure = whyNotComparable(defaults, other);
  if (!result.failure.empty()) return result;
  const std::vector<Piece> pieces = piecesOf(defaults, other);
  result.blocks = pieces.size();
  result.gain = 1.0 - costOf(objectives, pieces);
  std::vector<double> gains;
  int as_large = 0;
  for (int r = 0; r < kResamplings; ++r) {
    RandomStream random(seed, "bootstrap", static_cast<std::uint64_t>(r));
    std::vector<std::size_t> drawn(pieces.size());
    for (std::size_t& i : drawn) i = random() % pieces.size();
    gains.push_back(
        1.0 - costOf(
                  objectives,
                  pieces,
                  pieces.size(),
                  [&](std::size_t i) { return drawn[i]; },
                  [](std::size_t) { return false; }));
    RandomStream coin(seed, "swap", static_cast<std::uint64_t>(r));
    const double swapped = 1.0 - costOf(
                                     objectives,
                                     pieces,
                                     pieces.size(),
                                     [](std::size_t i) { return i; },
                                     [&](std::size_t) { return coin.bernoulli(0.5); });
    if (swapped >= result.gain) ++as_large;
  }
  // The gain itself is one of the swaps.
  result.p_value = (as_large + 1.0) / (kResamplings + 1.0);
  std::sort(gains.begin(), gains.end());
  const auto at = [&gains](double p) {
    return gains[static_cast<std::size_t>(p * static_cast<double>(gains.size() - 1))];
  };
  result.low = at(0.5 * (1.0 - confidence));
  result.high = at(0.5 * (1.0 + confidence));
  return result;
}

}  // namespace vestibule::tuning
