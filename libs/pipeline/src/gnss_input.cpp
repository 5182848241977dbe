#include "vestibule/pipeline/gnss_input.hpp"

#include <cassert>

namespace vestibule::pipeline {

Eigen::Vector2d antennaInMap(const GnssFix& fix, const std::optional<geo::TangentPlane>& plane) {
  if (const auto* geodetic = std::get_if<Geodetic>(&fix.position)) {
    assert(plane);
    return plane->toEnu(*geodetic).head<2>();
  }
  const auto& local = std::get<LocalPosition>(fix.position);
  return {local.east_m, local.north_m};
}

ekf::UpdateReport offerFix(
    ekf::PlanarFilter& filter, const GnssFix& fix, const Eigen::Vector2d& p_map_antenna) {
  std::optional<Eigen::Matrix2d> cov;
  if (fix.cov_enu) cov = fix.cov_enu->topLeftCorner<2, 2>();
  return filter.processGnss(fix.stamp, p_map_antenna, cov, fix.type, fix.hdop, fix.satellites);
}

bool wasUsed(const ekf::UpdateReport& report) {
  return report.decision == Decision::kAccepted || report.decision == Decision::kDownWeighted;
}

}  // namespace vestibule::pipeline
