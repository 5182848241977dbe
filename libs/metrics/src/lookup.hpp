#pragma once

#include <algorithm>
#include <cstdlib>
#include <optional>
#include <utility>
#include <vector>

#include "vestibule/metrics/trajectory.hpp"

namespace vestibule::metrics {

/// Looks poses up by stamp in a trajectory whose stamps may repeat and run backwards.
/// Refers to the trajectory, which must outlive it.
class StampIndex {
 public:
  explicit StampIndex(const Trajectory& trajectory) : trajectory_(trajectory) {
    for (std::size_t i = 0; i < trajectory.size(); ++i) {
      order_.emplace_back(trajectory[i].stamp.ns, i);
    }
    std::sort(order_.begin(), order_.end());
  }

  /// Index of the pose with the nearest stamp, if within max_dt. Among equally near ones the first
  /// in file order that comes after `previous`, else the first.
  [[nodiscard]] std::optional<std::size_t> nearest(
      Timestamp stamp, Duration max_dt, std::optional<std::size_t> previous = {}) const {
    const auto above = firstFrom(stamp.ns);
    std::optional<std::int64_t> best;
    for (const auto& stamp_ns : {above, below(above)}) {
      if (!stamp_ns) continue;
      const std::int64_t dt = std::abs(*stamp_ns - stamp.ns);
      if (dt <= max_dt.count() && (!best || dt < std::abs(*best - stamp.ns))) best = stamp_ns;
    }
    if (!best) return std::nullopt;
    const auto range = rangeOf(*best);
    if (previous) {
      for (auto it = range.first; it != range.second; ++it) {
        if (it->second > *previous) return it->second;
      }
    }
    return range.first->second;
  }

  /// The pose at `stamp`, interpolated between its neighbours if the nearer is within max_dt.
  [[nodiscard]] std::optional<Pose2> interpolated(Timestamp stamp, Duration max_dt) const {
    const auto above = firstFrom(stamp.ns);
    if (!above) return std::nullopt;
    const Pose2& after = trajectory_[rangeOf(*above).first->second].pose;
    if (*above == stamp.ns) return after;
    const auto before = below(above);
    if (!before) return std::nullopt;
    if (std::min(*above - stamp.ns, stamp.ns - *before) > max_dt.count()) return std::nullopt;
    const double s =
        static_cast<double>(stamp.ns - *before) / static_cast<double>(*above - *before);
    return interpolate(trajectory_[rangeOf(*before).first->second].pose, after, s);
  }

 private:
  using Entry = std::pair<std::int64_t, std::size_t>;

  [[nodiscard]] std::optional<std::int64_t> firstFrom(std::int64_t ns) const {
    const auto it = std::lower_bound(order_.begin(), order_.end(), Entry{ns, 0});
    if (it == order_.end()) return std::nullopt;
    return it->first;
  }
  /// The largest stamp below `above` (below everything: the last one).
  [[nodiscard]] std::optional<std::int64_t> below(std::optional<std::int64_t> above) const {
    const auto it =
        above ? std::lower_bound(order_.begin(), order_.end(), Entry{*above, 0}) : order_.end();
    if (it == order_.begin()) return std::nullopt;
    return std::prev(it)->first;
  }
  [[nodiscard]] std::pair<std::vector<Entry>::const_iterator, std::vector<Entry>::const_iterator>
  rangeOf(std::int64_t ns) const {
    return {
        std::lower_bound(order_.begin(), order_.end(), Entry{ns, 0}),
        std::lower_bound(order_.begin(), order_.end(), Entry{ns + 1, 0})};
  }

  const Trajectory& trajectory_;
  std::vector<Entry> order_;
};

}  // namespace vestibule::metrics
