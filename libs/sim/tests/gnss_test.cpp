#include "vestibule/sim/gnss.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "moments.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/sim/world.hpp"

namespace vestibule::sim {
namespace {

const Geodetic kDatum{36.8, -2.4, 20.0};
Timestamp at(double seconds) { return timestampFromSeconds(1.7e9) + durationFromSeconds(seconds); }

TEST(Constellation, HasAPlausibleSkyEverywhere) {
  for (const double lat_deg : {0.0, 37.0, 60.0}) {
    const Constellation sky({lat_deg, 10.0, 0.0}, 4);
    Moments visible;
    for (int minute = 0; minute < 720; minute += 10) {
      int above = 0;
      for (const SkyPosition& s : sky.at(at(60.0 * minute))) {
        above += !s.geostationary && s.elevation_rad > degToRad(10.0) ? 1 : 0;
      }
      EXPECT_GE(above, 14) << "latitude " << lat_deg << ", minute " << minute;
      visible.add(above);
    }
    EXPECT_GT(visible.mean(), 18.0);
    EXPECT_LT(visible.mean(), 32.0);
  }
  // The geostationary satellite stands in the south, at atan((cos lat - R/r) / sin lat) or so.
  const SkyPosition fixed = Constellation(kDatum, 4).at(at(0)).back();
  EXPECT_TRUE(fixed.geostationary);
  EXPECT_NEAR(fixed.azimuth_rad, -kPi / 2.0, 1e-9);
  EXPECT_NEAR(radToDeg(fixed.elevation_rad), 47.0, 1.0);
}

class Gnss : public ::testing::Test {
 protected:
  Gnss() {
    World world;
    world.datum = kDatum;
    // A barn with walls of 10 m under a roof, open to nowhere.
    world.walls.push_back({"", {{0, 0}, {30, 0}, {30, 14}, {0, 14}}, true, 10.0});
    Building barn{{"barn", {{0, 0}, {30, 0}, {30, 14}, {0, 14}}}, true, 10.0, {}};
    world.buildings.push_back(barn);
    geometry_ = std::make_unique<WorldGeometry>(world);
  }
  [[nodiscard]] GnssModel receiver(const GnssParams& params, std::uint64_t seed) const {
    return {*geometry_, kDatum, params, seed};
  }
  [[nodiscard]] static Eigen::Vector3d errorOf(const GnssFix& fix, const Eigen::Vector3d& p_map) {
    return geo::TangentPlane(kDatum).toEnu(std::get<Geodetic>(fix.position)) - p_map;
  }
  std::unique_ptr<WorldGeometry> geometry_;
  const Eigen::Vector3d open_{-200, 0, 1};
};

// 600 receivers: sigma within 14 % at 5 sigma.

TEST_F(Gnss, IsAsGoodAsItSaysInTheOpen) {
  for (const GnssClass kind : {GnssClass::kRtk, GnssClass::kSingle}) {
    GnssParams params;
    params.receiver = kind;
    Moments error;
    Moments claimed;
    Moments normalised;
    for (std::uint64_t seed = 0; seed < 600; ++seed) {
      GnssModel gnss = receiver(params, seed);
      const GnssFix fix = gnss.measure(at(0), {}, open_);
      EXPECT_EQ(fix.type, kind == GnssClass::kRtk ? GnssFixType::kRtkFixed : GnssFixType::kSingle);
      EXPECT_GE(*fix.satellites, 14);
      EXPECT_LT(*fix.hdop, 1.2);
      const double sigma_m = std::sqrt((*fix.cov_enu)(0, 0));
      error.add(errorOf(fix, open_).x());
      claimed.add(sigma_m);
      normalised.add(errorOf(fix, open_).x() / sigma_m);
      EXPECT_NEAR((errorOf(fix, open_) - gnss.truth().error_enu_m).norm(), 0.0, 1e-6);
    }
    EXPECT_NEAR(error.mean(), 0.0, 5.0 * error.sigma() / std::sqrt(600.0));
    EXPECT_NEAR(normalised.rms(), 1.0, 0.14);
    if (kind == GnssClass::kRtk) {
      EXPECT_NEAR(error.sigma(), 0.0198, 0.14 * 0.0198);
    } else {
      EXPECT_GT(error.sigma(), 0.8);
      EXPECT_LT(error.sigma(), 1.8);
    }
  }
}

TEST_F(Gnss, TheSlowErrorKeepsItsCorrelationTime) {
  GnssParams params;
  params.receiver = GnssClass::kSingle;
  params.range_white_m = 1e-6;
  Moments now;
  Moments lagged;
  Moments predicted;
  for (std::uint64_t seed = 0; seed < 600; ++seed) {
    GnssModel gnss = receiver(params, seed);
    const double before = errorOf(gnss.measure(at(0), {}, open_), open_).x();
    predicted.add(gnss.truth().slow_cov_enu(0, 0));
    GnssFix fix;
    for (int i = 1; i <= 300; ++i) fix = gnss.measure(at(0.2 * i), {}, open_);
    now.add(before * before);
    lagged.add(before * errorOf(fix, open_).x());
  }
  // 60 s later exp(-0.5) of the correlation is left; 600 samples: 5 sigma = 0.2 (and 0.29 of the
  // variance itself).
  EXPECT_NEAR(lagged.mean() / now.mean(), std::exp(-0.5), 0.2);
  EXPECT_NEAR(now.mean() / predicted.mean(), 1.0, 0.29);
}

TEST_F(Gnss, WandersBesideAWallAndClaimsToBeGood) {
  GnssParams params;
  params.receiver = GnssClass::kSingle;
  std::vector<double> errors;
  std::vector<double> claims;
  Moments wandering;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    // Up and down a wall of 10 m, 1 m from it, at walking pace.
    GnssModel gnss = receiver(params, seed);
    Moments east;
    Moments north;
    for (int i = 0; i < 240; ++i) {
      const double y = 1.0 + 12.0 * std::abs(1.0 - std::fmod(0.2 * i / 12.0, 2.0));
      const Eigen::Vector3d p(-1.0, y, 1.0);
      const GnssFix fix = gnss.measure(at(0.2 * i), {}, p);
      if (fix.type == GnssFixType::kNone) continue;
      const Eigen::Vector3d error = errorOf(fix, p);
      errors.push_back(error.head<2>().norm());
      claims.push_back(std::sqrt(fix.cov_enu->topLeftCorner<2, 2>().trace()));
      east.add(error.x());
      north.add(error.y());
    }
    if (east.n > 0) wandering.add(std::hypot(east.sigma(), north.sigma()));
  }
  ASSERT_GT(errors.size(), 20000U);
  const auto median = [](std::vector<double>& values) {
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
  };
  const double claimed_m = median(claims);
  EXPECT_LT(claimed_m, 4.0);
  EXPECT_GT(median(errors), 1.5 * claimed_m) << "claimed " << claimed_m;
  EXPECT_GT(wandering.mean(), 1.5) << "[m] about its mean, within one walk";
}

TEST_F(Gnss, TheReceiversOwnFilterTakesTheNoiseOutOfCodeFixes) {
  GnssParams params;
  params.receiver = GnssClass::kSingle;
  params.range_slow_m = 1e-6;
  const auto noise = [&](double smoothing_s) {
    params.smoothing_s = smoothing_s;
    GnssModel gnss = receiver(params, 7);
    Moments east;
    for (int i = 0; i < 20000; ++i) {
      const double error_m = errorOf(gnss.measure(at(0.2 * i), {}, open_), open_).x();
      if (i > 100) east.add(error_m);
    }
    return east.sigma();
  };
  // First order: the variance of white noise shrinks by (1 - k) / (1 + k), k = exp(-dt / tau).
  const double keep = std::exp(-0.2 / 3.0);
  EXPECT_NEAR(noise(3.0) / noise(0.0), std::sqrt((1.0 - keep) / (1.0 + keep)), 0.02);
}

TEST_F(Gnss, VelocityIsAsGoodAsItSaysInTheOpenAndDisturbsNothing) {
  GnssParams params;
  const Eigen::Vector3d v(0.6, -0.8, 0.0);
  GnssModel gnss = receiver(params, 5);
  GnssModel standing = receiver(params, 5);
  Moments ratio;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i = 0; i < 3000; ++i) {
    const Moment moment;
    const GnssFix fix = gnss.measure(at(0.2 * i), moment, open_, v);
    const GnssFix other = standing.measure(at(0.2 * i), moment, open_);
    ASSERT_TRUE(fix.velocity && fix.velocity->sigma_mps);
    const Eigen::Vector3d error = fix.velocity->enu_mps - v;
    // The velocity is one more output: the position, its noise included, is what it was.
    ASSERT_EQ(errorOf(fix, open_), errorOf(other, open_));
    ratio.add(0.5 * error.head<2>().squaredNorm() / std::pow(*fix.velocity->sigma_mps, 2));
    sum += error;
  }
  EXPECT_GT(ratio.mean(), 0.8);
  EXPECT_LT(ratio.mean(), 1.25);
  EXPECT_LT(sum.norm() / 3000, 0.01);
}

TEST_F(Gnss, ReflectionsBendTheVelocityAsTheDetourChanges) {
  // Beside the barn, driving along it: worse than the receiver thinks.
  GnssParams params;
  GnssModel gnss = receiver(params, 6);
  Moments ratio;
  for (int i = 0; i < 600; ++i) {
    const Eigen::Vector3d p(-5.0 + 0.04 * i, -1.0, 1.0);
    const GnssFix fix = gnss.measure(at(0.2 * i), Moment{}, p, {0.2, 0, 0});
    if (fix.type == GnssFixType::kNone || !fix.velocity) continue;
    const Eigen::Vector2d error = fix.velocity->enu_mps.head<2>() - Eigen::Vector2d(0.2, 0.0);
    ratio.add(0.5 * error.squaredNorm() / std::pow(*fix.velocity->sigma_mps, 2));
  }
  EXPECT_GT(ratio.mean(), 1.5);
}

TEST_F(Gnss, ReflectionsAreAFunctionOfPlace) {
  GnssParams params;
  params.receiver = GnssClass::kSingle;
  params.range_white_m = params.range_slow_m = 1e-6;
  params.wall_share = 1.0;
  params.raim = false;
  params.smoothing_s = 0.0;
  GnssModel gnss = receiver(params, 4);
  const Eigen::Vector3d p(-1, 3, 1);
  const Eigen::Vector3d first = errorOf(gnss.measure(at(0), {}, p), p);
  (void)gnss.measure(at(0.2), {}, {-1, 11, 1});
  const Eigen::Vector3d again = errorOf(gnss.measure(at(0.4), {}, p), p);
  EXPECT_GT(first.head<2>().norm(), 0.5);
  EXPECT_NEAR((first - again).norm(), 0.0, 1e-3);
}

TEST_F(Gnss, IsBlindUnderARoofOrWrongAsConfigured) {
  const Eigen::Vector3d inside(15, 7, 1);
  GnssParams params;
  params.roof_share = 0.0;
  GnssModel blind = receiver(params, 1);
  params.roof_share = 0.8;
  params.wall_share = 0.8;
  GnssModel fooled = receiver(params, 1);
  int fixes = 0;
  Moments error;
  for (int i = 0; i < 1000; ++i) {
    const GnssFix none = blind.measure(at(0.2 * i), {}, inside);
    EXPECT_EQ(none.type, GnssFixType::kNone);
    EXPECT_FALSE(none.cov_enu.has_value());
    const GnssFix wild = fooled.measure(at(0.2 * i), {}, inside);
    if (wild.type == GnssFixType::kNone) continue;
    ++fixes;
    EXPECT_EQ(wild.type, GnssFixType::kSingle);
    error.add(errorOf(wild, inside).head<2>().norm());
  }
  EXPECT_GT(fixes, 500);
  EXPECT_GT(error.rms(), 4.0);
}

TEST_F(Gnss, NeedsTimeAfterTheRoof) {
  GnssParams params;
  params.roof_share = 0.0;
  int wrong = 0;
  int fixed = 0;
  params.wrong_fix_share = 0.25;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    GnssModel gnss = receiver(params, seed);
    for (int i = 0; i < 10; ++i) (void)gnss.measure(at(0.2 * i), {}, {15, 7, 1});
    double first_s = -1.0;
    double float_s = -1.0;
    double fixed_s = -1.0;
    for (int i = 0; i < 80; ++i) {
      const GnssFix fix = gnss.measure(at(2.0 + 0.2 * i), {}, open_);
      const double after_s = 0.2 * i;
      if (fix.type != GnssFixType::kNone && first_s < 0) first_s = after_s;
      if (fix.type == GnssFixType::kRtkFloat && float_s < 0) float_s = after_s;
      if (fix.type != GnssFixType::kRtkFixed) continue;
      if (fixed_s >= 0) continue;
      fixed_s = after_s;
      ++fixed;
      const double off_m = errorOf(fix, open_).head<2>().norm();
      if (off_m > 0.15) {
        ++wrong;
        EXPECT_GT(off_m, 0.2 - 0.1);
        EXPECT_LT(off_m, 0.5 + 0.1);
      }
    }
    EXPECT_GE(first_s, 1.0) << "seed " << seed;
    EXPECT_LE(first_s, 5.2) << "seed " << seed;
    EXPECT_NEAR(float_s - first_s, 2.0, 0.21) << "seed " << seed;
    EXPECT_NEAR(fixed_s - first_s, 6.0, 0.21) << "seed " << seed;
  }
  // 200 draws: 5 sigma = 0.15.
  EXPECT_NEAR(static_cast<double>(wrong) / fixed, 0.25, 0.15);
}

TEST_F(Gnss, CorrectionsNeedTheGeostationarySatellite) {
  GnssParams params;
  params.receiver = GnssClass::kSbas;
  GnssModel gnss = receiver(params, 2);
  EXPECT_EQ(gnss.measure(at(0), {}, open_).type, GnssFixType::kDifferential);
  // North of the barn its southern sky is hidden up to 47 deg.
  GnssFix fix;
  for (int i = 1; i < 50; ++i) fix = gnss.measure(at(0.2 * i), {}, {15, 16, 1});
  EXPECT_EQ(fix.type, GnssFixType::kSingle);
}

TEST_F(Gnss, CanBeDisturbed) {
  GnssModel gnss = receiver({}, 2);
  gnss.disturb({700, 0, 0}, false);
  EXPECT_NEAR(errorOf(gnss.measure(at(0), {}, open_), open_).x(), 700.0, 0.2);
  gnss.disturb({0, 0, 0}, true);
  EXPECT_EQ(gnss.measure(at(0.2), {}, open_).type, GnssFixType::kNone);
}

}  // namespace
}  // namespace vestibule::sim
