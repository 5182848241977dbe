#include <algorithm>
#include <cmath>
#include <limits>

#include "vestibule/core/random.hpp"
#include "vestibule/sim/sensor_models.hpp"

namespace vestibule::sim {
namespace {

// Distance to a roof at which an RTK receiver keeps its integer and its float solution, and how
// long it needs to get there after the sky has opened.
constexpr double kFixedBeyond_m = 4.0;
constexpr double kFloatBeyond_m = 1.5;
constexpr double kFloatAfter_s = 2.0;
constexpr double kFixedAfter_s = 6.0;
constexpr double kVerticalRatio = 1.5;
constexpr double kGarbageEpisode_s = 2.0;
constexpr double kGarbage_m = 15.0;

struct ErrorBudget {
  double slow_m;       // correlated over time
  double white_m;      // independent from fix to fix
  double multipath_m;  // function of place, in the deepest shadow
};

std::uint64_t latticeHash(std::uint64_t seed, int component, std::int64_t ix, std::int64_t iy) {
  const auto words = philox4x32(
      {static_cast<std::uint32_t>(ix),
       static_cast<std::uint32_t>(iy),
       static_cast<std::uint32_t>(component),
       0x706C6163U},
      {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U)});
  return (static_cast<std::uint64_t>(words[1]) << 32U) | words[0];
}

double latticeNormal(std::uint64_t seed, int component, std::int64_t ix, std::int64_t iy) {
  return RandomStream(latticeHash(seed, component, ix, iy), "place").normal();
}

}  // namespace

void describe(ParamIo& io, GnssParams& params) {
  io.optional(
      "receiver", params.receiver, {{"rtk", GnssClass::kRtk}, {"single", GnssClass::kSingle}});
  io.optional("rate_hz", params.rate_hz, within(0.1, 200.0));
  const double steps = 200.0 / params.rate_hz;
  if (std::abs(steps - std::round(steps)) > 1e-9) {
    io.problem("rate_hz", "must divide 200 Hz, e.g. 1, 2, 5, 10");
  }
  io.optional("correlation_s", params.correlation_s, positive());
  io.optional("fixed_sigma_m", params.fixed_sigma_m, positive());
  io.optional("float_sigma_m", params.float_sigma_m, positive());
  io.optional("single_sigma_m", params.single_sigma_m, positive());
  io.optional("single_white_m", params.single_white_m, positive());
  io.optional("multipath_m", params.multipath_m, nonNegative());
  io.optional("multipath_length_m", params.multipath_length_m, positive());
  io.optional("shadow_m", params.shadow_m, positive());
  io.optional("garbage_share", params.garbage_share, within(0.0, 1.0));
  io.optional("min_first_fix_s", params.min_first_fix_s, nonNegative());
  io.optional("max_first_fix_s", params.max_first_fix_s, nonNegative());
  if (params.max_first_fix_s < params.min_first_fix_s) {
    io.problem("max_first_fix_s", "must not be below min_first_fix_s");
  }
}

double placeNoise(std::uint64_t seed, int component, const Point2& p_map, double length_m) {
  const double fx = std::floor(p_map.x / length_m);
  const double fy = std::floor(p_map.y / length_m);
  const auto ix = static_cast<std::int64_t>(fx);
  const auto iy = static_cast<std::int64_t>(fy);
  const auto smooth = [](double s) { return s * s * (3.0 - 2.0 * s); };
  const double sx = smooth(p_map.x / length_m - fx);
  const double sy = smooth(p_map.y / length_m - fy);
  double sum = 0.0;
  double weight2 = 0.0;
  for (const int jx : {0, 1}) {
    for (const int jy : {0, 1}) {
      const double weight = (jx == 0 ? 1.0 - sx : sx) * (jy == 0 ? 1.0 - sy : sy);
      sum += weight * latticeNormal(seed, component, ix + jx, iy + jy);
      weight2 += weight * weight;
    }
  }
  return sum / std::sqrt(weight2);  // the blend alone would be weaker between lattice points
}

GnssModel::GnssModel(const World& world, const GnssParams& params, std::uint64_t seed)
    : params_(params), seed_(seed), plane_(world.datum), last_position_(world.datum) {
  for (const Building& building : world.buildings) {
    if (building.roof) roofs_.push_back(building.shape.outline);
  }
  RandomStream random(seed_, "gnss start");
  for (int axis = 0; axis < 3; ++axis) slow_[axis] = random.normal();
}

void GnssModel::advanceSlowError() {
  RandomStream random(seed_, "gnss slow", index_);
  const double keep = std::exp(-1.0 / (params_.rate_hz * params_.correlation_s));
  for (int axis = 0; axis < 3; ++axis) {
    slow_[axis] = keep * slow_[axis] + std::sqrt(1.0 - keep * keep) * random.normal();
  }
}

GnssFixType GnssModel::typeNow(Timestamp stamp, double distance_to_roof_m) {
  if (distance_to_roof_m <= 0.0) {
    had_sky_ = false;
    good_sky_since_.reset();
    // Now and then a receiver under a roof believes some reflections for a while.
    const auto episode =
        static_cast<std::uint64_t>(toSeconds(Duration(stamp.ns)) / kGarbageEpisode_s);
    const bool wild = RandomStream(seed_, "gnss garbage", episode).bernoulli(params_.garbage_share);
    return wild ? GnssFixType::kSingle : GnssFixType::kNone;
  }
  if (!had_sky_) {
    had_sky_ = true;
    RandomStream random(seed_, "gnss first fix", roof_exits_++);
    first_fix_ = stamp + durationFromSeconds(
                             random.uniform(params_.min_first_fix_s, params_.max_first_fix_s));
  }
  if (stamp < first_fix_) return GnssFixType::kNone;
  if (params_.receiver == GnssClass::kSingle) return GnssFixType::kSingle;

  if (distance_to_roof_m < kFloatBeyond_m) {
    good_sky_since_.reset();
    return GnssFixType::kSingle;
  }
  if (!good_sky_since_) {
    // A receiver that was never under a roof has converged before the drive began.
    const bool converged = index_ == 0;
    good_sky_since_ = converged ? stamp - durationFromSeconds(kFixedAfter_s) : stamp;
  }
  const double good_s = toSeconds(stamp - *good_sky_since_);
  if (distance_to_roof_m < kFixedBeyond_m || good_s < kFixedAfter_s) {
    return good_s < kFloatAfter_s ? GnssFixType::kSingle : GnssFixType::kRtkFloat;
  }
  return GnssFixType::kRtkFixed;
}

GnssFix GnssModel::measure(Timestamp stamp, const Point2& p_map_antenna) {
  double distance_m = std::numeric_limits<double>::max();
  for (const geo::Polygon& roof : roofs_) {
    distance_m = std::min(distance_m, geo::signedDistance(roof, p_map_antenna));
  }
  advanceSlowError();
  GnssFix fix;
  fix.stamp = stamp;
  fix.type = typeNow(stamp, distance_m);
  RandomStream random(seed_, "gnss white", index_++);

  // 1 in the open, 0 at the wall and under the roof.
  const double sky = 1.0 - std::exp(-std::max(distance_m, 0.0) / params_.shadow_m);
  fix.satellites = distance_m <= 0.0 ? 3 : 5 + static_cast<int>(std::lround(9.0 * sky));
  fix.hdop = 0.7 + 3.0 * (1.0 - sky);
  if (fix.type == GnssFixType::kNone) {
    fix.position = last_position_;
    fix.hdop.reset();
    return fix;
  }

  ErrorBudget budget{params_.single_sigma_m, params_.single_white_m, params_.multipath_m};
  double claimed_m = std::hypot(params_.single_sigma_m, params_.single_white_m);
  if (fix.type == GnssFixType::kRtkFloat) {
    budget = {params_.float_sigma_m, 0.1, 0.3 * params_.multipath_m};
    claimed_m = params_.float_sigma_m;
  } else if (fix.type == GnssFixType::kRtkFixed) {
    budget = {params_.fixed_sigma_m, params_.fixed_sigma_m, 0.01 * params_.multipath_m};
    claimed_m = std::sqrt(2.0) * params_.fixed_sigma_m;
  }
  // The shadow deepens the true error; the receiver notices only part of it.
  const double shade = 1.0 - sky;
  claimed_m *= 1.0 + 0.5 * shade;
  const std::uint64_t place_seed = derivedSeed(seed_, "gnss multipath");
  Eigen::Vector3d error;
  for (int axis = 0; axis < 3; ++axis) {
    error[axis] = budget.slow_m * slow_[axis] + budget.white_m * random.normal() +
                  budget.multipath_m * shade *
                      placeNoise(place_seed, axis, p_map_antenna, params_.multipath_length_m);
  }
  if (distance_m <= 0.0) {
    for (int axis = 0; axis < 3; ++axis) {
      error[axis] += kGarbage_m * placeNoise(place_seed, 3 + axis, p_map_antenna, 5.0);
    }
  }
  error.z() *= kVerticalRatio;
  const double up_m = kVerticalRatio * claimed_m;
  fix.cov_enu = Eigen::Vector3d(claimed_m * claimed_m, claimed_m * claimed_m, up_m * up_m)
                    .asDiagonal()
                    .toDenseMatrix();
  last_position_ =
      plane_.toGeodetic(Eigen::Vector3d(p_map_antenna.x, p_map_antenna.y, 0.0) + error);
  fix.position = last_position_;
  return fix;
}

}  // namespace vestibule::sim
