#include "vestibule/pipeline/time_ordered_queue.hpp"

#include <algorithm>
#include <utility>

namespace vestibule::pipeline {
namespace {

constexpr Duration kLateness = std::chrono::milliseconds(500);

int rankOf(const Measurement& measurement) {
  if (std::holds_alternative<Imu>(measurement)) return 0;
  if (std::holds_alternative<Heading>(measurement)) return 1;
  if (std::holds_alternative<WheelOdometry>(measurement)) return 2;
  if (std::holds_alternative<GnssFix>(measurement)) return 3;
  return 4;
}

}  // namespace

void TimeOrderedQueue::push(Measurement measurement) {
  const Timestamp stamp = stampOf(measurement);
  const int rank = rankOf(measurement);
  newest_ = newest_ ? std::max(*newest_, stamp) : stamp;
  waiting_.insert({stamp, rank, count_++, std::move(measurement)});
}

std::optional<Measurement> TimeOrderedQueue::pop() {
  if (waiting_.empty()) return std::nullopt;
  const auto oldest = waiting_.begin();
  if (!finished_ && oldest->stamp + lateness_ > *newest_) return std::nullopt;
  Measurement measurement = std::move(waiting_.extract(oldest).value().measurement);
  return measurement;
}

void forEachInStampOrder(
    io::RecordingReader& reader,
    const std::function<void(const Measurement&)>& process,
    const Progress& progress) {
  TimeOrderedQueue queue(kLateness);
  const auto work = [&] {
    while (const auto measurement = queue.pop()) process(*measurement);
  };
  std::optional<Timestamp> first;
  while (auto record = reader.next()) {
    const Timestamp stamp = stampOf(record->measurement);
    if (!first) first = stamp;
    queue.push(std::move(record->measurement));
    work();
    progress(reader.progress(), toSeconds(stamp - *first));
  }
  queue.finish();
  work();
}

}  // namespace vestibule::pipeline
