#include "history.hpp"

#include <algorithm>

namespace vestibule::ekf {
namespace {

/// Going back costs at most this much data more than necessary.
constexpr Duration kCheckpointEvery = std::chrono::milliseconds(100);

bool before(const Input& a, const Input& b) { return compare(a, b) < 0; }

}  // namespace

void History::keepOrder(bool only_in_order) {
  if (only_in_order_ == only_in_order) return;
  only_in_order_ = only_in_order;
  while (inputs_.size() > 1) inputs_.pop_front();
  checkpoints_.clear();
  checkpoints_.push_back({inputs_.empty() ? std::nullopt : std::optional(inputs_.back()), core_});
}

UpdateReport History::insert(const Input& input) {
  if (inputs_.empty() || before(inputs_.back(), input)) {
    const bool too_old = core_.started() && stampOf(input) < core_.time();
    if (!too_old) {
      if (only_in_order_) {
        inputs_.resize(1);
        inputs_.front() = input;
        return core_.apply(input);
      }
      inputs_.push_back(input);
      const UpdateReport report = apply(input);
      forget();
      return report;
    }
  }
  UpdateReport report;
  report.decision = Decision::kRejected;
  report.reason = "stale";
  if (only_in_order_ || stampOf(input) + window_ < core_.time()) return report;
  const auto place = std::lower_bound(inputs_.begin(), inputs_.end(), input, before);
  if (place != inputs_.end() && compare(*place, input) == 0) {
    report.reason = "duplicate";
    return report;
  }
  const auto& oldest = checkpoints_.front().last;
  if (oldest && !before(*oldest, input)) return report;
  return replay(place, input);
}

UpdateReport History::apply(const Input& input) {
  const UpdateReport report = core_.apply(input);
  const auto& last = checkpoints_.back().last;
  if (!last || stampOf(*last) + kCheckpointEvery <= stampOf(input)) {
    checkpoints_.push_back({input, core_});
  }
  return report;
}

UpdateReport History::replay(std::deque<Input>::iterator place, const Input& input) {
  ++replays_;
  place = inputs_.insert(place, input);
  const auto inserted = place - inputs_.begin();
  while (checkpoints_.back().last && before(input, *checkpoints_.back().last)) {
    checkpoints_.pop_back();
  }
  core_ = checkpoints_.back().core;
  const auto& last = checkpoints_.back().last;
  auto next =
      last ? std::upper_bound(inputs_.begin(), inputs_.end(), *last, before) : inputs_.begin();
  UpdateReport report;
  for (; next != inputs_.end(); ++next) {
    const UpdateReport of_this = apply(*next);
    if (next - inputs_.begin() == inserted) report = of_this;
  }
  return report;
}

void History::forget() {
  const Timestamp horizon = core_.time() - window_;
  // The oldest checkpoint must lie before everything that may still come.
  while (checkpoints_.size() > 1 && stampOf(*checkpoints_[1].last) < horizon) {
    checkpoints_.pop_front();
  }
  const auto& oldest = checkpoints_.front().last;
  if (!oldest) return;
  while (!inputs_.empty() && !before(*oldest, inputs_.front())) inputs_.pop_front();
}

}  // namespace vestibule::ekf
