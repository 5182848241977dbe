#pragma once

#include <memory>
#include <vector>

#include "vestibule/amcl/global_localizer.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/grid/ray_caster.hpp"

namespace vestibule::amcl {

/// Where a robot that is not sure should drive: to where its candidates would see different things
/// (active localization: Fox, Burgard, Thrun 1998, with the views along one way held against each
/// other instead of all expected entropies). Knows the map and the candidates, nothing else, and
/// looks at what does not move: things up to GlobalParams::small_m tell nothing apart.
/// Immutable.
class TellApart {
 public:
  /// \param radius_m of the robot
  TellApart(
      std::shared_ptr<const grid::OccupancyMap> map, double radius_m, const GlobalParams& params);

  /// The way from the likeliest place to where most speaks for or against it per metre driven.
  /// \param places best first, as GlobalLocalizer::places() gives them
  /// \param reach_m no farther than this
  /// \return in the map frame, a point every cell; empty when there is no second place, or when
  ///   nothing within reach tells them apart
  [[nodiscard]] std::vector<Point2> way(const std::vector<Place>& places, double reach_m) const;

 private:
  struct Look {
    double range_m = 0.0;
    bool ends = false;  // at an obstacle or out of sight; otherwise where nothing is known
  };
  /// Looks around a point, the first one at this yaw.
  [[nodiscard]] std::vector<Look> view(const Point2& p_map, double yaw) const;
  /// How much two views differ, [0, 1]; an empty one is none.
  [[nodiscard]] static double difference(const std::vector<Look>& a, const std::vector<Look>& b);
  /// A place that the robot may be at.
  struct Claim {
    Pose2 T_claim_best;  // takes points about the best place to where they would be
    double share = 0.0;
  };
  /// How much the views differ where the robot would be at a point, by the best place: [0, 1].
  [[nodiscard]] double told(const std::vector<Claim>& claims, const Point2& p_map) const;
  [[nodiscard]] grid::Cell cell(std::size_t i) const;
  [[nodiscard]] double clearance(std::size_t cell) const;
  [[nodiscard]] bool open(std::size_t cell) const;
  /// Of a metre there: more where it is narrow.
  [[nodiscard]] double costOf(std::size_t cell) const;
  /// A way of neighbouring cells with straight lines where these cost no more.
  /// \param cost of the way to each cell
  [[nodiscard]] std::vector<std::size_t> shortened(
      const std::vector<std::size_t>& way, const std::vector<float>& cost) const;

  std::shared_ptr<const grid::OccupancyMap> map_;
  grid::DistanceField distances_;
  grid::OccupancyMap fixed_;  // without what moves
  grid::DistanceField fixed_distances_;
  grid::RayCaster rays_;  // end where nothing is known, too
  double radius_m_;
};

}  // namespace vestibule::amcl
