#pragma once

#include <Eigen/Core>
#include <limits>
#include <memory>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/sim/ground.hpp"

namespace vestibule::sim {

struct World;

/// What a beam or a satellite signal meets.
enum class Material {
  kSolid,
  kDark,     ///< stops everything, returns little light
  kGlass,    ///< lets light through more often than not, stops robots
  kFoliage,  ///< scatters light, weakens satellite signals
  kGround
};

/// One upright face: the segment from a to b between two heights [m], map frame.
struct Segment {
  Point2 a;
  Point2 b;
  double z_low_m = -std::numeric_limits<double>::infinity();
  double z_high_m = std::numeric_limits<double>::infinity();
  Material material = Material::kSolid;
};

/// Where a ray ends.
struct RayHit {
  double range_m = 0.0;  ///< along the ray; the maximum range when nothing was met
  bool hit = false;
  Material material = Material::kSolid;
  double cos_incidence = 1.0;  ///< |cos| of the angle between ray and surface normal
};

/// What stands between an antenna and a satellite.
struct SkyPath {
  bool roof = false;
  bool wall = false;  ///< solid or dark faces
  bool glass = false;
  bool foliage = false;
  [[nodiscard]] bool clear() const { return !roof && !wall && !glass && !foliage; }
};

/// A roof plate at one height.
struct Roof {
  geo::Polygon outline;
  double height_m = 4.0;
};

/// The moving part of the world at one instant: doors on their way, people, vehicles.
struct Moment {
  std::vector<Segment> faces;
};

/// The outlines of everything solid in a world. Circles become 24-gons around the true circle; an
/// occupancy image becomes its cell edges. Throws InputError when that image cannot be read.
[[nodiscard]] std::vector<Segment> segmentsOf(const World& world);

/// Upright faces in a uniform bucket grid, ground and roofs: exact ray casts and distances, no
/// rasterisation. Immutable; may be shared between threads.
class WorldGeometry {
 public:
  explicit WorldGeometry(std::vector<Segment> segments);
  /// Keeps its own copy of what it needs of the world.
  explicit WorldGeometry(const World& world);
  ~WorldGeometry();
  WorldGeometry(const WorldGeometry&) = delete;
  WorldGeometry& operator=(const WorldGeometry&) = delete;

  [[nodiscard]] const std::vector<Segment>& segments() const { return segments_; }

  /// Distance to the first face that a level ray at this height meets, or `max_range_m` when none
  /// is nearer. The ground does not count.
  [[nodiscard]] double castRay(
      const Point2& p_map_origin,
      double angle_rad,
      double max_range_m,
      double height_m = 0.4) const;

  /// The moving part of the world, `time_s` after the start of the run.
  [[nodiscard]] Moment momentAt(double time_s) const;

  /// First face or ground along a 3D ray. \pre direction has unit length
  [[nodiscard]] RayHit castRay(
      const Moment& moment,
      const Eigen::Vector3d& p_map_origin,
      const Eigen::Vector3d& direction_map,
      double max_range_m) const;

  /// Everything between a point and a satellite. Azimuth counter-clockwise from east [rad].
  [[nodiscard]] SkyPath skyPath(
      const Moment& moment,
      const Eigen::Vector3d& p_map_antenna,
      double azimuth_rad,
      double elevation_rad) const;

  /// Height of the ground [m].
  [[nodiscard]] double groundHeight(const Point2& p_map) const;
  [[nodiscard]] Eigen::Vector3d groundNormal(const Point2& p_map) const;  ///< unit length, upwards
  [[nodiscard]] bool flat() const;  ///< whether the ground is at 0 everywhere
  [[nodiscard]] const GroundClass& groundAt(const Point2& p_map) const;
  /// Signed distance to the nearest roof [m]; negative = under it. Large without any.
  [[nodiscard]] double distanceToRoofs(const Point2& p_map) const;

  /// Distance to the nearest segment [m]; infinite without any.
  [[nodiscard]] double clearance(const Point2& p_map) const;

  /// Distance from a rectangle centred on the pose to the nearest face in the robot's way [m]; 0 on
  /// contact.
  [[nodiscard]] double footprintClearance(
      const Pose2& T_map_base,
      double half_length_m,
      double half_width_m,
      const Moment& moment = {}) const;
  /// Whether a face crosses that rectangle.
  [[nodiscard]] bool footprintCollides(
      const Pose2& T_map_base,
      double half_length_m,
      double half_width_m,
      const Moment& moment = {}) const;

 private:
  struct Line {
    double ax, ay, dx, dy;  // from a, along d to b
    double z_low, z_high;
    Material material;
    bool in_the_way = true;  // of the robot
  };
  struct Dynamics;
  void fillGrid();
  [[nodiscard]] static Line lineOf(const Segment& segment);
  [[nodiscard]] bool isInTheWay(const Segment& segment) const;
  template <class Visit>
  void walk(double ox, double oy, double dx, double dy, const double& limit_m, Visit visit) const;
  template <class DistanceTo>
  [[nodiscard]] double nearest(const Point2& p, double slack_m, DistanceTo distance_to) const;
  [[nodiscard]] double groundRange(
      const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double max_range_m) const;

  std::vector<Segment> segments_;
  std::vector<Line> all_lines_;  // one per segment
  std::vector<Roof> roofs_;
  std::unique_ptr<const Dynamics> dynamics_;  // doors, movers, ground; empty for bare segments
  double top_m_ = 0.0;                        // of everything that can hide a satellite
  Point2 p_corner_;
  double inverse_cell_ = 1.0;
  double cell_m_ = 1.0;
  int width_ = 0;
  int height_ = 0;
  std::vector<std::size_t> first_;  // cell -> its first entry in lines_; one more than cells
  std::vector<Line> lines_;         // copies, so that a cell's lines lie side by side
};

}  // namespace vestibule::sim
