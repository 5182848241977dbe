#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/sensors/measurements.hpp"
#include "vestibule/sim/world.hpp"
#include "vestibule/sim/world_geometry.hpp"

namespace vestibule::sim {

/// Rates must divide 200 Hz, the rate of the truth.

struct LidarParams {
  double rate_hz = 10.0;
  int beams = 361;
  double field_of_view_rad = 1.5 * 3.14159265358979323846;
  double range_min_m = 0.1;
  double range_max_m = 30.0;
  double sigma_m = 0.02;
  double drop_out = 0.005;  ///< share of beams without an echo
  double outliers = 0.005;  ///< share of beams that end somewhere before the wall
};
void describe(ParamIo& io, LidarParams& params);

struct ImuParams {
  double rate_hz = 100.0;
  double gyro_noise = 1.0e-4;       ///< [rad/s/sqrt(Hz)] white
  double gyro_bias_sigma = 1.0e-3;  ///< [rad/s] at switch-on
  double gyro_bias_walk = 2.0e-5;   ///< [rad/s/sqrt(s)]
  double accel_noise = 2.0e-3;      ///< [m/s^2/sqrt(Hz)] white
  double accel_bias_sigma = 0.02;   ///< [m/s^2] at switch-on
  double accel_bias_walk = 2.0e-4;  ///< [m/s^2/sqrt(s)]
};
void describe(ParamIo& io, ImuParams& params);

struct WheelParams {
  double rate_hz = 50.0;
  double ticks_per_m = 4000.0;  ///< encoder resolution at the rim
};
void describe(ParamIo& io, WheelParams& params);

enum class GnssClass {
  kRtk,    ///< fixed in the open, float and single near walls
  kSingle  ///< single point everywhere
};

/// Errors are per horizontal axis, one sigma; up is 1.5 times that.
struct GnssParams {
  GnssClass receiver = GnssClass::kRtk;
  double rate_hz = 5.0;
  double correlation_s = 60.0;   ///< of the slow error
  double fixed_sigma_m = 0.014;  ///< slow; the white part is as large
  double float_sigma_m = 0.25;   ///< slow; the white part is 0.1 m
  double single_sigma_m = 1.2;   ///< slow
  double single_white_m = 0.5;
  double multipath_m = 3.0;         ///< bias right beside a wall; a fixed function of place
  double multipath_length_m = 5.0;  ///< over which that bias changes
  double shadow_m = 4.0;            ///< e-folding distance of the influence of a building
  double garbage_share = 0.03;      ///< of the time under a roof with a wild fix
  double min_first_fix_s = 1.0;     ///< after leaving a roof
  double max_first_fix_s = 5.0;
};
void describe(ParamIo& io, GnssParams& params);

/// Smooth random function of place, zero mean and unit variance everywhere: independent normals on
/// a lattice, blended. Component 0, 1, 2 are independent.
[[nodiscard]] double placeNoise(
    std::uint64_t seed, int component, const Point2& p_map, double length_m);

/// One sweep, all beams at the same instant.
[[nodiscard]] LaserScan simulateScan(
    const WorldGeometry& geometry,
    const LidarParams& params,
    const Pose2& T_map_base,
    const Pose2& T_base_laser,
    Timestamp stamp,
    std::uint64_t seed,
    std::uint64_t index);

class ImuModel {
 public:
  ImuModel(const ImuParams& params, std::uint64_t seed);
  /// \param omega_radps mean true yaw rate since the last call
  /// \param accel_mps2  true acceleration of the base in base axes
  [[nodiscard]] Imu measure(Timestamp stamp, double omega_radps, const Eigen::Vector2d& accel_mps2);
  [[nodiscard]] double gyroBiasZ() const { return gyro_bias_.z(); }  ///< truth, for checks

 private:
  ImuParams params_;
  std::uint64_t seed_;
  std::uint64_t index_ = 0;
  Eigen::Vector3d gyro_bias_;
  Eigen::Vector3d accel_bias_;
};

/// Encoders and the odometry computed from them.
class WheelModel {
 public:
  WheelModel(const WheelParams& params, double nominal_track_m);
  [[nodiscard]] WheelOdometry measure(Timestamp stamp, double left_travel_m, double right_travel_m);

 private:
  WheelParams params_;
  double nominal_track_m_;
  std::int64_t left_ticks_ = 0;
  std::int64_t right_ticks_ = 0;
};

/// A receiver whose sky is hidden by roofs and spoiled beside them. Under a roof it reports "no
/// fix" (holding its last position), now and then a wild single fix; after the roof it needs a
/// while; what it says about its own accuracy is right in the open and too good beside a wall.
class GnssModel {
 public:
  GnssModel(const World& world, const GnssParams& params, std::uint64_t seed);
  [[nodiscard]] GnssFix measure(Timestamp stamp, const Point2& p_map_antenna);

 private:
  [[nodiscard]] GnssFixType typeNow(Timestamp stamp, double distance_to_roof_m);
  void advanceSlowError();

  std::vector<geo::Polygon> roofs_;
  GnssParams params_;
  std::uint64_t seed_;
  std::uint64_t index_ = 0;
  geo::TangentPlane plane_;
  Eigen::Vector3d slow_;  // unit variance
  bool had_sky_ = true;
  std::uint64_t roof_exits_ = 0;
  Timestamp first_fix_{};                    // no fix before this
  std::optional<Timestamp> good_sky_since_;  // without interruption
  Geodetic last_position_;
};

}  // namespace vestibule::sim
