#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "vestibule/core/events.hpp"
#include "vestibule/core/frames.hpp"
#include "vestibule/core/time.hpp"
#include "vestibule/ekf/params.hpp"
#include "vestibule/ekf/state.hpp"
#include "vestibule/sensors/measurements.hpp"
#include "vestibule/sensors/rig.hpp"

namespace vestibule::ekf {

class Tape;

/// What became of a measurement, and the numbers behind it. `nis` is 0 where it was not computed.
struct UpdateReport {
  Decision decision = Decision::kAccepted;
  /// "", "chi2" (far from the estimate), "jump" (far from where the fixes before it lay), "speed"
  /// (no robot is so fast), "stale", "duplicate", "not finite", "impossible", "no fix", "sigma",
  /// "not ready", "not used", "reset" (position moved to a new cluster), "initialised", "relearn",
  /// "noise x2.3" (so much more variance than claimed, learnt from the innovations)
  std::string reason;
  double nis = 0.0;
  double gate = 0.0;
  int dof = 0;
  double log_det = 0.0;  ///< of the innovation's covariance
};

/// Measurements that could not be used at all, by reason ("stale", "not finite", ...).
using Dropped = std::map<std::string, std::size_t>;

/// One fix as the filter takes it: the raw antenna position, the lever arm is removed inside.
struct MapFix {
  Timestamp stamp;
  Eigen::Vector3d p_map_antenna = Eigen::Vector3d::Zero();  ///< [m] antenna phase centre, ENU
  /// As reported [m^2]; empty, zero or not positive = unknown.
  std::optional<Eigen::Matrix3d> cov;
  GnssFixType type = GnssFixType::kUnknown;
  std::optional<double> hdop;
  std::optional<int> satellites;
  std::optional<GnssVelocity> velocity = std::nullopt;
};

/// The GNSS/IMU/wheel filter. It keeps two estimates of the same model:
///
/// - `odometry()`: wheels, gyro and changes of the heading sensor. Starts at the origin with the
///   first message; its position never jumps, its yaw is turned by the heading sensor only as far
///   as the gyro leaves room for it.
/// - `pose()`: where the robot is in the map, with GNSS (and, indoors, poses from map
/// localization).
///   Not ready until position and yaw are known: by reset(), or by aligning the odometry track with
///   the GNSS track.
///
/// Measurements may come late, in any order and twice: within `history_s` of the newest stamp they
/// are put in their place and everything after them is done again. The result is the same to the
/// last bit for every order of arrival.
///
/// In the plane the yaw rate is taken about the vertical as the accelerometer shows it (specific
/// force, +9.81 on the axis that points up), so an IMU mounted on its side or upside down works
/// unannounced. Without a full accelerometer it is the rate about z.
class MapFilter {
 public:
  /// \param observers  may be null; outlives the filter. Each measurement is reported once, when it
  ///                   comes, also when later ones make it be used again.
  MapFilter(const FilterParams& params, const SensorRig& rig, const Observers* observers = nullptr);
  MapFilter(const MapFilter&) = delete;
  MapFilter& operator=(const MapFilter&) = delete;
  ~MapFilter();

  UpdateReport process(const WheelOdometry& wheels);
  UpdateReport process(const Imu& imu);
  UpdateReport process(const Heading& heading);
  /// A velocity with the fix is a measurement of its own and reported as "gnss_velocity".
  /// \return what became of the position
  UpdateReport process(const MapFix& fix);
  UpdateReport processExternalPose(Timestamp stamp, const PoseWithCovariance& T_map_base);
  /// Starts (again) from a known pose. Keeps what was learnt of the sensors.
  UpdateReport reset(Timestamp stamp, const PoseWithCovariance& T_map_base);

  /// Stamp of the newest measurement; never goes back.
  [[nodiscard]] Timestamp time() const;
  [[nodiscard]] bool started() const;

  // --- odometry ----------------------------------------------------------------------------------
  /// T_odom_base at time(), with the covariance grown since the start.
  [[nodiscard]] PoseWithCovariance odometry() const;
  /// The same carried on to `stamp`, as poseAt().
  [[nodiscard]] Pose2 odometryAt(Timestamp stamp) const;
  [[nodiscard]] const State& odometryState() const;
  [[nodiscard]] double yawRate() const;  ///< [rad/s] bias removed
  [[nodiscard]] double speed() const;    ///< [m/s] forward positive
  [[nodiscard]] bool standstill() const;

  // --- map ---------------------------------------------------------------------------------------
  [[nodiscard]] bool ready() const;
  /// What is missing, for people; empty when ready.
  [[nodiscard]] std::string waitingFor() const;
  /// T_map_base at time(). \pre ready()
  [[nodiscard]] PoseWithCovariance pose() const;
  /// \pre ready()
  [[nodiscard]] const State& state() const;
  /// Of the error vector of state(). \pre ready()
  [[nodiscard]] const StateMatrix& covariance() const;
  /// pose() carried on to `stamp` with the present speed and turn rate; the state is unchanged.
  /// \pre ready(), stamp >= time(); beyond half a second the pose at half a second
  [[nodiscard]] Pose2 poseAt(Timestamp stamp) const;
  /// Where the filter would expect a fix, with everything it takes such a fix to err by. The fix's
  /// own position is not looked at; the state is unchanged. \pre ready(), stamp >= time()
  struct Expected {
    Eigen::Vector2d p_map_antenna = Eigen::Vector2d::Zero();
    Eigen::Matrix2d cov = Eigen::Matrix2d::Identity();
  };
  [[nodiscard]] Expected expected(const MapFix& fix) const;
  /// T_map_odom when the filter became ready (odom: the frame of odometry()): places the odometry
  /// poses from before. Empty until ready.
  [[nodiscard]] std::optional<PoseWithCovariance> initialAlignment() const;

  [[nodiscard]] const Dropped& dropped() const;
  /// Measurements that came late and made others be done again.
  [[nodiscard]] std::size_t replays() const;

  /// For a recording in order of its stamps: from now on late measurements are refused, and nothing
  /// is kept to go back to.
  void expectOrder();
  /// Tells the tape of everything done to the map's estimate from now on, until null is given.
  /// Late measurements are refused from then on: a tape cannot be rewound.
  void record(Tape* tape);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vestibule::ekf
