#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "vestibule/core/frames.hpp"

namespace vestibule::geo {

/// The same place in the tangent plane and in a map of its own.
struct GeoPair {
  Eigen::Vector2d p_enu;
  Point2 p_grid;
  double sigma_m = 1.0;  ///< per axis, of p_enu
};

struct GeoreferenceFit {
  PoseWithCovariance T_map_grid;  ///< map: the tangent plane
  double rms_m = 0.0;             ///< of the pairs that count, unweighted
  std::size_t used = 0;           ///< pairs with at least half weight
};

/// Rigid fit of a map to GNSS positions, robust against single bad ones (Geman-McClure weights by
/// iteration). Empty with fewer than three pairs, or when the map's positions span less than
/// `min_span_m`: then there is no heading.
/// \param pairs_per_error errors of so many neighbouring pairs are one and the same; the covariance
///                        grows by it
[[nodiscard]] std::optional<GeoreferenceFit> fitGeoreference(
    const std::vector<GeoPair>& pairs, double pairs_per_error, double min_span_m = 5.0);

}  // namespace vestibule::geo
