#include "vestibule/amcl/recovery_ladder.hpp"

#include <cmath>

namespace vestibule::amcl {

RecoveryLadder::RecoveryLadder(
    const AmclParams& params,
    ParticleLocalizer& localizer,
    const std::optional<Pose2>& T_map_base_start,
    const Observers* observers)
    : params_(params.recovery),
      localizer_(localizer),
      observers_(observers),
      T_map_base_(T_map_base_start) {}

void RecoveryLadder::process(const WheelOdometry& odometry) {
  if (T_map_base_) T_map_base_ = compose(*T_map_base_, odometry.T_previous_now);
}

void RecoveryLadder::process(const LaserScan& scan, const ScanReport& report) {
  if (!report.used) return;
  if (report.trusted) {
    T_map_base_ = localizer_.pose().mean;
    misfits_ = 0;
    stage_ = 0;
    return;
  }
  if (++misfits_ < params_.after_scans) return;
  misfits_ = 0;
  ++stage_;
  ++tries_;

  const double factor = std::pow(params_.growth, stage_ - 1);
  const double sigma_m = params_.sigma_m * factor;
  const bool global = !T_map_base_ || sigma_m > params_.max_sigma_m;
  if (global) {
    localizer_.initialiseGlobally();
  } else {
    const double sigma_rad = params_.sigma_rad * factor;
    const Eigen::Matrix3d cov =
        Eigen::Vector3d(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad).asDiagonal();
    localizer_.initialise({*T_map_base_, cov});
  }
  if (observers_ != nullptr) {
    WarningEvent event;
    event.stamp = scan.stamp;
    event.component = "amcl";
    event.text = global ? "the scans do not fit the map: searching all of it"
                        : "the scans do not fit the map: searching around";
    event.value = report.trust;
    observers_->emit(event);
  }
}

}  // namespace vestibule::amcl
