#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/amcl/global_localizer.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/pipeline/progress.hpp"

namespace vestibule::pipeline {

/// Somewhere to be lost in: what a lidar meets there, and the map the robot was given of it.
struct LostPlace {
  std::string name;  ///< to show
  std::shared_ptr<const grid::OccupancyMap> map;
  /// True distance to the next obstacle: from a point, along a yaw, at most so far [m].
  std::function<double(const Point2&, double, double)> ray;
  std::function<double(const Point2&)> clearance;  ///< true distance to the nearest obstacle [m]
  std::function<bool(const Point2&)> inside;       ///< where the robot may go
};
/// A map whose truth has changed since: about 5 % of its occupied cells are gone in patches, and as
/// many stand as boxes where it is free.
[[nodiscard]] LostPlace changedMap(const std::string& map_path, std::uint64_t seed);
/// A simulated world with each of its given maps; the robot stays under roofs where there are any.
/// Lidars look through glass. Throws ConfigError for a world without given maps.
[[nodiscard]] std::vector<LostPlace> simulatedWorld(const std::string& world_path);

/// The places of all maps and worlds, named by their files; of equal names all but the first get
/// numbers.
[[nodiscard]] std::vector<LostPlace> lostPlaces(
    const std::vector<std::string>& map_paths,
    const std::vector<std::string>& world_paths,
    std::uint64_t seed);

/// How a trial ended. Right: within 0.3 m and 5 degrees.
enum class LostOutcome { kRight, kWrong, kUnsure };

struct LostTrial {
  Pose2 T_map_start;  ///< true pose where the search began
  Pose2 T_map_end;    ///< true pose at the end
  std::optional<Pose2> T_map_claimed;
  LostOutcome outcome = LostOutcome::kUnsure;
  double error_m = 0.0;  ///< of the claim
  double error_rad = 0.0;
  double driven_m = 0.0;   ///< until it was claimed, or all that was allowed
  double elapsed_s = 0.0;  ///< data time until then
  int searches = 0;
  std::vector<amcl::Place> places;  ///< candidates at the end, best first
  amcl::PlaceState state = amcl::PlaceState::kNowhere;
  double first_search_s = 0.0;  ///< wall time; 0 = not measured
};

/// Puts a robot at random free places without telling it where, lets it drive up to 20 m to where
/// its candidates differ (amcl::TellApart) without touching anything, by scans with 10 to 15 %
/// outliers and noise of 2 cm and by odometry that is some per cent wrong, until it says where it
/// is. Deterministic for any thread count, but for the wall time.
[[nodiscard]] std::vector<LostTrial> benchGlobal(
    const LostPlace& place,
    const Config& config,
    int places,
    std::uint64_t seed,
    const Progress& progress);

/// Lets a robot that knows where it is drive 6 m, carries it to another random place of the map
/// without its wheels noticing, and lets it drive up to 20 m more. Right: it has noticed, and
/// tracks the right pose again. Wrong: it claims a wrong pose after a search, or has not noticed at
/// the end. Driven and elapsed count from the kidnapping.
[[nodiscard]] std::vector<LostTrial> benchKidnap(
    const LostPlace& place,
    const Config& config,
    int kidnappings,
    std::uint64_t seed,
    const Progress& progress);

}  // namespace vestibule::pipeline
