#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "vestibule/ekf/params.hpp"

namespace vestibule::ekf {

/// Finds the yaw of the odometry frame in the map from GNSS velocities: a bank of small Kalman
/// filters (yaw, wheel scale), each started from another yaw and weighted by how likely it found
/// what came. Needs no track, only a few velocities of a robot that drives.
class HeadingBank {
 public:
  /// \param params outlives it and its copies
  explicit HeadingBank(const FilterParams& params);

  struct Result {
    double yaw_map_odom_rad = 0.0;
    double sigma_rad = 0.0;
  };

  /// \param v_odom_antenna  by wheels and gyro
  /// \param sigma_mps       per axis, of the difference of both
  void add(
      const Eigen::Vector2d& v_map_antenna,
      const Eigen::Vector2d& v_odom_antenna,
      double sigma_mps);
  /// Empty until the hypotheses agree and what came was as likely as it should be.
  [[nodiscard]] std::optional<Result> solve() const;
  /// Velocities taken in.
  [[nodiscard]] int size() const { return count_; }

 private:
  struct Hypothesis {
    double yaw_rad = 0.0;
    double log_scale = 0.0;
    Eigen::Matrix2d P = Eigen::Matrix2d::Identity();
    double log_weight = 0.0;
    double nis_sum = 0.0;
  };

  const FilterParams* params_;
  std::vector<Hypothesis> bank_;
  int count_ = 0;
};

}  // namespace vestibule::ekf
