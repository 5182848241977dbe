#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>

namespace vestibule::ekf {

/// Noise of a resting gyro out of how the means of short blocks of its readings change from one to
/// the next, in which a constant bias is not (von Neumann's mean square successive difference,
/// 1941). Single readings would not do: sensors filter, so successive ones err alike.
class RestNoise {
 public:
  /// \param axes that are measured: the others are zero
  explicit RestNoise(int axes) : axes_(axes) {}

  /// The next reading of this stop, `dt_s` after the one before. Returns the angle random walk
  /// [rad/sqrt(s)]: `driving` at first and at most, else `least` at least.
  double note(const Eigen::Vector3d& rate_radps, double dt_s, double driving, double least) {
    turn_rad_ += rate_radps * dt_s;
    block_s_ += dt_s;
    if (block_s_ >= kBlock_s) {
      const Eigen::Vector3d mean = turn_rad_ / block_s_;
      if (mean_) {
        // Two means differ by twice the variance of one.
        sum_ += (mean - *mean_).squaredNorm() * block_s_ / (2.0 * axes_);
        ++blocks_;
      }
      mean_ = mean;
      turn_rad_.setZero();
      block_s_ = 0.0;
    }
    // What is known of the gyro while driving counts as much as one block.
    const double variance = (driving * driving + sum_) / (1.0 + blocks_);
    return std::min(driving, std::max(least, std::sqrt(variance)));
  }
  void restart() { *this = RestNoise(axes_); }

 private:
  static constexpr double kBlock_s = 0.2;

  int axes_;
  Eigen::Vector3d turn_rad_ = Eigen::Vector3d::Zero();
  double block_s_ = 0.0;
  std::optional<Eigen::Vector3d> mean_;
  double sum_ = 0.0;  ///< of the squares of angle random walks [rad^2/s]
  int blocks_ = 0;
};

}  // namespace vestibule::ekf
