#pragma once

#include <memory>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/nav/command_mux.hpp"
#include "vestibule/nav/driver.hpp"

namespace vestibule::mrpt_adapters {

struct ReactiveParams {
  nav::Footprint footprint;
  double security_margin_m = 0.20;               ///< [m] added to the footprint on every side
  double max_speed_mps = 0.8;                    ///< [m/s]
  double max_yaw_rate_radps = degToRad(45.0);    ///< [rad/s]
  double max_accel_mps2 = 0.6;                   ///< [m/s^2] of the command
  double max_yaw_accel_radps2 = degToRad(85.0);  ///< [rad/s^2] of the command
  double reference_distance_m = 6.0;             ///< [m] how far paths look ahead
  int paths_per_ptg = 61;                        ///< candidate paths of each trajectory family, odd
  double turn_first_rad =
      degToRad(52.0);             ///< [rad] a goal farther off the nose: turn on the spot first
  double blocked_after_s = 15.0;  ///< [s] stuck so long; three times that on a detour
};
void describe(ParamIo& io, ReactiveParams& params);

/// MRPT's trajectory-parameter-space reactive navigator (Blanco, Gonzalez and Fernandez-Madrigal,
/// Autonomous Robots 24, 2008) behind nav::Driver. Data time drives MRPT's global clock; one driver
/// at a time may be stepped in a process. Equal inputs give equal bits, however often a driver was
/// made before. Building one takes about half a second (collision tables).
class ReactiveDriver : public nav::Driver {
 public:
  /// Throws ConfigError on parameters that make no sense together.
  explicit ReactiveDriver(const ReactiveParams& params);
  ~ReactiveDriver() override;

  void setGoals(const std::vector<nav::Waypoint>& goals) override;
  [[nodiscard]] nav::DriverStatus step(
      Timestamp stamp,
      const Pose2& T_map_base,
      double v_mps,
      double omega_radps,
      const std::vector<Point2>& obstacles_base) override;
  void stop() override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vestibule::mrpt_adapters
