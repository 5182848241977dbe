#include "geo_hints.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "matchers.hpp"
#include "vestibule/grid/ray_caster.hpp"
#include "vestibule/pipeline/gnss_input.hpp"

namespace vestibule::pipeline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kWidth_m = 8.0;
constexpr double kHeight_m = 5.0;
constexpr double kResolution = 0.05;

/// An empty room: seen from within it looks the same turned by half a turn about its centre.
std::shared_ptr<const grid::OccupancyMap> emptyRoom() {
  const auto width = static_cast<int>(std::lround(kWidth_m / kResolution));
  const auto height = static_cast<int>(std::lround(kHeight_m / kResolution));
  std::vector<grid::Cell> cells;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool wall = x == 0 || y == 0 || x == width - 1 || y == height - 1;
      cells.push_back(wall ? grid::Cell::kOccupied : grid::Cell::kFree);
    }
  }
  return std::make_shared<const grid::OccupancyMap>(
      grid::OccupancyMap::fromCells(width, height, kResolution, {0, 0}, cells));
}

/// A robot that drives 2 m along the room, with a receiver and a compass.
class GeoHintsInRoom : public testing::Test, public Observer {
 protected:
  void SetUp() override {
    observers_.attach(*this);
    config_.amcl.global.search.threads = 1;
    georeference_.datum = {46.5, 9.8, 1800.0};
    georeference_.T_map_grid = {120.0, -40.0, degToRad(30.0)};
    georeference_.cov = Eigen::Vector3d(0.01, 0.01, 1e-4).asDiagonal();
  }
  void onWarning(const WarningEvent& event) override { warnings_.push_back(event.text); }

  [[nodiscard]] Pose2 truth() const { return {1.5 + 0.1 * steps_, 1.5, 0.0}; }

  [[nodiscard]] GnssFix fixAt(GnssFixType type, const Point2& p_map) const {
    const Point2 p_enu = transform(georeference_.T_map_grid, p_map);
    GnssFix fix;
    fix.type = type;
    fix.position = geo::TangentPlane(georeference_.datum).toGeodetic({p_enu.x, p_enu.y, 0.0});
    return fix;
  }
  [[nodiscard]] GnssFix fixOffBy(GnssFixType type, const Point2& off_m = {0.0, 0.0}) const {
    const Point2 p = transform(truth(), p_base_antenna_);
    return fixAt(type, {p.x + off_m.x, p.y + off_m.y});
  }

  /// Drives and hands over what `measured` gives at every step.
  template <class Measured>
  void drive(Measured measured, bool georeferenced = true) {
    const std::optional<io::MapGeoreference> georeference =
        georeferenced ? std::make_optional(georeference_) : std::nullopt;
    hints_.emplace(config_, *map_, georeference, observers_);
    localizer_.emplace(config_.amcl, map_, 3);
    steps_ = 0;
    if (start_told_) {
      localizer_->startAt({truth(), Eigen::Vector3d(0.01, 0.01, 0.001).asDiagonal()});
    } else {
      localizer_->startAnywhere();
    }
    const grid::RayCaster rays(*map_);
    for (; steps_ <= 20; ++steps_) {
      if (steps_ > 0) {
        WheelOdometry wheels;
        wheels.stamp = timestampFromSeconds(0.2 * steps_);
        wheels.dt_s = 0.2;
        wheels.T_previous_now.x = 0.1;
        localizer_->process(wheels);
      }
      hand(measured());
      LaserScan scan;
      scan.stamp = timestampFromSeconds(0.2 * steps_);
      scan.angle_min_rad = -0.5 * kPi;
      scan.angle_step_rad = kPi / 180.0;
      scan.range_min_m = 0.05;
      scan.range_max_m = 20.0;
      for (std::size_t i = 0; i <= 180; ++i) {
        const Pose2 T = truth();
        scan.ranges_m.push_back(static_cast<float>(rays.range({T.x, T.y}, scan.angle(i), 20.0)));
      }
      localizer_->process(scan);
    }
    --steps_;
  }
  void hand(const GnssFix& fix) { hints_->process(fix, p_base_antenna_, *localizer_); }
  void hand(const Heading& heading) { hints_->process(heading, *localizer_); }

  void expectFound() const {
    EXPECT_EQ(localizer_->state(), amcl::PlaceState::kSure);
    EXPECT_THAT(localizer_->pose().mean, poseNear(truth(), 0.1, 0.05));
  }
  void expectUnsure() const {
    EXPECT_EQ(localizer_->state(), amcl::PlaceState::kUnsure);
    EXPECT_THAT(localizer_->places(), testing::SizeIs(testing::Ge(2U)));
  }

  std::shared_ptr<const grid::OccupancyMap> map_ = emptyRoom();
  Config config_;
  io::MapGeoreference georeference_;
  Point2 p_base_antenna_{-0.4, 0.3};
  bool start_told_ = false;
  Observers observers_;
  std::vector<std::string> warnings_;
  std::optional<GeoHints> hints_;
  std::optional<amcl::Localizer> localizer_;
  int steps_ = 0;
};

TEST_F(GeoHintsInRoom, ACarrierPhaseFixTellsWhichWayRoundItIs) {
  drive([&] { return fixOffBy(GnssFixType::kRtkFixed); });

  expectFound();
  EXPECT_GT(hints_->use().fixes_in_search, 2U);
  EXPECT_EQ(hints_->use().fixes_in_weights, 0U);
  EXPECT_THAT(hints_->notes(), IsEmpty());
}

TEST_F(GeoHintsInRoom, ACodeFixThatIsThirtyMetresOffDoesNot) {
  // Off towards the place that looks the same.
  drive([&] { return fixOffBy(GnssFixType::kSingle, {25.0, 16.0}); });

  expectUnsure();
  EXPECT_GT(hints_->use().fixes_in_search, 2U);
}

TEST_F(GeoHintsInRoom, WithoutAGeoreferenceFixesAreNotedAndNotUsed) {
  drive([&] { return fixOffBy(GnssFixType::kRtkFixed); }, false);

  expectUnsure();
  EXPECT_EQ(hints_->use().fixes, 21U);
  EXPECT_EQ(hints_->use().fixes_in_search, 0U);
  EXPECT_THAT(
      hints_->notes(), ElementsAre(HasSubstr("the map has no georeference: 21 fixes not used")));
}

TEST_F(GeoHintsInRoom, FixesOfAnotherPlaceAreToldOnceAndNotUsed) {
  config_.amcl.gnss.enabled = true;
  drive([&] { return fixOffBy(GnssFixType::kRtkFixed, {5000.0, 0.0}); });

  expectUnsure();
  EXPECT_EQ(hints_->use().fixes_far, 21U);
  EXPECT_EQ(hints_->use().fixes_in_search, 0U);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("far from the map")));
  EXPECT_THAT(
      hints_->notes(),
      ElementsAre(testing::ContainsRegex("fixes are 49[0-9][0-9] m from the map: 21 not used")));
}

TEST_F(GeoHintsInRoom, FixesThatAreNoneOrInMetresOfTheirOwnDoNotCount) {
  drive([&] {
    GnssFix fix = fixOffBy(GnssFixType::kRtkFixed);
    if (steps_ % 2 == 0) {
      fix.type = GnssFixType::kNone;
    } else {
      fix.position = LocalPosition{truth().x, truth().y, 0.0};
    }
    return fix;
  });

  expectUnsure();
  EXPECT_EQ(hints_->use().fixes, 10U);
  EXPECT_THAT(hints_->notes(), ElementsAre(HasSubstr("10 fixes in metres of the recording's own")));
}

TEST_F(GeoHintsInRoom, ACalibratedCompassTellsWhichWayRoundItIs) {
  drive([&] {
    Heading heading;
    heading.yaw_rad = truth().phi + georeference_.T_map_grid.phi + degToRad(10.0);
    heading.offset_sigma_rad = degToRad(3.0);
    return heading;
  });

  expectFound();
  EXPECT_GT(hints_->use().headings_in_search, 2U);
}

TEST_F(GeoHintsInRoom, ACompassThatNobodyHasCalibratedDoesNot) {
  const auto heading = [&] {
    Heading h;
    h.yaw_rad = truth().phi + georeference_.T_map_grid.phi;
    return h;
  };
  drive(heading);
  expectUnsure();
  EXPECT_EQ(hints_->use().headings_in_search, 0U);
  EXPECT_THAT(hints_->notes(), ElementsAre(HasSubstr("21 headings not used: not calibrated")));

  config_.ekf.init.trust_heading = true;
  drive(heading);
  expectFound();
}

TEST_F(GeoHintsInRoom, TheConfigurationSwitchesThemOff) {
  config_.amcl.gnss.in_search = false;
  drive([&] { return fixOffBy(GnssFixType::kRtkFixed); });

  expectUnsure();
  EXPECT_EQ(hints_->use().fixes_in_search, 0U);
}

TEST_F(GeoHintsInRoom, WhileItTracksFixesWeighTheParticlesWhereConfigured) {
  start_told_ = true;
  drive([&] { return fixOffBy(GnssFixType::kRtkFixed); });
  EXPECT_EQ(hints_->use().fixes_in_weights, 0U);

  config_.amcl.gnss.enabled = true;
  drive([&] { return fixOffBy(GnssFixType::kRtkFixed); });
  expectFound();
  EXPECT_EQ(hints_->use().fixes_in_weights, 21U);
  EXPECT_EQ(hints_->use().fixes_in_search, 0U);
}

TEST(GnssInput, TheLeverArmIsTakenOffAsTheRobotFaces) {
  const Pose2 T_map_base{4.0, 2.0, 0.5 * kPi};
  const Point2 lever{-0.4, 0.3};
  const Point2 p = baseInMap(transform(T_map_base, lever), T_map_base, lever);

  EXPECT_NEAR(p.x, 4.0, 1e-12);
  EXPECT_NEAR(p.y, 2.0, 1e-12);
}

TEST(GnssInput, AFixIsWorthWhatTheReceiverClaimsOrItsType) {
  GnssFix fix;
  fix.type = GnssFixType::kRtkFloat;
  const ekf::GnssParams params;
  EXPECT_EQ(claimedSigma(fix, params), params.sigma_rtk_float_m);
  fix.cov_enu = Eigen::Matrix3d(Eigen::Vector3d(9.0, 7.0, 1.0).asDiagonal());
  EXPECT_NEAR(claimedSigma(fix, params), std::sqrt(8.0), 1e-12);
}

}  // namespace
}  // namespace vestibule::pipeline
