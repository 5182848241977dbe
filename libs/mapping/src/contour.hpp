#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::mapping {

/// One echo of a scan, in the base frame, with the direction of the surface around it. A drive
/// keeps thousands of contours: micrometres, and some hundredths of a milliradian, are enough.
class ContourPoint {
 public:
  float x = 0.0F;
  float y = 0.0F;
  float range_m = 0.0F;  ///< from the laser; 0 = no echo

  /// False: corner, pole, clutter.
  [[nodiscard]] bool onLine() const { return nx_ != 0 || ny_ != 0; }
  /// Unit normal towards the laser, where onLine().
  [[nodiscard]] double nx() const { return nx_ / kUnit; }
  [[nodiscard]] double ny() const { return ny_ / kUnit; }
  void setNormal(double nx, double ny) {
    nx_ = static_cast<std::int16_t>(std::lround(kUnit * nx));
    ny_ = static_cast<std::int16_t>(std::lround(kUnit * ny));
  }

 private:
  static constexpr double kUnit = 32767.0;
  std::int16_t nx_ = 0;
  std::int16_t ny_ = 0;
};

/// False for the two sides of a thin wall, which are two surfaces.
/// \param cos_q_p, sin_q_p  of the turn from the frame of q to that of p
[[nodiscard]] bool sameSide(
    const ContourPoint& p, const ContourPoint& q, double cos_q_p, double sin_q_p);

/// A scan as what its laser saw in each direction: an ordered contour, so that a point's neighbours
/// and what lies before and behind the contour are found by direction, without a search structure.
class Contour {
 public:
  /// \param max_range_m echoes beyond it are dropped
  Contour(const LaserScan& scan, double max_range_m);

  /// Calls visit(point) for echoes spread along the contour, to match with other contours.
  template <class Visit>
  void forSamples(const Visit& visit) const {
    for (const std::uint16_t k : samples_) visit(beams_[k]);
  }
  [[nodiscard]] std::size_t sampleCount() const { return samples_.size(); }
  /// What the laser saw around the direction of a point of the base frame.
  struct Look {
    const ContourPoint* nearest = nullptr;  ///< echo nearest to the point, within the gate
    bool seen_through = false;  ///< all beams around its direction ended well behind the point
  };
  [[nodiscard]] Look look(const Point2& p_base, double gate_m) const;
  /// Most echoes are nearer than this to the laser.
  [[nodiscard]] double reach() const { return reach_m_; }

 private:
  void findLines();
  void sample();
  [[nodiscard]] int wrapped(int k) const;
  /// All beams around number k0 ended well behind a point at that range.
  [[nodiscard]] bool sawBehind(int k0, double range) const;

  Pose2 T_base_laser_;
  double middle_cos_ = 1.0;  // of the middle of the beams' directions, in the base frame
  double middle_sin_ = 0.0;
  double step_rad_ = 1.0;
  bool full_circle_ = false;
  double reach_m_ = 0.0;
  std::vector<ContourPoint> beams_;
  std::vector<std::uint16_t> samples_;  // numbers of beams
};

/// How the points of two scans lie on each other.
struct Overlap {
  int points = 0;       ///< of both scans
  int matched = 0;      ///< near an echo of the other
  int conflicting = 0;  ///< where the other saw through
  /// Of the points about which the other scan says something, how many it confirms.
  [[nodiscard]] double agreement() const {
    return matched + conflicting > 0 ? static_cast<double>(matched) / (matched + conflicting) : 0.0;
  }
  [[nodiscard]] double matchedShare() const {
    return points > 0 ? static_cast<double>(matched) / points : 0.0;
  }
  Overlap& operator+=(const Overlap& o) {
    points += o.points;
    matched += o.matched;
    conflicting += o.conflicting;
    return *this;
  }
};
[[nodiscard]] Overlap overlap(
    const Contour& a, const Contour& b, const Pose2& T_a_b, double gate_m);

struct AlignmentParams {
  double sigma_m = 0.03;           ///< [m] of an end point about the other scan's surface
  double gate_m = 0.3;             ///< [m] points farther apart do not belong together
  double effective_points = 30.0;  ///< neighbouring points say the same: counted as so many
};

/// Half the weighted sum of squared distances between the surfaces of two scans, as a quadratic
/// in the change of T_a_b = (x, y, yaw): cost + g' d + d' H d / 2.
struct Quadratic {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  double weighted_squares = 0.0;  ///< [m^2] sum over the pairs of points
  double weight = 0.0;            ///< of the pairs, each at most 1
  int pairs = 0;
};
[[nodiscard]] Quadratic pointToLine(
    const Contour& a, const Contour& b, const Pose2& T_a_b, const AlignmentParams& params);

}  // namespace vestibule::mapping
