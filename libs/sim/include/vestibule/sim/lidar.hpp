#pragma once

#include <cstdint>
#include <functional>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/sensors/measurements.hpp"
#include "vestibule/sim/world_geometry.hpp"

namespace vestibule::sim {

/// How light comes back, alike for all lidars.
struct EchoParams {
  double range_min_m = 0.1;
  double range_max_m = 30.0;
  double sigma_m = 0.02;
  double drop_out = 0.005;                ///< share of beams without an echo
  double outliers = 0.005;                ///< share of beams that end somewhere before the wall
  double dark_drop_out = 0.5;             ///< on dark faces
  double glass_pass = 0.8;                ///< of beams on glass, unless they meet it nearly head-on
  double foliage_sigma_m = 0.15;          ///< how deep a beam gets into leaves
  double grazing_rad = degToRad(10.0);    ///< below this angle to a face echoes get weak and noisy
  double divergence_rad = degToRad(0.2);  ///< width of the beam; at an edge it sees both sides
  double mixed_share = 0.5;               ///< of beams on an edge that end between its sides
};

struct LidarParams {
  double rate_hz = 10.0;  ///< must divide 200 Hz
  int beams = 361;
  double field_of_view_rad = degToRad(270.0);
  double height_m = 0.4;   ///< above the ground under the base
  double sweep_s = 0.019;  ///< from the first beam to the last
  double occlusion = 0.0;  ///< share of the view hidden by people around the robot
  EchoParams echo;
};
void describe(ParamIo& io, LidarParams& params);

/// A lidar with several rings, off unless asked for.
struct RingLidarParams {
  bool enabled = false;
  double rate_hz = 10.0;
  int rings = 16;
  double lowest_rad = degToRad(-15.0);
  double highest_rad = degToRad(15.0);
  int azimuths = 900;  ///< per turn
  double height_m = 0.9;
  EchoParams echo;
};
void describe(ParamIo& io, RingLidarParams& params);

/// True pose of the base, at a share [0, 1] of the sweep. Pose3: z of the base above the datum.
using PoseDuring = std::function<Pose3(double share)>;

/// What a beam meets behind the glass that it has met; the glass itself when that is met nearly
/// head-on. \pre direction has unit length
[[nodiscard]] RayHit throughGlass(
    const WorldGeometry& geometry,
    const Moment& moment,
    const Eigen::Vector3d& origin,
    const Eigen::Vector3d& direction,
    const RayHit& glass,
    double range_max_m);

/// One sweep; beam i at its own time, from the pose of that time. Stamp: the first beam.
[[nodiscard]] LaserScan simulateScan(
    const WorldGeometry& geometry,
    const Moment& moment,
    const LidarParams& params,
    const PoseDuring& T_map_base,
    const Pose2& T_base_laser,
    Timestamp stamp,
    std::uint64_t seed,
    std::uint64_t index);

/// One turn of the ring lidar, over one period; the sensor sits above the base's origin.
[[nodiscard]] LidarSweep simulateSweep(
    const WorldGeometry& geometry,
    const Moment& moment,
    const RingLidarParams& params,
    const PoseDuring& T_map_base,
    Timestamp stamp,
    std::uint64_t seed,
    std::uint64_t index);

}  // namespace vestibule::sim
