#include "vestibule/sim/lidar.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "rotation.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/sim/sensor_rate.hpp"

namespace vestibule::sim {
namespace {

constexpr double kHeadOn_rad = 0.17;  // within this of the normal, glass sends light back
constexpr double kBehindGlass_m = 1e-3;
constexpr double kEdge_m = 0.3;        // a depth step of this much makes mixed echoes
constexpr double kGrazingNoise = 3.0;  // range noise at grazing incidence, times the usual
constexpr double kGrazingDropOut = 0.5;
constexpr double kLeafDepth_m = 0.4;
// People around the robot.
constexpr double kPersonNear_m = 0.5;
constexpr double kPersonFar_m = 2.5;
constexpr double kPersonWidth_rad = 0.17;
constexpr std::uint64_t kPersonStays_scans = 10;

/// Reads the fields that all lidars share, in the lidar's own mapping.
void echoFields(ParamIo& io, EchoParams& echo) {
  io.optional("range_min_m", echo.range_min_m, nonNegative());
  io.optional("range_max_m", echo.range_max_m, positive());
  io.optional("sigma_m", echo.sigma_m, nonNegative());
  io.optional("drop_out", echo.drop_out, within(0.0, 1.0));
  io.optional("outliers", echo.outliers, within(0.0, 1.0));
  io.optional("dark_drop_out", echo.dark_drop_out, within(0.0, 1.0));
  io.optional("glass_pass", echo.glass_pass, within(0.0, 1.0));
  io.optional("foliage_sigma_m", echo.foliage_sigma_m, nonNegative());
  io.optionalDegrees("grazing_deg", echo.grazing_rad, within(0.0, 60.0));
  io.optionalDegrees("divergence_deg", echo.divergence_rad, within(0.0, 5.0));
  io.optional("mixed_share", echo.mixed_share, within(0.0, 1.0));
}

/// What one beam reports; empty without an echo.
class Beam {
 public:
  Beam(const WorldGeometry& geometry, const Moment& moment, const EchoParams& echo)
      : geometry_(geometry), moment_(moment), echo_(echo) {}

  /// \param sideways  unit vector across the beam along which its width counts
  std::optional<double> measure(
      const Eigen::Vector3d& origin,
      const Eigen::Vector3d& direction,
      const Eigen::Vector3d& sideways,
      RandomStream& random) const {
    // The same numbers are drawn whatever the beam meets: one beam does not shift the next.
    const double fate = random.uniform();
    const double material_fate = random.uniform();
    const double depth_fate = random.uniform();
    const double noise = random.normal();
    if (fate < echo_.drop_out) return std::nullopt;
    RayHit hit = geometry_.castRay(moment_, origin, direction, echo_.range_max_m);
    if (hit.hit && hit.material == Material::kGlass) {
      if (material_fate < echo_.glass_pass) {
        hit = throughGlass(geometry_, moment_, origin, direction, hit, echo_.range_max_m);
      }
    }
    if (fate < echo_.drop_out + echo_.outliers) {
      const double end_m = std::max(hit.range_m, echo_.range_min_m);
      return echo_.range_min_m + depth_fate * (end_m - echo_.range_min_m);
    }
    if (!hit.hit) return std::nullopt;
    double sigma_m = echo_.sigma_m;
    double range_m = hit.range_m;
    if (hit.material == Material::kDark && material_fate < echo_.dark_drop_out) {
      return std::nullopt;
    }
    if (hit.material == Material::kFoliage) {
      const double depth_m = -echo_.foliage_sigma_m * std::log(1.0 - depth_fate);
      range_m += std::min(depth_m, kLeafDepth_m);
    }
    if (hit.cos_incidence < std::sin(echo_.grazing_rad)) {
      if (material_fate < kGrazingDropOut) return std::nullopt;
      sigma_m *= kGrazingNoise;
    }
    if (echo_.mixed_share > 0.0 && echo_.divergence_rad > 0.0) {
      const double half = 0.5 * echo_.divergence_rad;
      const auto beside = [&](double side) {
        const Eigen::Vector3d d = (direction + side * half * sideways).normalized();
        return geometry_.castRay(moment_, origin, d, echo_.range_max_m);
      };
      const RayHit left = beside(1.0);
      const RayHit right = beside(-1.0);
      const double near_m = std::min(left.range_m, right.range_m);
      const double far_m = std::max(left.range_m, right.range_m);
      if (far_m - near_m > kEdge_m && left.hit && right.hit && material_fate < echo_.mixed_share) {
        range_m = near_m + depth_fate * (far_m - near_m);
      }
    }
    range_m = std::max(range_m + sigma_m * noise, 0.0);
    return range_m < echo_.range_max_m ? std::optional(range_m) : std::nullopt;
  }

 private:
  const WorldGeometry& geometry_;
  const Moment& moment_;
  const EchoParams& echo_;
};

}  // namespace

RayHit throughGlass(
    const WorldGeometry& geometry,
    const Moment& moment,
    const Eigen::Vector3d& origin,
    const Eigen::Vector3d& direction,
    const RayHit& glass,
    double range_max_m) {
  if (glass.cos_incidence > std::cos(kHeadOn_rad)) return glass;
  const double skipped_m = glass.range_m + kBehindGlass_m;
  RayHit hit =
      geometry.castRay(moment, origin + skipped_m * direction, direction, range_max_m - skipped_m);
  hit.range_m += skipped_m;
  return hit;
}

void describe(ParamIo& io, LidarParams& params) {
  rateField(io, params.rate_hz);
  io.optional("beams", params.beams, within(2, 20000));
  io.optionalDegrees(
      "field_of_view_deg", params.field_of_view_rad, Bounds{0.0, 360.0, true, false});
  io.optional("height_m", params.height_m, within(0.02, 5.0));
  io.optional("sweep_s", params.sweep_s, nonNegative());
  if (params.sweep_s > 1.0 / params.rate_hz) {
    io.problem("sweep_s", "must not be longer than the time between two sweeps");
  }
  io.optional("occlusion", params.occlusion, within(0.0, 1.0));
  echoFields(io, params.echo);
}

void describe(ParamIo& io, RingLidarParams& params) {
  io.optional("enabled", params.enabled);
  rateField(io, params.rate_hz);
  io.optional("rings", params.rings, within(2, 256));
  io.optionalDegrees("lowest_deg", params.lowest_rad, within(-89.0, 89.0));
  io.optionalDegrees("highest_deg", params.highest_rad, within(-89.0, 89.0));
  io.optional("azimuths", params.azimuths, within(2, 20000));
  io.optional("height_m", params.height_m, within(0.02, 5.0));
  echoFields(io, params.echo);
}

LaserScan simulateScan(
    const WorldGeometry& geometry,
    const Moment& moment,
    const LidarParams& params,
    const PoseDuring& T_map_base,
    const Pose2& T_base_laser,
    Timestamp stamp,
    std::uint64_t seed,
    std::uint64_t index) {
  RandomStream random(seed, "lidar", index);
  LaserScan scan;
  scan.stamp = stamp;
  scan.angle_min_rad = -0.5 * params.field_of_view_rad;
  scan.angle_step_rad = params.field_of_view_rad / (params.beams - 1);
  scan.time_increment_s = params.sweep_s / params.beams;
  scan.range_min_m = params.echo.range_min_m;
  scan.range_max_m = params.echo.range_max_m;
  scan.T_base_laser = T_base_laser;
  scan.ranges_m.reserve(static_cast<std::size_t>(params.beams));
  // Sectors hidden by people keep their places for about a second.
  const auto sectors = static_cast<int>(params.field_of_view_rad / kPersonWidth_rad) + 1;
  const std::uint64_t people = derivedSeed(seed, "people", index / kPersonStays_scans);
  const Beam beam(geometry, moment, params.echo);
  Eigen::Matrix3d R_map_base = Eigen::Matrix3d::Identity();
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  for (int i = 0; i < params.beams; ++i) {
    const bool moves = params.sweep_s > 0.0;
    if (i == 0 || moves) {
      const Pose3 T = T_map_base(static_cast<double>(i) / params.beams);
      R_map_base = rotationOf(T);
      origin = positionOf(T) +
               R_map_base * Eigen::Vector3d(T_base_laser.x, T_base_laser.y, params.height_m);
    }
    const double angle_rad = T_base_laser.phi + scan.angle(static_cast<std::size_t>(i));
    const double c = std::cos(angle_rad);
    const double s = std::sin(angle_rad);
    auto range_m = beam.measure(
        origin,
        R_map_base * Eigen::Vector3d(c, s, 0.0),
        R_map_base * Eigen::Vector3d(-s, c, 0.0),
        random);
    if (params.occlusion > 0.0) {
      const auto sector = static_cast<std::uint64_t>(i * sectors / params.beams);
      RandomStream person(people, "person", sector);
      const double person_m =
          person.bernoulli(params.occlusion) ? person.uniform(kPersonNear_m, kPersonFar_m) : 1e9;
      if (person_m < range_m.value_or(params.echo.range_max_m)) range_m = person_m;
    }
    scan.ranges_m.push_back(
        range_m ? static_cast<float>(*range_m) : std::numeric_limits<float>::infinity());
  }
  return scan;
}

LidarSweep simulateSweep(
    const WorldGeometry& geometry,
    const Moment& moment,
    const RingLidarParams& params,
    const PoseDuring& T_map_base,
    Timestamp stamp,
    std::uint64_t seed,
    std::uint64_t index) {
  RandomStream random(seed, "ring lidar", index);
  LidarSweep sweep;
  sweep.stamp = stamp;
  sweep.T_base_laser.z = params.height_m;
  const Beam beam(geometry, moment, params.echo);
  const double period_s = 1.0 / params.rate_hz;
  for (int column = 0; column < params.azimuths; ++column) {
    const double share = static_cast<double>(column) / params.azimuths;
    const Pose3 T = T_map_base(share);
    const Eigen::Matrix3d R_map_base = rotationOf(T);
    const Eigen::Vector3d origin =
        positionOf(T) + R_map_base * Eigen::Vector3d(0.0, 0.0, params.height_m);
    const double c = std::cos(2.0 * kPi * share);
    const double s = std::sin(2.0 * kPi * share);
    for (int ring = 0; ring < params.rings; ++ring) {
      const double elevation_rad =
          params.lowest_rad + (params.highest_rad - params.lowest_rad) * ring / (params.rings - 1);
      const double flat = std::cos(elevation_rad);
      const Eigen::Vector3d direction(flat * c, flat * s, std::sin(elevation_rad));
      const auto range_m = beam.measure(
          origin, R_map_base * direction, R_map_base * Eigen::Vector3d(-s, c, 0.0), random);
      if (!range_m || *range_m < params.echo.range_min_m) continue;
      sweep.points.push_back(
          {(*range_m * direction).cast<float>(), static_cast<float>(share * period_s), ring});
    }
  }
  return sweep;
}

}  // namespace vestibule::sim
