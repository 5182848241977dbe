#include "vestibule/pipeline/gnss_input.hpp"

#include <cassert>

namespace vestibule::pipeline {

Eigen::Vector3d antennaInMap(const GnssFix& fix, const std::optional<geo::TangentPlane>& plane) {
  if (const auto* geodetic = std::get_if<Geodetic>(&fix.position)) {
    assert(plane);
    return plane->toEnu(*geodetic);
  }
  const auto& local = std::get<LocalPosition>(fix.position);
  return {local.east_m, local.north_m, local.up_m};
}

ekf::MapFix inMap(const GnssFix& fix, const Eigen::Vector3d& p_map_antenna) {
  return {fix.stamp, p_map_antenna, fix.cov_enu, fix.type, fix.hdop, fix.satellites, fix.velocity};
}

bool wasUsed(const ekf::UpdateReport& report) {
  return report.decision == Decision::kAccepted || report.decision == Decision::kDownWeighted;
}

}  // namespace vestibule::pipeline
