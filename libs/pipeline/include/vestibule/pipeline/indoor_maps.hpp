#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "vestibule/amcl/map_localizers.hpp"
#include "vestibule/core/events.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/pipeline/config.hpp"

namespace vestibule::pipeline {

using MapPtr = std::shared_ptr<const grid::OccupancyMap>;

/// An indoor map in the site's map frame. Throws what loadMap() throws, and InputError for a map
/// in which nothing can be localized.
/// \param notes  told what loadMap() notes of it
[[nodiscard]] MapPtr loadIndoorMap(
    const geo::IndoorMap& indoor, std::vector<std::string>* notes = nullptr);

/// Where the site's indoor maps lie, in its order. Loads each of them once, one after the other, so
/// that one that is missing or broken is an error now and not at its door.
/// \param look  at each of them while it is in memory
[[nodiscard]] std::vector<grid::MapRectangle> surveyIndoorMaps(
    const geo::Site& site,
    std::vector<std::string>* notes = nullptr,
    const std::function<void(const grid::OccupancyMap&)>& look = {});

/// How often indoor maps came and went in a run.
struct MapChanges {
  int loaded = 0;
  int unloaded = 0;
  void count(const MapEvent& event) {
    ++(event.kind == MapEvent::Kind::kLoaded ? loaded : unloaded);
  }
};

/// The indoor maps of a site, in memory only while the robot is near: loads them into the
/// localizers on the way there and unloads them behind it.
class IndoorMaps {
 public:
  /// \param rectangles as of surveyIndoorMaps()
  /// \param observers outlive this; receive a MapEvent for each change
  IndoorMaps(
      const MapsParams& params,
      const geo::Site& site,
      const std::vector<grid::MapRectangle>& rectangles,
      const Observers& observers);

  /// A map whose file has become unreadable since the start is a WarningEvent, and is tried again
  /// when the robot comes the next time.
  void update(Timestamp stamp, const Point2& p_map_robot, amcl::MapLocalizers& localizers);

  /// Those in memory.
  [[nodiscard]] std::vector<MapPtr> loaded() const;

 private:
  struct One {
    geo::IndoorMap indoor;
    grid::MapRectangle rectangle;
    MapPtr map;  ///< null while it is not in memory
    bool failed = false;
  };
  void load(One& one, Timestamp stamp, double distance_m, amcl::MapLocalizers& localizers);

  MapsParams params_;
  std::vector<One> all_;
  const Observers& observers_;
};

}  // namespace vestibule::pipeline
