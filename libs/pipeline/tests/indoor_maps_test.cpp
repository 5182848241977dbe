#include "vestibule/pipeline/indoor_maps.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "matchers.hpp"
#include "room_map.hpp"
#include "test_files.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/grid/ray_caster.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/pipeline/seamless_estimator.hpp"

namespace vestibule::pipeline {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kWidth_m = 12.0;
constexpr double kHeight_m = 8.0;

/// Remembers maps that came and went and what was warned of.
class Log : public Observer {
 public:
  void onMap(const MapEvent& event) override {
    maps.push_back(std::string(toString(event.kind)) + " " + event.map);
    events.push_back(event);
  }
  void onWarning(const WarningEvent& event) override {
    if (event.component == "maps") warnings.push_back(event.text);
  }
  [[nodiscard]] std::vector<std::string> take() { return std::exchange(maps, {}); }

  std::vector<std::string> maps;
  std::vector<MapEvent> events;
  std::vector<std::string> warnings;
};

/// A hall at the origin and a shed 300 m east of it, on disk.
class TwoBuildings : public testing::Test {
 protected:
  TwoBuildings() {
    for (const char* name : {"hall", "shed"}) {
      geo::IndoorMap indoor;
      indoor.name = name;
      indoor.yaml_path = folder_ / (indoor.name + ".yaml");
      io::saveMapServer(
          roomMap(kWidth_m, kHeight_m), indoor.yaml_path, folder_ / (indoor.name + ".pgm"));
      const double x = indoor.name == "hall" ? 0.0 : 300.0;
      indoor.T_map_grid = {x, 0.0, 0.0};
      site_.indoor_maps.push_back(indoor);
      site_.buildings.push_back(
          {name, {{x, 0.0}, {x + kWidth_m, 0.0}, {x + kWidth_m, kHeight_m}, {x, kHeight_m}}});
    }
    site_.datum = {36.7, -4.4, 0.0};
    observers_.attach(log_);
  }

  /// What changes with the robot at this x.
  std::vector<std::string> at(IndoorMaps& maps, double x) {
    maps.update(timestampFromSeconds(++seconds_), {x, 4.0}, localizers_);
    return log_.take();
  }

  test::TempFolder folder_;
  geo::Site site_;
  Log log_;
  Observers observers_;
  amcl::MapLocalizers localizers_{amcl::AmclParams{}, 1};
  double seconds_ = 0.0;
};

TEST_F(TwoBuildings, AreLoadedOnTheWayThereAndUnloadedFarBehind) {
  IndoorMaps maps({50.0, 100.0}, site_, surveyIndoorMaps(site_), observers_);
  EXPECT_THAT(maps.loaded(), IsEmpty()) << "the survey keeps none";
  EXPECT_THAT(at(maps, -60.0), IsEmpty());
  EXPECT_THAT(at(maps, -49.0), ElementsAre("loaded hall"));
  EXPECT_DOUBLE_EQ(log_.events.back().distance_m, 49.0);
  EXPECT_EQ(log_.events.back().stamp, timestampFromSeconds(seconds_));
  EXPECT_THAT(localizers_.names(), ElementsAre("hall"));
  EXPECT_THAT(at(maps, -99.0), IsEmpty()) << "neither near nor far";
  EXPECT_THAT(at(maps, 6.0), IsEmpty()) << "inside";
  EXPECT_THAT(at(maps, kWidth_m + 99.0), IsEmpty());
  EXPECT_THAT(at(maps, kWidth_m + 101.0), ElementsAre("unloaded hall"));
  EXPECT_THAT(localizers_.names(), IsEmpty());
  EXPECT_THAT(at(maps, 251.0), ElementsAre("loaded shed"));
  EXPECT_THAT(at(maps, -40.0), ElementsAre("loaded hall", "unloaded shed"));
}

TEST_F(TwoBuildings, FreeAllMemoryOfAMapButNeverOfTheOneAtWork) {
  IndoorMaps maps({50.0, 100.0}, site_, surveyIndoorMaps(site_), observers_);
  (void)at(maps, 6.0);
  const std::weak_ptr<const grid::OccupancyMap> memory = maps.loaded().front();
  ASSERT_TRUE(localizers_.seed({{6.0, 4.0, 0.0}, 0.01 * Eigen::Matrix3d::Identity()}));
  EXPECT_THAT(at(maps, -150.0), IsEmpty()) << "at work";
  EXPECT_EQ(localizers_.atWork(), "hall");
  localizers_.rest();
  EXPECT_THAT(at(maps, -150.0), ElementsAre("unloaded hall"));
  EXPECT_TRUE(memory.expired()) << "particles and search let go of it, too";
}

TEST_F(TwoBuildings, AreAllRefusedAtTheStartWhenOneIsBroken) {
  std::filesystem::remove(folder_ / "shed.pgm");
  EXPECT_THROW((void)surveyIndoorMaps(site_), InputError);
  std::filesystem::remove(folder_ / "shed.yaml");
  EXPECT_THROW((void)surveyIndoorMaps(site_), ConfigError);
  const auto empty = grid::OccupancyMap::fromCells(1, 1, 0.05, {0, 0}, {grid::Cell::kFree});
  io::saveMapServer(empty, folder_ / "shed.yaml", folder_ / "shed.pgm");
  try {
    (void)surveyIndoorMaps(site_);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("shed.yaml"), HasSubstr("no occupied cell")));
  }
}

TEST_F(TwoBuildings, GoOnWithoutAMapWhoseFileIsGoneSince) {
  IndoorMaps maps({50.0, 100.0}, site_, surveyIndoorMaps(site_), observers_);
  std::filesystem::rename(folder_ / "hall.pgm", folder_ / "gone.pgm");
  EXPECT_THAT(at(maps, -10.0), IsEmpty());
  EXPECT_THAT(at(maps, 0.0), IsEmpty());
  EXPECT_THAT(log_.warnings, ElementsAre(HasSubstr("hall.pgm"))) << "once";
  // It is there again: the next visit finds it.
  std::filesystem::rename(folder_ / "gone.pgm", folder_ / "hall.pgm");
  EXPECT_THAT(at(maps, -101.0), IsEmpty());
  EXPECT_THAT(at(maps, -10.0), ElementsAre("loaded hall"));
}

/// Drives along straight lines in dead reckoning, with scans inside of the hall.
class Drive {
 public:
  Drive(const Config& config, const geo::Site& site, const Observers& observers)
      : estimator_(config, site, surveyIndoorMaps(site), observers) {
    estimator_.start(timestampFromSeconds(0.0), toldStart(truth_));
  }

  /// \return the published poses
  std::vector<Pose2> along(double metres) {
    std::vector<Pose2> published;
    const double step_m = metres < 0.0 ? -kStep_m : kStep_m;
    for (double left = std::abs(metres); left > 0.5 * kStep_m; left -= kStep_m) {
      t_s_ += kStep_s;
      truth_ = compose(truth_, Pose2{step_m, 0.0, 0.0});
      const WheelOdometry wheels{timestampFromSeconds(t_s_), kStep_s, {step_m, 0.0, 0.0}};
      estimator_.process(wheels);
      if (truth_.x > 0.5 && truth_.x < kWidth_m - 0.5) estimator_.process(scan());
      published.push_back(estimator_.modeManager().published().mean);
    }
    return published;
  }
  [[nodiscard]] Mode mode() const { return estimator_.modeManager().mode(); }
  [[nodiscard]] const Pose2& truth() const { return truth_; }

 private:
  static constexpr double kStep_m = 0.1;
  static constexpr double kStep_s = 0.1;

  [[nodiscard]] LaserScan scan() const {
    LaserScan scan;
    scan.stamp = timestampFromSeconds(t_s_);
    scan.angle_min_rad = -0.75 * kPi;
    scan.angle_step_rad = degToRad(1.5);
    scan.range_min_m = 0.05;
    scan.range_max_m = 15.0;
    for (int i = 0; i <= 180; ++i) {
      const double yaw = truth_.phi + scan.angle(static_cast<std::size_t>(i));
      // Walls stand a little before the middle of their cells.
      scan.ranges_m.push_back(
          static_cast<float>(rays_.range({truth_.x, truth_.y}, yaw, 15.0) - 0.03));
    }
    return scan;
  }

  grid::OccupancyMap map_ = roomMap(kWidth_m, kHeight_m);
  grid::RayCaster rays_{map_};
  SeamlessEstimator estimator_;
  Pose2 truth_{1.0, 5.0, 0.0};
  double t_s_ = 0.0;
};

TEST_F(TwoBuildings, GiveTheSamePosesAfterAnUnloadAsIfTheMapHadStayed) {
  // GIVEN a robot that has driven in the hall and drives 35 m away from it and back
  Config config;
  config.mode_manager.zones = {5.0, 3.0, 4.0};
  config.maps = {6.0, 20.0};
  Config keeping = config;
  keeping.maps.unload_beyond_m = 1000.0;
  Drive with_unload(config, site_, observers_);
  const Observers nobody;
  Drive without(keeping, site_, nobody);
  for (Drive* drive : {&with_unload, &without}) {
    (void)drive->along(10.0);
    EXPECT_EQ(drive->mode(), Mode::kIndoor);
    (void)drive->along(-45.0);
    (void)drive->along(30.0);
  }
  EXPECT_THAT(log_.maps, ElementsAre("loaded hall", "unloaded hall", "loaded hall"));
  // WHEN it is in there again THEN all that it publishes is the same
  const std::vector<Pose2> reloaded = with_unload.along(15.0);
  const std::vector<Pose2> kept = without.along(15.0);
  EXPECT_EQ(with_unload.mode(), Mode::kIndoor);
  EXPECT_THAT(reloaded.back(), poseNear(with_unload.truth(), 0.1, degToRad(1.0)));
  ASSERT_EQ(reloaded.size(), kept.size());
  for (std::size_t i = 0; i < kept.size(); ++i) {
    EXPECT_THAT(reloaded[i], poseNear(kept[i], 1e-6, 1e-6)) << "step " << i;
  }
}

TEST(MapsParams, AreRefusedWithoutRoomBetweenLoadingAndUnloading) {
  const auto problemOf = [](const std::string& yaml) -> std::string {
    try {
      (void)parseParams<Config>(yaml, "mine.yaml");
    } catch (const ConfigError& error) {
      return error.what();
    }
    return {};
  };
  EXPECT_THAT(
      problemOf("maps:\n  load_within_m: 60\n  unload_beyond_m: 60\n"),
      HasSubstr("mine.yaml:3: maps.unload_beyond_m: must be greater than load_within_m"));
  EXPECT_THAT(
      problemOf("maps:\n  load_within_m: 120\n"),
      HasSubstr("mine.yaml:2: maps.unload_beyond_m: must be greater than load_within_m"))
      << "than the default";
  EXPECT_THAT(
      problemOf("maps:\n  load_within_m: 20\n"),
      HasSubstr("mine.yaml:2: maps: load_within_m must not be less than "
                "mode_manager.zones.seed_within_m"))
      << "the particles would have no map";
  EXPECT_EQ(problemOf("maps:\n  load_within_m: 60\n  unload_beyond_m: 61\n"), "");
}

}  // namespace
}  // namespace vestibule::pipeline
