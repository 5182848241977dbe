#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "vestibule/core/params.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::sim {

/// Errors of three like axes, in the unit of the axis (rad/s or m/s^2), as IEEE Std 952 names them.
struct InertialNoise {
  double noise = 0.0;            ///< [unit/sqrt(Hz)] white: N
  double bias_sigma = 0.0;       ///< at switch-on, constant
  double instability = 0.0;      ///< sigma of a Gauss-Markov bias
  double instability_s = 100.0;  ///< its correlation time
  double walk = 0.0;             ///< [unit/sqrt(s)] random walk of the bias: K
  double scale_sigma = 0.0;      ///< of the scale factor, constant
  double limit = 1e9;            ///< saturation
  double vibration = 0.0;        ///< amplitude at 1 m/s, growing with speed
  double drift = 0.0;            ///< [unit/s] of the bias: warming up
};

struct ImuParams {
  double rate_hz = 100.0;  ///< must divide 200 Hz
  Eigen::Vector3d p_base_imu{0.0, 0.0, 0.3};
  double vibration_hz = 23.0;
  InertialNoise gyro{1.0e-4, 1.0e-3, 3.0e-5, 300.0, 2.0e-6, 0.002, 8.0, 0.0, 0.0};
  InertialNoise accel{2.0e-3, 0.02, 5.0e-4, 300.0, 2.0e-5, 0.003, 40.0, 0.05, 0.0};
};
void describe(ParamIo& io, ImuParams& params);

/// measured = (1 + scale) * truth + bias + noise, saturated.
class ImuModel {
 public:
  ImuModel(const ImuParams& params, std::uint64_t seed);
  /// Call at the IMU's rate. \param omega_radps, force_mps2 mean true body rate and specific force
  /// at the IMU since the last call, base axes  \param speed_mps of the robot, for vibration
  [[nodiscard]] Imu measure(
      Timestamp stamp,
      const Eigen::Vector3d& omega_radps,
      const Eigen::Vector3d& force_mps2,
      double speed_mps);
  [[nodiscard]] const Eigen::Vector3d& gyroBias() const { return gyro_.bias; }  ///< truth
  void stepGyroBias(double about_z_radps) { gyro_.constant.z() += about_z_radps; }

 private:
  struct Triad {
    Eigen::Vector3d constant = Eigen::Vector3d::Zero();
    Eigen::Vector3d markov = Eigen::Vector3d::Zero();
    Eigen::Vector3d walk = Eigen::Vector3d::Zero();
    Eigen::Vector3d scale = Eigen::Vector3d::Zero();
    Eigen::Vector3d bias = Eigen::Vector3d::Zero();
  };
  Eigen::Vector3d corrupt(
      Triad& triad,
      const InertialNoise& noise,
      const Eigen::Vector3d& truth,
      double speed_mps,
      const char* stream);

  ImuParams params_;
  std::uint64_t seed_;
  std::uint64_t index_ = 0;
  Triad gyro_;
  Triad accel_;
};

}  // namespace vestibule::sim
