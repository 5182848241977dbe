#include "mrpt_scan.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "mrpt_time.hpp"
#include "vestibule/core/angles.hpp"

namespace vestibule::io {

using mrpt::obs::CObservation2DRangeScan;

namespace {

constexpr double kMaxTilt_rad = 10.0 * kRadPerDeg;
// MRPT has one kind of invalid beam and does not look at its range. An infinite one says "no echo",
// anything else that the beam failed.
constexpr float kNoEcho = std::numeric_limits<float>::infinity();
constexpr float kFailed = std::numeric_limits<float>::quiet_NaN();

}  // namespace

CObservation2DRangeScan toMrpt(const LaserScan& scan) {
  CObservation2DRangeScan obs;
  const std::size_t n = scan.ranges_m.size();
  obs.resizeScanAndAssign(n, 0.0F, false);
  for (std::size_t i = 0; i < n; ++i) {
    const bool valid = scan.valid(i);
    obs.setScanRangeValidity(i, valid);
    const bool no_echo = static_cast<double>(scan.ranges_m[i]) >= scan.range_max_m;
    obs.setScanRange(i, valid ? scan.ranges_m[i] : (no_echo ? kNoEcho : 0.0F));
  }
  const double span = n < 2 ? 0.0 : static_cast<double>(n - 1) * scan.angle_step_rad;
  obs.aperture = static_cast<float>(std::abs(span));
  obs.rightToLeft = scan.angle_step_rad >= 0.0;
  obs.maxRange = static_cast<float>(scan.range_max_m);
  // MRPT's beams lie symmetric about the sensor's x axis: what is left over goes into its yaw.
  const double centre = scan.angle_min_rad + span / 2.0;
  obs.sensorPose = mrpt::poses::CPose3D(
      scan.T_base_laser.x, scan.T_base_laser.y, 0.0, wrapToPi(scan.T_base_laser.phi + centre));
  return obs;
}

std::optional<LaserScan> fromMrpt(const CObservation2DRangeScan& obs) {
  const auto R = obs.sensorPose.getRotationMatrix();
  const bool upside_down = R(2, 2) < 0.0;
  if (std::abs(R(2, 2)) < std::cos(kMaxTilt_rad)) return std::nullopt;
  LaserScan scan;
  scan.stamp = fromMrpt(obs.timestamp);
  const std::size_t n = obs.getScanSize();
  const double aperture = static_cast<double>(obs.aperture);
  scan.angle_min_rad = -aperture / 2.0;
  scan.angle_step_rad = n < 2 ? aperture : aperture / static_cast<double>(n - 1);
  scan.range_max_m = static_cast<double>(obs.maxRange);
  scan.ranges_m.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const float range_m = obs.getScanRange(i);
    const bool told = obs.getScanRangeValidity(i) || range_m == kNoEcho;
    scan.ranges_m[i] = told ? range_m : kFailed;
  }
  // Counter-clockwise seen from above: a clockwise device or one hanging head down is turned
  // round, one that is both is not.
  if (obs.rightToLeft == upside_down) std::reverse(scan.ranges_m.begin(), scan.ranges_m.end());
  scan.T_base_laser = {obs.sensorPose.x(), obs.sensorPose.y(), std::atan2(R(1, 0), R(0, 0))};
  return scan;
}

}  // namespace vestibule::io
