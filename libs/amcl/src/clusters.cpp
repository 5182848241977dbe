#include "clusters.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "vestibule/core/angles.hpp"

namespace vestibule::amcl {
namespace {

/// Bin of a pose as one number: 24 bits per coordinate, 16 for yaw.
class Bins {
 public:
  Bins(double bin_m, double bin_rad)
      : per_m_(1.0 / bin_m),
        yaw_bins_(std::max(1, static_cast<int>(std::lround(2.0 * kPi / bin_rad)))) {}

  [[nodiscard]] std::uint64_t of(const Pose2& p) const {
    const auto yaw = static_cast<int>(std::floor((p.phi + kPi) / (2.0 * kPi) * yaw_bins_));
    return key(
        static_cast<std::int64_t>(std::floor(p.x * per_m_)),
        static_cast<std::int64_t>(std::floor(p.y * per_m_)),
        ((yaw % yaw_bins_) + yaw_bins_) % yaw_bins_);
  }
  [[nodiscard]] std::uint64_t neighbour(std::uint64_t bin, int dx, int dy, int dyaw) const {
    const auto x = static_cast<std::int64_t>(bin >> 40U) - kOffset;
    const auto y = static_cast<std::int64_t>((bin >> 16U) & 0xFFFFFFU) - kOffset;
    const auto yaw = static_cast<int>(bin & 0xFFFFU);
    return key(x + dx, y + dy, (yaw + dyaw + yaw_bins_) % yaw_bins_);
  }

 private:
  static constexpr std::int64_t kOffset = 1 << 23;
  static std::uint64_t key(std::int64_t x, std::int64_t y, int yaw) {
    return (static_cast<std::uint64_t>(x + kOffset) << 40U) |
           (static_cast<std::uint64_t>(y + kOffset) << 16U) | static_cast<std::uint64_t>(yaw);
  }
  double per_m_;
  int yaw_bins_;
};

std::size_t rootOf(std::vector<std::size_t>& parent, std::size_t i) {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

/// Standard normal quantile by bisection of the error function: called once per update.
double normalQuantile(double p) {
  double low = -10.0;
  double high = 10.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (0.5 * std::erfc(-middle / std::sqrt(2.0)) < p ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

Clusters findClusters(const ParticleSet& particles, double bin_m, double bin_rad) {
  const Bins bins(bin_m, bin_rad);
  const std::size_t n = particles.size();
  std::vector<std::uint64_t> bin_of(n);
  for (std::size_t i = 0; i < n; ++i) bin_of[i] = bins.of(particles.pose(i));
  std::vector<std::uint64_t> used = bin_of;
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  const auto indexOf = [&](std::uint64_t bin) {
    const auto at = std::lower_bound(used.begin(), used.end(), bin);
    return at != used.end() && *at == bin ? static_cast<std::size_t>(at - used.begin())
                                          : used.size();
  };

  std::vector<std::size_t> parent(used.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  for (std::size_t b = 0; b < used.size(); ++b) {
    // Half of the 26 neighbours; the other half looks this way itself.
    for (int code = 14; code < 27; ++code) {
      const std::size_t other =
          indexOf(bins.neighbour(used[b], code / 9 - 1, code / 3 % 3 - 1, code % 3 - 1));
      if (other != used.size()) parent[rootOf(parent, other)] = rootOf(parent, b);
    }
  }

  Clusters result;
  result.label.resize(n);
  std::vector<double> weight(used.size(), 0.0);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t root = rootOf(parent, indexOf(bin_of[i]));
    result.label[i] = static_cast<int>(root);
    weight[root] += particles.weights()[i];
  }
  std::vector<std::size_t> roots;
  for (std::size_t b = 0; b < used.size(); ++b) {
    if (parent[b] == b) roots.push_back(b);
  }
  std::stable_sort(roots.begin(), roots.end(), [&](std::size_t a, std::size_t b) {
    return weight[a] > weight[b];
  });
  std::vector<int> rank(used.size(), 0);
  for (std::size_t r = 0; r < roots.size(); ++r) rank[roots[r]] = static_cast<int>(r);
  for (int& label : result.label) label = rank[static_cast<std::size_t>(label)];
  constexpr std::size_t kMaxClusters = 16;
  roots.resize(std::min(roots.size(), kMaxClusters));
  for (std::size_t r = 0; r < roots.size(); ++r) {
    Clusters::One one;
    one.T_grid_base = particles.moments(&one.weight, &result.label, static_cast<int>(r));
    result.clusters.push_back(one);
  }
  return result;
}

std::size_t occupiedBins(
    const ParticleSet& particles,
    const std::vector<std::uint32_t>& draws,
    double bin_m,
    double bin_rad) {
  const Bins bins(bin_m, bin_rad);
  std::vector<std::uint64_t> used;
  used.reserve(draws.size());
  for (std::size_t k = 0; k < draws.size(); ++k) {
    if (k > 0 && draws[k] == draws[k - 1]) continue;
    used.push_back(bins.of(particles.pose(draws[k])));
  }
  std::sort(used.begin(), used.end());
  return static_cast<std::size_t>(std::unique(used.begin(), used.end()) - used.begin());
}

std::size_t kldSampleSize(std::size_t bins, double epsilon, double delta) {
  if (bins < 2) return 1;
  const double k = static_cast<double>(bins) - 1.0;
  const double a = 2.0 / (9.0 * k);
  const double root = 1.0 - a + std::sqrt(a) * normalQuantile(1.0 - delta);
  return static_cast<std::size_t>(std::ceil(k / (2.0 * epsilon) * root * root * root));
}

}  // namespace vestibule::amcl
