#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vestibule/io/recording.hpp"
#include "vestibule/metrics/trajectory.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/progress.hpp"

namespace vestibule::tuning {

/// One calibrated quantity.
struct Quantity {
  std::string name;
  std::string unit;
  double before = 0.0;
  double value = 0.0;
  double sigma = 0.0;
  /// Empty when the data observe it; else what drive would.
  std::string unobserved;
};

/// What a fit left, stretch by stretch: (time [s], size).
struct Residuals {
  std::string of;  ///< "antenna", ...
  std::string unit;
  std::vector<std::pair<double, double>> before;
  std::vector<std::pair<double, double>> after;
  /// Root mean squares.
  [[nodiscard]] double rmsBefore() const;
  [[nodiscard]] double rmsAfter() const;
};

struct Calibration {
  std::vector<Quantity> quantities;
  std::vector<Residuals> residuals;
  std::vector<std::string> notes;

  [[nodiscard]] const Quantity* find(const std::string& name) const;
};

/// Differential or skid-steer wheels by the centres of rotation of their treads (Mandow 2007):
/// v_x - w y_l = a_l V_l, v_x - w y_r = a_r V_r, v_y = -w x_v. The wheel travels V are recovered
/// from the recorded increments with the track the recorder believed in.
struct WheelGeometry {
  double scale_left = 1.0;   ///< a_l: true tread travel / wheel travel
  double scale_right = 1.0;  ///< a_r
  double icr_left_m = 0.0;   ///< y_l > 0
  double icr_right_m = 0.0;  ///< y_r < 0
  double icr_x_m = 0.0;      ///< x_v
};

/// Errors of a 4 m square driven both ways with the uncorrected odometry (Borenstein and Feng
/// 1996).
struct UmbMark {
  Point2 gravity_cw;  ///< [m] true end minus odometry's, clockwise
  Point2 gravity_ccw;
  double alpha_rad = 0.0;
  double beta_rad = 0.0;
  double wheel_ratio = 1.0;  ///< E_d: diameter right / left
  double track_ratio = 1.0;  ///< E_b: effective / believed track
};

struct OdometryCalibration : Calibration {
  WheelGeometry wheels;
  double track_m = 0.0;  ///< believed
  UmbMark umbmark;
  /// Straights and spins alone: scale, and with it the effective track, where there are any.
  std::optional<double> quick_scale;
  std::optional<double> quick_track_m;
  metrics::Trajectory reference;
  metrics::Trajectory before;  ///< odometry, started on the reference
  metrics::Trajectory after;
};

/// What a reference is off by all along, which no scatter shows: claimed of what is learnt by it.
struct ReferenceErrors {
  double turn_scale_sigma = 0.0;  ///< share of all turns, as by a gyro's scale
  double ahead_sigma_m = 0.0;     ///< of all positions, forward, as by an antenna's lever arm
};

/// Fits the wheels to a reference over segments of a few seconds.
/// \param reference  T_map_base; gaps are left out
/// \param has_position  false when the reference knows turns only
[[nodiscard]] OdometryCalibration calibrateOdometry(
    const std::vector<WheelOdometry>& odometry,
    const metrics::Trajectory& reference,
    bool has_position,
    double track_m,
    const ReferenceErrors& errors = {});

/// The wheel messages of a recording, and what there is to compare with: `ref_path` (TUM), else the
/// recording's own reference, else the smoothed GNSS/IMU/wheel path. Before that is made, the
/// antenna's lever arm and the delay of the fixes are calibrated where the drive shows them: either
/// bends the path where the robot turns.
struct OdometryData {
  std::vector<WheelOdometry> odometry;
  metrics::Trajectory reference;
  bool has_position = false;
  ReferenceErrors errors;
  std::string reference_name;
};
[[nodiscard]] OdometryData readOdometry(
    const std::string& log,
    const std::string& ref_path,
    const io::RecordingOptions& options,
    const pipeline::Config& config,
    const pipeline::Progress& progress);

/// Headings as read, and what there is to compare with (as in OdometryData, headings left out).
struct CompassData {
  std::vector<Heading> readings;
  metrics::Trajectory reference;
  std::string reference_name;
};
[[nodiscard]] CompassData readCompass(
    const std::string& log,
    const std::string& ref_path,
    const io::RecordingOptions& options,
    const pipeline::Config& config,
    const pipeline::Progress& progress);

/// Coefficients A to E of a compass's deviation (see CompassDeviation), by the yaw of a reference.
/// \param known  the present ones, for comparison
[[nodiscard]] Calibration calibrateCompass(
    const std::vector<Heading>& readings,
    const metrics::Trajectory& reference,
    const CompassDeviation& known);

/// A misfit over how late the stamps of a sensor are taken to be.
struct OffsetCurve {
  std::string of;                                 ///< name of the quantity
  std::string misfit;                             ///< what it is, with unit
  std::vector<std::pair<double, double>> points;  ///< (late by [s], misfit)
};

struct OffsetsCalibration : Calibration {
  std::vector<OffsetCurve> curves;
};

/// How late the stamps of each sensor are. The gyro is the clock: the wheels by the turns of both,
/// the fixes by wheels and gyro together with the antenna's place, headings by the likelihood of
/// the innovations. What is found of one is taken off before the next is looked at.
/// \param arm_known  the configured lever arm is the true one and not estimated
[[nodiscard]] OffsetsCalibration calibrateOffsets(
    const std::string& log,
    const io::RecordingOptions& options,
    const pipeline::Config& config,
    bool arm_known,
    const pipeline::Progress& progress);

/// Antenna lever arm, yaw of the IMU and pose of the laser, each where the recording observes it.
[[nodiscard]] Calibration calibrateMount(
    const std::string& log,
    const io::RecordingOptions& options,
    const pipeline::Config& config,
    const pipeline::Progress& progress);

}  // namespace vestibule::tuning
