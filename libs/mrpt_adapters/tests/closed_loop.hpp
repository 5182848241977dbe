#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/frames.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/nav/command_mux.hpp"

namespace vestibule::mrpt_adapters {

struct Segment {
  Point2 a;
  Point2 b;
};

/// A world of wall segments with a robot in it, for driving tests: first-order wheel lag, slip, and
/// a 270 degree lidar at the front that sees 12 m.
class ClosedLoop {
 public:
  ClosedLoop(std::vector<Segment> walls, const Pose2& start, std::uint64_t seed = 1)
      : walls_(std::move(walls)), T_(start), random_(seed, "closed loop") {
    for (const Segment& s : walls_) {
      const double length = std::hypot(s.b.x - s.a.x, s.b.y - s.a.y);
      const int n = std::max(1, static_cast<int>(length / 0.02));
      for (int i = 0; i <= n; ++i) {
        const double u = static_cast<double>(i) / n;
        wall_points_.push_back({s.a.x + u * (s.b.x - s.a.x), s.a.y + u * (s.b.y - s.a.y)});
      }
    }
  }

  static std::vector<Segment> box(double x0, double y0, double x1, double y1) {
    return {{{x0, y0}, {x1, y0}}, {{x1, y0}, {x1, y1}}, {{x1, y1}, {x0, y1}}, {{x0, y1}, {x0, y0}}};
  }

  [[nodiscard]] const Pose2& pose() const { return T_; }
  [[nodiscard]] double v() const { return v_; }
  [[nodiscard]] double omega() const { return omega_; }
  [[nodiscard]] static Point2 laser() { return {0.35, 0.0}; }

  [[nodiscard]] std::vector<Point2> scan() {
    std::vector<Point2> points;
    const Point2 eye = transform(T_, laser());
    for (int i = 0; i < 361; ++i) {
      const double angle = T_.phi + degToRad(-135.0 + 0.75 * i);
      const double range = cast(eye, angle) + random_.normal(0.0, 0.02);
      if (range > 12.0) continue;
      points.push_back(transform(
          inverse(T_), {eye.x + range * std::cos(angle), eye.y + range * std::sin(angle)}));
    }
    return points;
  }

  void drive(const nav::Command& command, double dt_s) {
    constexpr double kStep_s = 0.005;
    for (double t = 0.0; t < dt_s - 1e-9; t += kStep_s) {
      v_ += (command.v_mps - v_) * kStep_s / 0.15;
      omega_ += (command.omega_radps - omega_) * kStep_s / 0.15;
      // A skid-steer robot turns less than its wheels say, and drifts sideways in curves.
      T_ = compose(
          T_, expSe2({0.98 * v_ * kStep_s, 0.02 * v_ * omega_ * kStep_s, 0.9 * omega_ * kStep_s}));
    }
    clearance_m_ = std::min(clearance_m_, clearance());
  }

  /// From the footprint to the nearest wall, now and the smallest since the start.
  [[nodiscard]] double clearance() const {
    double nearest = std::numeric_limits<double>::infinity();
    const Pose2 T_base_map = inverse(T_);
    for (const Point2& p : wall_points_) {
      if (std::hypot(p.x - T_.x, p.y - T_.y) > 3.0) continue;
      nearest = std::min(nearest, footprint_.signedDistance(transform(T_base_map, p)));
    }
    return nearest;
  }
  [[nodiscard]] double smallestClearance() const { return clearance_m_; }

 private:
  [[nodiscard]] double cast(const Point2& eye, double angle) const {
    const double dx = std::cos(angle);
    const double dy = std::sin(angle);
    double best = 100.0;
    for (const Segment& s : walls_) {
      const double ex = s.b.x - s.a.x;
      const double ey = s.b.y - s.a.y;
      const double det = dx * ey - dy * ex;
      if (std::abs(det) < 1e-12) continue;
      const double ax = s.a.x - eye.x;
      const double ay = s.a.y - eye.y;
      const double range = (ax * ey - ay * ex) / det;
      const double u = (ax * dy - ay * dx) / det;
      if (range > 0.0 && u >= 0.0 && u <= 1.0) best = std::min(best, range);
    }
    return best;
  }

  std::vector<Segment> walls_;
  std::vector<Point2> wall_points_;
  Pose2 T_;
  RandomStream random_;
  nav::Footprint footprint_;
  double v_ = 0.0;
  double omega_ = 0.0;
  double clearance_m_ = std::numeric_limits<double>::infinity();
};

}  // namespace vestibule::mrpt_adapters
