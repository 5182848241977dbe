#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/amcl/localizer.hpp"
#include "vestibule/core/events.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/localize.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::pipeline {

/// What a hint can cost a place, twice its log odds: enough to be believed between places that fit
/// alike (8), and no more than other scans can outvote.
inline constexpr double kHintMaxD2 = 20.0;

/// Takes the GNSS fixes and headings of a recording to a localizer, in the frame of its map: to its
/// searches as what is known beforehand, and to its particles as AmclParams::gnss says.
class GeoHints {
 public:
  /// \param georeference of the map; empty: nothing is taken, only counted
  /// \param config, map, observers outlive it
  GeoHints(
      const Config& config,
      const grid::OccupancyMap& map,
      const std::optional<io::MapGeoreference>& georeference,
      const Observers& observers);

  void process(const GnssFix& fix, const Point2& p_base_antenna, amcl::Localizer& localizer);
  void process(const Heading& heading, amcl::Localizer& localizer);

  [[nodiscard]] const GeoUse& use() const { return use_; }
  /// Of what was not used, and why.
  [[nodiscard]] std::vector<std::string> notes() const;

 private:
  [[nodiscard]] bool isFar(const GnssFix& fix, const Point2& p_map_antenna);

  const Config& config_;
  const grid::OccupancyMap& map_;
  const Observers& observers_;
  std::optional<io::MapGeoreference> georeference_;
  std::optional<geo::TangentPlane> plane_;  // at its datum
  GeoUse use_;
  std::size_t local_fixes_ = 0;  // in the recording's own metres
  std::optional<double> far_m_;  // of the first fix that is too far from the map
  std::size_t untrusted_headings_ = 0;
};

}  // namespace vestibule::pipeline
