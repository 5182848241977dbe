#include "vestibule/pipeline/indoor_maps.hpp"

#include <cassert>
#include <stdexcept>

#include "vestibule/io/map_io.hpp"

namespace vestibule::pipeline {

MapPtr loadIndoorMap(const geo::IndoorMap& indoor, std::vector<std::string>* notes) {
  const grid::OccupancyMap map = io::loadMap(indoor.yaml_path, notes);
  amcl::requireUsable(map, indoor.yaml_path);
  return std::make_shared<const grid::OccupancyMap>(map.movedBy(indoor.T_map_grid));
}

std::vector<grid::MapRectangle> surveyIndoorMaps(
    const geo::Site& site,
    std::vector<std::string>* notes,
    const std::function<void(const grid::OccupancyMap&)>& look) {
  std::vector<grid::MapRectangle> rectangles;
  for (const geo::IndoorMap& indoor : site.indoor_maps) {
    const MapPtr map = loadIndoorMap(indoor, notes);
    rectangles.push_back(map->rectangle());
    if (look) look(*map);
  }
  return rectangles;
}

IndoorMaps::IndoorMaps(
    const MapsParams& params,
    const geo::Site& site,
    const std::vector<grid::MapRectangle>& rectangles,
    const Observers& observers)
    : params_(params), observers_(observers) {
  assert(rectangles.size() == site.indoor_maps.size());
  for (std::size_t i = 0; i < rectangles.size(); ++i) {
    all_.push_back({site.indoor_maps[i], rectangles[i], nullptr});
  }
}

void IndoorMaps::update(
    Timestamp stamp, const Point2& p_map_robot, amcl::MapLocalizers& localizers) {
  for (One& one : all_) {
    const double distance_m = one.rectangle.outside(p_map_robot);
    if (distance_m <= params_.load_within_m) {
      if (one.map == nullptr && !one.failed) load(one, stamp, distance_m, localizers);
    } else if (distance_m > params_.unload_beyond_m) {
      one.failed = false;
      if (one.map == nullptr || localizers.atWork() == one.indoor.name) continue;
      localizers.unload(one.indoor.name);
      one.map.reset();
      observers_.emit(MapEvent{stamp, MapEvent::Kind::kUnloaded, one.indoor.name, distance_m});
    }
  }
}

void IndoorMaps::load(
    One& one, Timestamp stamp, double distance_m, amcl::MapLocalizers& localizers) {
  try {
    one.map = loadIndoorMap(one.indoor);
  } catch (const std::runtime_error& error) {
    // Without the map the robot is as it is in a building that has none; without the run it stands.
    one.failed = true;
    observers_.emit(WarningEvent{stamp, "maps", error.what(), distance_m, params_.load_within_m});
    return;
  }
  localizers.load(one.indoor.name, one.map);
  observers_.emit(MapEvent{stamp, MapEvent::Kind::kLoaded, one.indoor.name, distance_m});
}

std::vector<MapPtr> IndoorMaps::loaded() const {
  std::vector<MapPtr> maps;
  for (const One& one : all_) {
    if (one.map != nullptr) maps.push_back(one.map);
  }
  return maps;
}

}  // namespace vestibule::pipeline
