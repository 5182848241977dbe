#include "geo_hints.hpp"

#include <cmath>

#include "vestibule/ekf/claims.hpp"
#include "vestibule/pipeline/gnss_input.hpp"

namespace vestibule::pipeline {
namespace {

// A fix this far from the map is not of a robot that is in it: another place, or a wrong datum.
constexpr double kFar_m = 500.0;

/// What reflections and wrong integers may do to a fix beside buildings [m], one sigma, which no
/// receiver claims: code fixes there are off by 30 m at times.
double reflectionSigma(GnssFixType type) {
  switch (type) {
    case GnssFixType::kRtkFixed:
      return 0.5;
    case GnssFixType::kRtkFloat:
      return 3.0;
    default:
      return 10.0;
  }
}

}  // namespace

GeoHints::GeoHints(
    const Config& config,
    const grid::OccupancyMap& map,
    const std::optional<io::MapGeoreference>& georeference,
    const Observers& observers)
    : config_(config), map_(map), observers_(observers), georeference_(georeference) {
  if (georeference_) plane_.emplace(georeference_->datum);
}

void GeoHints::process(
    const GnssFix& fix, const Point2& p_base_antenna, amcl::Localizer& localizer) {
  if (fix.type == GnssFixType::kNone || !config_.ekf.use.gnssPosition()) return;
  ++use_.fixes;
  if (!georeference_) return;
  if (!std::holds_alternative<Geodetic>(fix.position)) {
    ++local_fixes_;
    return;
  }
  const Eigen::Vector3d p_enu = antennaInMap(fix, plane_);
  const double claimed_m = claimedSigma(fix, config_.ekf.gnss);
  if (!p_enu.allFinite() || !(claimed_m <= config_.ekf.gnss.max_sigma_m)) return;
  const Pose2& T_enu_map = georeference_->T_map_grid;
  const Point2 p_map_antenna = transform(inverse(T_enu_map), {p_enu.x(), p_enu.y()});
  if (isFar(fix, p_map_antenna)) return;

  const Eigen::Matrix3d of_map = compose(
                                     PoseWithCovariance{T_enu_map, georeference_->cov},
                                     Pose2{p_map_antenna.x, p_map_antenna.y, 0.0})
                                     .cov;
  const double map_sigma_m = std::sqrt(0.5 * of_map.topLeftCorner<2, 2>().trace());
  const double sigma_m = std::hypot(claimed_m, map_sigma_m);
  if (config_.amcl.gnss.in_search) {
    grid::PosePrior prior;
    prior.T_map_base = {p_map_antenna.x, p_map_antenna.y, 0.0};
    const double prior_sigma_m = std::hypot(sigma_m, reflectionSigma(fix.type));
    prior.information(0, 0) = prior.information(1, 1) = 1.0 / (prior_sigma_m * prior_sigma_m);
    prior.max_d2 = kHintMaxD2;
    const Pose2 T_base_antenna{p_base_antenna.x, p_base_antenna.y, 0.0};
    use_.fixes_in_search +=
        localizer.learn(amcl::PriorKind::kPosition, prior, T_base_antenna) ? 1U : 0U;
  }
  if (config_.amcl.gnss.enabled && !localizer.searching()) {
    localizer.process(baseInMap(p_map_antenna, localizer.pose().mean, p_base_antenna), sigma_m);
    ++use_.fixes_in_weights;
  }
}

void GeoHints::process(const Heading& heading, amcl::Localizer& localizer) {
  if (!georeference_ || !config_.amcl.gnss.in_search || !config_.ekf.use.headingYaw()) return;
  const auto sigma_rad = ekf::absoluteSigma(heading, config_.ekf);
  if (!sigma_rad) {
    ++untrusted_headings_;
    return;
  }
  grid::PosePrior prior;
  prior.T_map_base.phi = angleDiff(heading.yaw_rad, georeference_->T_map_grid.phi);
  prior.information(2, 2) = 1.0 / (*sigma_rad * *sigma_rad + georeference_->cov(2, 2));
  prior.max_d2 = kHintMaxD2;
  use_.headings_in_search += localizer.learn(amcl::PriorKind::kHeading, prior) ? 1U : 0U;
}

bool GeoHints::isFar(const GnssFix& fix, const Point2& p_map_antenna) {
  const double far_m = map_.rectangle().outside(p_map_antenna);
  if (far_m <= kFar_m) return false;
  ++use_.fixes_far;
  if (!far_m_) {
    far_m_ = far_m;
    observers_.emit(
        WarningEvent{fix.stamp, "gnss", "the fixes are far from the map: not used", far_m, kFar_m});
  }
  return true;
}

std::vector<std::string> GeoHints::notes() const {
  std::vector<std::string> notes;
  if (!georeference_ && use_.fixes > 0) {
    notes.push_back(
        "the map has no georeference: " + std::to_string(use_.fixes) +
        " fixes not used; vestibule map --georeference writes one");
  }
  if (far_m_) {
    notes.push_back(
        "the recording's fixes are " + std::to_string(std::llround(*far_m_)) +
        " m from the map: " + std::to_string(use_.fixes_far) + " not used");
  }
  if (local_fixes_ > 0) {
    notes.push_back(
        std::to_string(local_fixes_) +
        " fixes in metres of the recording's own, not in latitude and longitude: not used");
  }
  if (untrusted_headings_ > 0) {
    notes.push_back(
        std::to_string(untrusted_headings_) +
        " headings not used: not calibrated (rig.compass), nor trusted as they are "
        "(ekf.init.trust_heading), or too unsure of themselves");
  }
  return notes;
}

}  // namespace vestibule::pipeline
