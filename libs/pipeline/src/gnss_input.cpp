#include "vestibule/pipeline/gnss_input.hpp"

#include <cassert>
#include <cmath>

#include "vestibule/ekf/claims.hpp"

namespace vestibule::pipeline {

Eigen::Vector3d antennaInMap(const GnssFix& fix, const std::optional<geo::TangentPlane>& plane) {
  if (const auto* geodetic = std::get_if<Geodetic>(&fix.position)) {
    assert(plane);
    return plane->toEnu(*geodetic);
  }
  const auto& local = std::get<LocalPosition>(fix.position);
  return {local.east_m, local.north_m, local.up_m};
}

double claimedSigma(const GnssFix& fix, const ekf::GnssParams& params) {
  const double variance = fix.cov_enu ? 0.5 * fix.cov_enu->topLeftCorner<2, 2>().trace() : 0.0;
  return variance > 0.0 ? std::sqrt(variance) : ekf::leastSigma(fix.type, params);
}

Point2 baseInMap(
    const Point2& p_map_antenna, const Pose2& T_map_base, const Point2& p_base_antenna) {
  const Point2 p_map_own = transform(T_map_base, p_base_antenna);
  return {
      p_map_antenna.x - (p_map_own.x - T_map_base.x),
      p_map_antenna.y - (p_map_own.y - T_map_base.y)};
}

ekf::MapFix inMap(const GnssFix& fix, const Eigen::Vector3d& p_map_antenna) {
  return {fix.stamp, p_map_antenna, fix.cov_enu, fix.type, fix.hdop, fix.satellites, fix.velocity};
}

bool wasUsed(const ekf::UpdateReport& report) {
  return report.decision == Decision::kAccepted || report.decision == Decision::kDownWeighted;
}

}  // namespace vestibule::pipeline
