#include "vestibule/sim/gnss.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/sim/place_noise.hpp"
#include "vestibule/sim/sensor_rate.hpp"

namespace vestibule::sim {
namespace {

constexpr int kMinUsed = 4;
constexpr int kFloatNeeds = 6;  // satellites in view
constexpr int kFixedNeeds = 8;
constexpr int kSbasNeeds = 5;
constexpr double kFloatAfter_s = 2.0;
constexpr double kFixedAfter_s = 6.0;
constexpr double kSbasAfter_s = 5.0;
constexpr double kSbasSlow = 0.35;  // what corrections leave of the slow error
constexpr double kFloatWhite_m = 0.1;
constexpr double kVerticalRatio = 1.5;    // of carrier-phase errors
constexpr double kDecisionCell_m = 2.0;   // a reflection is received or not over this length ...
constexpr double kDecision_s = 4.0;       // ... and this time
constexpr double kReflectionNoise = 2.0;  // white noise of a reflection against a direct signal
constexpr double kWorstHdop = 20.0;       // a receiver reports no worse geometry
constexpr double kRaimLimit = 4.0;        // times the claimed sigma
constexpr int kRaimMost = 2;
constexpr double kRateSlow_s = 10.0;  // how long the slow part of range rates lasts
constexpr Duration kSkyPeriod = std::chrono::seconds(1);

/// Weighted least squares of position and clock.
struct Solution {
  Eigen::Vector4d x = Eigen::Vector4d::Zero();
  Eigen::Matrix4d gain_q = Eigen::Matrix4d::Zero();  // (H' W H)^-1
  bool ok = false;
};

}  // namespace

void describe(ParamIo& io, GnssParams& params) {
  io.optional(
      "receiver",
      params.receiver,
      {{"single", GnssClass::kSingle}, {"sbas", GnssClass::kSbas}, {"rtk", GnssClass::kRtk}});
  rateField(io, params.rate_hz);
  io.optional("antenna_height_m", params.antenna_height_m, within(0.0, 10.0));
  io.optionalDegrees("mask_deg", params.mask_rad, within(0.0, 60.0));
  io.optional("range_white_m", params.range_white_m, positive());
  io.optional("range_slow_m", params.range_slow_m, nonNegative());
  io.optional("correlation_s", params.correlation_s, positive());
  io.optional("wall_share", params.wall_share, within(0.0, 1.0));
  io.optional("foliage_share", params.foliage_share, within(0.0, 1.0));
  io.optional("glass_share", params.glass_share, within(0.0, 1.0));
  io.optional("roof_share", params.roof_share, within(0.0, 1.0));
  io.optional("nlos_bias_m", params.nlos_bias_m, nonNegative());
  io.optional("nlos_length_m", params.nlos_length_m, positive());
  io.optional("raim", params.raim);
  io.optional("smoothing_s", params.smoothing_s, nonNegative());
  io.optional("rate_white_mps", params.rate_white_mps, positive());
  io.optional("rate_slow_mps", params.rate_slow_mps, nonNegative());
  io.optional("float_sigma_m", params.float_sigma_m, positive());
  io.optional("fixed_sigma_m", params.fixed_sigma_m, positive());
  io.optional("wrong_fix_share", params.wrong_fix_share, within(0.0, 1.0));
  io.optional("min_first_fix_s", params.min_first_fix_s, nonNegative());
  io.optional("max_first_fix_s", params.max_first_fix_s, nonNegative());
  if (params.max_first_fix_s < params.min_first_fix_s) {
    io.problem("max_first_fix_s", "must not be below min_first_fix_s");
  }
}

GnssModel::GnssModel(
    const WorldGeometry& geometry,
    const Geodetic& datum,
    const GnssParams& params,
    std::uint64_t seed)
    : geometry_(geometry),
      plane_(datum),
      params_(params),
      seed_(seed),
      constellation_(datum, derivedSeed(seed, "gnss sky")),
      last_position_(datum),
      rate_slow_(constellation_.size(), 0.0) {
  RandomStream random(seed_, "gnss start");
  for (int axis = 0; axis < 3; ++axis) carrier_slow_[axis] = random.normal();
  for (std::size_t i = 0; i < constellation_.size(); ++i) slow_.push_back(random.normal());
}

void GnssModel::disturb(const Eigen::Vector3d& offset_enu_m, bool blocked) {
  offset_m_ = offset_enu_m;
  blocked_ = blocked;
}

void GnssModel::ageErrors() {
  // Every satellite ages, whether it is used or not: what is in view must not shift the streams.
  RandomStream random(seed_, "gnss slow", index_);
  const double keep = std::exp(-1.0 / (params_.rate_hz * params_.correlation_s));
  const double fresh = std::sqrt(1.0 - keep * keep);
  for (int axis = 0; axis < 3; ++axis) {
    carrier_slow_[axis] = keep * carrier_slow_[axis] + fresh * random.normal();
  }
  for (double& slow : slow_) slow = keep * slow + fresh * random.normal();
}

Eigen::Vector3d GnssModel::smoothed(Timestamp stamp, const Eigen::Vector3d& code_error_m) {
  constexpr double kStartsAnew_s = 2.0;  // without a fix for so long
  const double since_s = smoothed_at_ ? toSeconds(stamp - *smoothed_at_) : kStartsAnew_s;
  const bool anew = since_s >= std::max(kStartsAnew_s, 1.5 / params_.rate_hz);
  const double keep =
      anew || params_.smoothing_s == 0.0 ? 0.0 : std::exp(-since_s / params_.smoothing_s);
  smoothed_m_ = keep * smoothed_m_ + (1.0 - keep) * code_error_m;
  smoothed_at_ = stamp;
  return smoothed_m_;
}

std::vector<GnssModel::Range> GnssModel::rangesNow(
    Timestamp stamp, const Moment& moment, const Eigen::Vector3d& p_map_antenna) {
  if (!sky_stamp_ || stamp - *sky_stamp_ >= kSkyPeriod) {
    sky_ = constellation_.at(stamp);
    sky_stamp_ = stamp;
  }
  const Point2 here{p_map_antenna.x(), p_map_antenna.y()};
  const auto episode =
      static_cast<std::uint64_t>(std::llround(std::floor(toSeconds(stamp) / kDecision_s)));
  const std::uint64_t receive_seed = derivedSeed(seed_, "gnss reception", episode);
  const std::uint64_t detour_seed = derivedSeed(seed_, "gnss detour");
  std::vector<Range> ranges;
  corrections_seen_ = false;
  const bool indoors = geometry_.distanceToRoofs(here) < 0.0;
  for (std::size_t i = 0; i < sky_.size(); ++i) {
    const SkyPosition& satellite = sky_[i];
    if (satellite.elevation_rad < params_.mask_rad) continue;
    const SkyPath path =
        geometry_.skyPath(moment, p_map_antenna, satellite.azimuth_rad, satellite.elevation_rad);
    if (satellite.geostationary) {
      corrections_seen_ = path.clear();
      continue;  // brings corrections, no range
    }
    Range range;
    range.in_view = path.clear();
    if (!range.in_view) {
      // A roof seen from outside is a part of the wall below it; a wall seen from indoors lets no
      // more through than the roof does.
      double share = 1.0;
      if (path.wall || path.roof) share *= indoors ? params_.roof_share : params_.wall_share;
      if (path.glass) share *= params_.glass_share;
      if (path.foliage) share *= params_.foliage_share;
      const double lot = placeUniform(receive_seed, static_cast<int>(i), here, kDecisionCell_m);
      if (lot >= share) continue;
      if (path.wall || path.roof) {
        // A smooth normal of the place, turned into an exponential of the stated mean.
        const double z = placeNoise(detour_seed, static_cast<int>(i), here, params_.nlos_length_m);
        range.bias_m = -params_.nlos_bias_m * std::log(0.5 * std::erfc(z / std::sqrt(2.0)));
      }
    }
    const double sine = std::sin(satellite.elevation_rad);
    const double cosine = std::cos(satellite.elevation_rad);
    range.row = {
        -cosine * std::cos(satellite.azimuth_rad),
        -cosine * std::sin(satellite.azimuth_rad),
        -sine,
        1.0};
    range.white_m = params_.range_white_m / sine * (range.in_view ? 1.0 : kReflectionNoise);
    range.slow_m = params_.range_slow_m / sine;
    range.slow_unit = slow_[i];
    range.satellite = i;
    range.receiver_m = std::hypot(params_.range_white_m, params_.range_slow_m) / sine;
    ranges.push_back(range);
  }
  return ranges;
}

GnssFixType GnssModel::typeNow(Timestamp stamp, int in_view, int used, bool corrections) {
  const auto hold = [&](std::optional<Timestamp>& since, bool condition, double converged_s) {
    if (!condition) {
      since.reset();
    } else if (!since) {
      // A receiver that starts in the open has converged before the drive began.
      since = index_ == 0 ? stamp - durationFromSeconds(converged_s) : stamp;
    }
  };
  const auto lasted = [&](const std::optional<Timestamp>& since, double needed_s) {
    return since && toSeconds(stamp - *since) >= needed_s - 1e-9;
  };
  if (used < kMinUsed) {
    had_sky_ = false;
    sbas_since_.reset();
    float_since_.reset();
    fixed_since_.reset();
    is_fixed_ = false;
    return GnssFixType::kNone;
  }
  if (!had_sky_) {
    had_sky_ = true;
    RandomStream random(seed_, "gnss first fix", sky_losses_++);
    first_fix_ = stamp + durationFromSeconds(
                             random.uniform(params_.min_first_fix_s, params_.max_first_fix_s));
  }
  if (stamp < first_fix_) return GnssFixType::kNone;
  hold(sbas_since_, in_view >= kSbasNeeds && corrections, kSbasAfter_s);
  hold(float_since_, in_view >= kFloatNeeds, kFloatAfter_s);
  hold(fixed_since_, in_view >= kFixedNeeds, kFixedAfter_s);
  if (params_.receiver == GnssClass::kRtk) {
    const bool fixed = lasted(fixed_since_, kFixedAfter_s);
    if (fixed && !is_fixed_) {
      RandomStream random(seed_, "gnss integers", fixes_solved_++);
      wrong_fix_m_.setZero();
      const bool wrong = random.bernoulli(params_.wrong_fix_share) && index_ > 0;
      const double angle_rad = random.uniform(0.0, 2.0 * kPi);
      const double size_m = random.uniform(0.2, 0.5);
      if (wrong) {
        wrong_fix_m_ = {size_m * std::cos(angle_rad), size_m * std::sin(angle_rad), size_m};
      }
    }
    is_fixed_ = fixed;
    if (fixed) return GnssFixType::kRtkFixed;
    if (lasted(float_since_, kFloatAfter_s)) return GnssFixType::kRtkFloat;
  }
  if (params_.receiver != GnssClass::kSingle && lasted(sbas_since_, kSbasAfter_s)) {
    return GnssFixType::kDifferential;
  }
  return GnssFixType::kSingle;
}

GnssVelocity GnssModel::velocityNow(
    Timestamp stamp,
    const std::vector<Range>& ranges,
    const Eigen::Matrix4d& gain_q,
    const Eigen::Vector3d& v_map_antenna) {
  // A stream of its own, by satellite: what is in view must not shift it.
  RandomStream random(seed_, "gnss rate", index_);
  std::vector<double> white(rate_slow_.size());
  const double keep = std::exp(-1.0 / (params_.rate_hz * kRateSlow_s));
  for (std::size_t i = 0; i < white.size(); ++i) {
    white[i] = random.normal();
    rate_slow_[i] = keep * rate_slow_[i] + std::sqrt(1.0 - keep * keep) * random.normal();
  }
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  Eigen::Matrix4d spread = Eigen::Matrix4d::Zero();
  std::map<std::size_t, Detour> detours;
  for (const Range& range : ranges) {
    const double longer =
        range.receiver_m / std::hypot(params_.range_white_m, params_.range_slow_m);
    const double noise = range.in_view ? 1.0 : kReflectionNoise;
    double rate_mps = longer * (noise * params_.rate_white_mps * white[range.satellite] +
                                params_.rate_slow_mps * rate_slow_[range.satellite]);
    if (range.bias_m != 0.0) {
      const auto before = detours_.find(range.satellite);
      if (before != detours_.end() && stamp > before->second.stamp) {
        rate_mps +=
            (range.bias_m - before->second.bias_m) / toSeconds(stamp - before->second.stamp);
      }
      detours[range.satellite] = {stamp, range.bias_m};
    }
    const double weight = 1.0 / (range.receiver_m * range.receiver_m);
    right += weight * rate_mps * range.row;
    const double claimed_mps = longer * std::hypot(params_.rate_white_mps, params_.rate_slow_mps);
    spread += weight * weight * claimed_mps * claimed_mps * range.row * range.row.transpose();
  }
  detours_ = std::move(detours);
  GnssVelocity velocity;
  velocity.enu_mps = v_map_antenna + (gain_q * right).head<3>();
  const Eigen::Matrix4d cov = gain_q * spread * gain_q;
  velocity.sigma_mps = std::sqrt(0.5 * (cov(0, 0) + cov(1, 1)));
  return velocity;
}

GnssFix GnssModel::measure(
    Timestamp stamp,
    const Moment& moment,
    const Eigen::Vector3d& p_map_antenna,
    const Eigen::Vector3d& v_map_antenna) {
  ageErrors();
  std::vector<Range> ranges = rangesNow(stamp, moment, p_map_antenna);
  if (blocked_) ranges.clear();
  GnssFix fix;
  fix.stamp = stamp;
  const auto in_view = static_cast<int>(
      std::count_if(ranges.begin(), ranges.end(), [](const Range& r) { return r.in_view; }));
  fix.type = typeNow(stamp, in_view, static_cast<int>(ranges.size()), corrections_seen_);
  RandomStream random(seed_, "gnss white", index_++);
  truth_ = {};
  const double slow_share = fix.type == GnssFixType::kDifferential ? kSbasSlow : 1.0;
  std::vector<double> errors;
  for (Range& range : ranges) {
    range.slow_m *= slow_share;
    errors.push_back(
        range.bias_m + range.slow_m * range.slow_unit + range.white_m * random.normal());
  }

  const auto solve = [&] {
    Solution solution;
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      const double weight = 1.0 / (ranges[i].receiver_m * ranges[i].receiver_m);
      normal += weight * ranges[i].row * ranges[i].row.transpose();
      right += weight * errors[i] * ranges[i].row;
    }
    const Eigen::FullPivLU<Eigen::Matrix4d> lu(normal);
    solution.ok =
        static_cast<int>(ranges.size()) >= kMinUsed && lu.isInvertible() && lu.rcond() > 1e-6;
    if (!solution.ok) return solution;
    solution.gain_q = lu.inverse();
    solution.x = solution.gain_q * right;
    return solution;
  };
  Solution solution = solve();
  for (int left_out = 0; params_.raim && solution.ok && left_out < kRaimMost; ++left_out) {
    if (static_cast<int>(ranges.size()) <= kMinUsed + 1) break;
    std::size_t worst = 0;
    double worst_ratio = 0.0;
    for (std::size_t i = 0; i < ranges.size(); ++i) {
      const double residual = errors[i] - ranges[i].row.dot(solution.x);
      const double ratio = std::abs(residual) / ranges[i].receiver_m;
      if (ratio > worst_ratio) {
        worst_ratio = ratio;
        worst = i;
      }
    }
    if (worst_ratio < kRaimLimit) break;
    ranges.erase(ranges.begin() + static_cast<std::ptrdiff_t>(worst));
    errors.erase(errors.begin() + static_cast<std::ptrdiff_t>(worst));
    solution = solve();
  }

  fix.satellites = static_cast<int>(ranges.size());
  if (!solution.ok || fix.type == GnssFixType::kNone) {
    fix.type = GnssFixType::kNone;
    fix.position = last_position_;
    return fix;
  }
  // Dilution of precision: the geometry alone, every range alike.
  Eigen::Matrix4d geometry_normal = Eigen::Matrix4d::Zero();
  Eigen::Vector3d reflections = Eigen::Vector3d::Zero();
  for (const Range& range : ranges) {
    (range.in_view ? truth_.in_view : truth_.reflected) += 1;
    geometry_normal += range.row * range.row.transpose();
    const Eigen::Vector4d gain =
        solution.gain_q * range.row / (range.receiver_m * range.receiver_m);
    const Eigen::Vector3d g = gain.head<3>();
    reflections += range.bias_m * g;
    truth_.white_cov_enu += range.white_m * range.white_m * g * g.transpose();
    truth_.slow_cov_enu += range.slow_m * range.slow_m * g * g.transpose();
  }
  const Eigen::Matrix4d dop = geometry_normal.inverse();
  const double hdop = std::sqrt(dop(0, 0) + dop(1, 1));
  if (!(hdop < kWorstHdop)) {
    fix.type = GnssFixType::kNone;
    fix.position = last_position_;
    return fix;
  }
  fix.hdop = hdop;
  // The receiver believes that every range is as good as its own table says.
  const double corrected = std::hypot(params_.range_white_m, slow_share * params_.range_slow_m) /
                           std::hypot(params_.range_white_m, params_.range_slow_m);
  Eigen::Matrix3d claimed = solution.gain_q.topLeftCorner<3, 3>() * corrected * corrected;
  Eigen::Vector3d error = smoothed(stamp, solution.x.head<3>());
  if (fix.type == GnssFixType::kRtkFloat || fix.type == GnssFixType::kRtkFixed) {
    const bool fixed = fix.type == GnssFixType::kRtkFixed;
    const double slow_m = fixed ? params_.fixed_sigma_m : params_.float_sigma_m;
    const double white_m = fixed ? params_.fixed_sigma_m : kFloatWhite_m;
    // Reflections reach the carrier phase by a few per cent of what they do to the code.
    const double reflected = fixed ? 0.003 : 0.1;
    error = slow_m * carrier_slow_ + reflected * reflections;
    for (int axis = 0; axis < 3; ++axis) error[axis] += white_m * random.normal();
    error.z() *= kVerticalRatio;
    if (fixed) error += wrong_fix_m_;
    const Eigen::Vector3d axes(1.0, 1.0, kVerticalRatio * kVerticalRatio);
    claimed = ((slow_m * slow_m + white_m * white_m) * axes).asDiagonal();
    truth_.white_cov_enu = (white_m * white_m * axes).asDiagonal();
    truth_.slow_cov_enu = (slow_m * slow_m * axes).asDiagonal();
  }
  error += offset_m_;
  truth_.error_enu_m = error;
  fix.velocity = velocityNow(stamp, ranges, solution.gain_q, v_map_antenna);
  fix.cov_enu = Eigen::Matrix3d(claimed.diagonal().asDiagonal());
  last_position_ = plane_.toGeodetic(p_map_antenna + error);
  fix.position = last_position_;
  return fix;
}

}  // namespace vestibule::sim
