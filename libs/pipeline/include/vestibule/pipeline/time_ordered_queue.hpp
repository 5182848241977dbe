#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <set>
#include <tuple>

#include "vestibule/io/recording.hpp"
#include "vestibule/pipeline/progress.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::pipeline {

/// Brings measurements into stamp order. A measurement is released once one that is `lateness`
/// newer has come: sources that are written a little out of order meet in the right order. At equal
/// stamps inertial data come first (they carry the filter to the stamp), then wheels, fixes, scans.
/// What comes later than the bound is released at once, and is the receiver's to refuse.
class TimeOrderedQueue {
 public:
  explicit TimeOrderedQueue(Duration lateness) : lateness_(lateness) {}

  void push(Measurement measurement);
  /// The next measurement that may go, oldest first; empty when all must still wait.
  [[nodiscard]] std::optional<Measurement> pop();
  /// Everything may go: the recording has ended.
  void finish() { finished_ = true; }

 private:
  struct Entry {
    Timestamp stamp;
    int rank;
    std::size_t number;
    Measurement measurement;
    friend bool operator<(const Entry& a, const Entry& b) {
      return std::tie(a.stamp, a.rank, a.number) < std::tie(b.stamp, b.rank, b.number);
    }
  };

  Duration lateness_;
  std::multiset<Entry> waiting_;
  std::optional<Timestamp> newest_;
  std::size_t count_ = 0;
  bool finished_ = false;
};

/// Reads a recording to its end and hands out its measurements in stamp order. Sources of one
/// recorder are taken to be written up to 0.5 s out of order.
void forEachInStampOrder(
    io::RecordingReader& reader,
    const std::function<void(const Measurement&)>& process,
    const Progress& progress);

}  // namespace vestibule::pipeline
