#pragma once

#include <deque>

#include "core.hpp"

namespace vestibule::ekf {

/// A core that can go back: keeps the inputs of a time window and copies of the core in it. A late
/// input is put in its place and everything after it is applied again.
class History {
 public:
  History(const Core& start, Duration window) : window_(window), core_(start) {
    checkpoints_.push_back({std::nullopt, start});
  }

  [[nodiscard]] const Core& core() const { return core_; }
  [[nodiscard]] Core& core() { return core_; }

  /// \return what became of the input; rejected as "stale" when it is older than the window, as
  /// "duplicate" when it is known
  UpdateReport insert(const Input& input);
  /// From now on what is not newer than everything before is refused as "stale", and nothing is
  /// kept to go back to.
  void keepOrder(bool only_in_order);
  [[nodiscard]] std::size_t replays() const { return replays_; }

 private:
  struct Checkpoint {
    std::optional<Input> last;  ///< the input applied last; empty: before the first
    Core core;
  };
  UpdateReport apply(const Input& input);
  UpdateReport replay(std::deque<Input>::iterator place, const Input& input);
  void forget();

  Duration window_;
  Core core_;
  std::deque<Input> inputs_;            ///< in order; those after the oldest checkpoint
  std::deque<Checkpoint> checkpoints_;  ///< at least one
  std::size_t replays_ = 0;
  bool only_in_order_ = false;
};

}  // namespace vestibule::ekf
