#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/pipeline/place_bench.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::pipeline {

constexpr double kWandererRadius_m = 0.35;
constexpr double kWandererTick_s = 0.1;

/// Where a robot can go, by the map and in truth: one connected part.
class Ground {
 public:
  /// Throws InputError where a robot fits nowhere. \param place must outlive this
  explicit Ground(const LostPlace& place);

  /// A random open place, facing anywhere.
  [[nodiscard]] Pose2 draw(RandomStream& rng) const;
  [[nodiscard]] std::size_t drawCell(RandomStream& rng) const;
  /// Steps to the goal from every cell; -1 where it cannot be reached.
  [[nodiscard]] std::vector<int> stepsTo(std::size_t goal) const;
  /// A point some way down the steps from the cell nearest to p; empty at the goal.
  [[nodiscard]] std::optional<Point2> ahead(const std::vector<int>& steps, const Point2& p) const;
  /// A point a little on the way to another near one, around what stands between; empty when that
  /// is blocked or reached.
  [[nodiscard]] std::optional<Point2> towards(const Point2& from, const Point2& to) const;

 private:
  /// Whether all cells on the line between two are open, but for the first.
  [[nodiscard]] bool straight(std::size_t from, std::size_t to) const;
  [[nodiscard]] std::size_t width() const { return static_cast<std::size_t>(map_.width()); }
  [[nodiscard]] std::size_t cellCount() const {
    return width() * static_cast<std::size_t>(map_.height());
  }
  [[nodiscard]] Point2 centreOf(std::size_t i) const;
  template <class Visit>
  void forNeighbours(std::size_t i, const Visit& visit) const;
  [[nodiscard]] std::size_t nearestOpen(const Point2& p_map) const;

  const grid::OccupancyMap& map_;
  std::vector<char> open_;
  std::vector<std::size_t> cells_;  // the open ones
};

/// A robot that goes where it is told, or else from one random place to the next, and never touches
/// anything. Its lidar sees 270 degrees, 10 to 12 m far, with 10 to 15 % outliers and noise of 2
/// cm; its odometry is some per cent wrong.
class Wanderer {
 public:
  /// \param place, ground must outlive this
  Wanderer(
      const LostPlace& place,
      const Ground& ground,
      const Pose2& T_map_base,
      const RandomStream& rng);

  [[nodiscard]] const Pose2& truth() const { return truth_; }
  [[nodiscard]] double driven() const { return driven_m_; }
  [[nodiscard]] Timestamp time() const { return time_; }
  /// Carried elsewhere without noticing.
  void carryTo(const Pose2& T_map_base);

  /// Whether the last tick's goal could not be come nearer to.
  [[nodiscard]] bool blocked() const { return blocked_; }

  /// One tick of driving and what the wheels say of it.
  /// \param goal_base near; empty = wander
  WheelOdometry drive(const std::optional<Point2>& goal_base = {});

  [[nodiscard]] LaserScan scan();

 private:
  Pose2 stepTowards(const Point2& goal_base);
  Pose2 nextStep();
  [[nodiscard]] Pose2 stepTo(const Point2& target) const;

  const LostPlace& place_;
  const Ground& ground_;
  Pose2 truth_;
  RandomStream rng_;
  double range_max_m_ = 10.0;
  double outliers_ = 0.1;
  double scale_ = 1.0;
  double yaw_scale_ = 1.0;
  double yaw_drift_per_m_ = 0.0;
  double driven_m_ = 0.0;
  std::vector<int> steps_;  // to the present goal
  bool blocked_ = false;
  Timestamp time_;
};

}  // namespace vestibule::pipeline
