#include "vestibule/amcl/global_localizer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "../src/scan_continuity.hpp"
#include "matchers.hpp"
#include "vestibule/amcl/localizer.hpp"
#include "vestibule/core/events.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/grid/ray_caster.hpp"

namespace vestibule::amcl {
namespace {

constexpr int kWidth = 480;
constexpr int kHeight = 200;
constexpr double kResolution = 0.05;

/// Four equal rooms of 6 x 6 m in a row along a corridor of 4 m; only a niche at the corridor's
/// left end tells its ends apart.
std::shared_ptr<const grid::OccupancyMap> fourRooms() {
  std::vector<grid::Cell> cells(kWidth * kHeight, grid::Cell::kFree);
  const auto fill = [&](int x0, int x1, int y0, int y1, grid::Cell kind) {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) cells[static_cast<std::size_t>(y * kWidth + x)] = kind;
    }
  };
  fill(0, kWidth, 0, 2, grid::Cell::kOccupied);
  fill(0, kWidth, kHeight - 2, kHeight, grid::Cell::kOccupied);
  fill(0, kWidth, 120, 122, grid::Cell::kOccupied);
  for (int room = 0; room <= 4; ++room) {
    const int x = std::min(120 * room, kWidth - 2);
    fill(x, x + 2, 0, room == 0 || room == 4 ? kHeight : 120, grid::Cell::kOccupied);
    if (room == 4) break;
    fill(x + 50, x + 70, 120, 122, grid::Cell::kFree);      // the door
    fill(x + 14, x + 40, 14, 30, grid::Cell::kOccupied);    // a desk
    fill(x + 100, x + 108, 60, 84, grid::Cell::kOccupied);  // a cabinet
  }
  fill(2, 40, 160, kHeight - 2, grid::Cell::kOccupied);  // the niche's wall
  return std::make_shared<const grid::OccupancyMap>(
      grid::OccupancyMap::fromCells(kWidth, kHeight, kResolution, {0, 0}, cells, {30, -10, 0.4}));
}

struct Robot {
  std::shared_ptr<const grid::OccupancyMap> map;
  grid::RayCaster rays;
  Pose2 T_grid_base;
  double t_s = 0.0;
  RandomStream rng{3, "robot"};

  Robot(std::shared_ptr<const grid::OccupancyMap> m, const Pose2& start)
      : map(std::move(m)), rays(*map), T_grid_base(start) {}

  [[nodiscard]] Pose2 truth() const { return compose(map->T_map_grid(), T_grid_base); }

  LaserScan scan() {
    LaserScan scan;
    scan.stamp = timestampFromSeconds(t_s);
    scan.angle_min_rad = -0.75 * kPi;
    scan.angle_step_rad = 1.5 * kPi / 180.0;
    scan.range_min_m = 0.05;
    scan.range_max_m = 9.0;
    scan.T_base_laser = {0.1, 0.0, 0.0};
    const Pose2 T = compose(truth(), scan.T_base_laser);
    for (int i = 0; i <= 180; ++i) {
      const double range =
          rays.range({T.x, T.y}, T.phi + scan.angle(static_cast<std::size_t>(i)), 9.0);
      scan.ranges_m.push_back(static_cast<float>(range + rng.normal(0.0, 0.01)));
    }
    return scan;
  }

  /// A tenth of a metre towards a point of the grid.
  WheelOdometry driveTo(const Point2& p) {
    const double turn =
        angleDiff(std::atan2(p.y - T_grid_base.y, p.x - T_grid_base.x), T_grid_base.phi);
    const Pose2 step{0.1, 0.0, std::max(-0.3, std::min(0.3, turn))};
    T_grid_base = compose(T_grid_base, Pose2{0.0, 0.0, step.phi});
    T_grid_base = compose(T_grid_base, Pose2{step.x, 0.0, 0.0});
    t_s += 0.2;
    WheelOdometry odometry;
    odometry.stamp = timestampFromSeconds(t_s);
    odometry.dt_s = 0.2;
    odometry.T_previous_now = compose(
        Pose2{0.0, 0.0, 1.03 * step.phi}, Pose2{1.03 * step.x, 0.0, rng.normal(0.0, 0.005)});
    return odometry;
  }

  template <class Localizer>
  void goTo(const Point2& p, Localizer& localizer) {
    while (std::hypot(p.x - T_grid_base.x, p.y - T_grid_base.y) > 0.15) {
      localizer.process(driveTo(p));
      localizer.process(scan());
    }
  }

  /// In the second of the four rooms.
  template <class Localizer>
  void lookRound(Localizer& localizer) {
    localizer.process(scan());
    goTo({9.0, 4.0}, localizer);
    goTo({7.5, 3.0}, localizer);
  }
};

GlobalParams oneThread(int threads = 1) {
  GlobalParams params;
  params.search.threads = threads;
  return params;
}

TEST(GlobalLocalizer, StaysUnsureInEqualRoomsAndIsSureOnceItSeesTheDifference) {
  Robot robot(fourRooms(), {8.0, 2.5, 1.0});
  GlobalLocalizer localizer(oneThread(), robot.map);
  localizer.start();
  robot.lookRound(localizer);
  // Four rooms look the same: all of them are candidates, the true one among them.
  EXPECT_EQ(localizer.state(), PlaceState::kUnsure);
  const auto places = localizer.places();
  const auto likely = std::count_if(
      places.begin(), places.end(), [](const Place& place) { return place.weight > 1e-3; });
  EXPECT_EQ(likely, 4);
  double sum = 0.0;
  bool has_truth = false;
  for (const Place& place : places) {
    sum += place.weight;
    EXPECT_LT(place.weight, 0.9);
    has_truth = has_truth || distance(place.T_map_base.mean, robot.truth()) < 0.1;
  }
  EXPECT_NEAR(sum, 1.0, 1e-9);
  EXPECT_TRUE(has_truth);
  // Through the door and along the corridor to its left end.
  robot.goTo({9.0, 5.0}, localizer);
  robot.goTo({9.0, 7.2}, localizer);
  robot.goTo({3.5, 7.2}, localizer);
  robot.goTo({6.5, 7.0}, localizer);
  robot.goTo({3.0, 7.3}, localizer);
  EXPECT_EQ(localizer.state(), PlaceState::kSure);
  EXPECT_THAT(localizer.places().front().T_map_base.mean, poseNear(robot.truth(), 0.15, 0.05));
}

TEST(GlobalLocalizer, APriorDecidesBetweenEqualPlacesButDoesNotHideABetterOne) {
  Robot robot(fourRooms(), {8.0, 2.5, 1.0});
  GlobalLocalizer localizer(oneThread(), robot.map);
  grid::PosePrior prior;
  prior.T_map_base = robot.truth();
  prior.information = Eigen::Vector3d(1.0, 1.0, 0.0).asDiagonal();  // 1 m, no yaw
  prior.max_d2 = 8.0;
  localizer.start(prior);
  localizer.process(robot.scan());
  EXPECT_GT(localizer.places().front().weight, 0.9);
  EXPECT_LT(distance(localizer.places().front().T_map_base.mean, robot.truth()), 0.1);
  // The corridor's end fits nowhere else, whatever a prior says.
  Robot other(robot.map, {3.0, 7.2, 3.0});
  localizer.start(prior);
  localizer.process(other.scan());
  EXPECT_LT(distance(localizer.places().front().T_map_base.mean, other.truth()), 0.1);
}

/// What an antenna at `p_map` says.
grid::PosePrior fixAt(const Point2& p_map, double sigma_m) {
  grid::PosePrior prior;
  prior.T_map_base = {p_map.x, p_map.y, 0.0};
  prior.information(0, 0) = prior.information(1, 1) = 1.0 / (sigma_m * sigma_m);
  prior.max_d2 = 20.0;
  return prior;
}

grid::PosePrior headingOf(double yaw_rad) {
  grid::PosePrior prior;
  prior.T_map_base.phi = yaw_rad;
  prior.information(2, 2) = 1.0 / (0.2 * 0.2);
  prior.max_d2 = 20.0;
  return prior;
}

TEST(GlobalLocalizer, AFixOnTheWayDecidesBetweenEqualRooms) {
  // GIVEN a robot that is in one of four equal rooms
  Robot robot(fourRooms(), {8.0, 2.5, 1.0});
  GlobalLocalizer localizer(oneThread(), robot.map);
  localizer.start();
  robot.lookRound(localizer);
  ASSERT_EQ(localizer.state(), PlaceState::kUnsure);

  // WHEN its antenna, which stands out by as much as a room, gets a fix, and it drives on
  const double yaw_rad = robot.T_grid_base.phi;
  const Pose2 T_base_antenna{6.0 * std::cos(yaw_rad), -6.0 * std::sin(yaw_rad), 0.0};
  const Pose2 T_map_antenna = compose(robot.truth(), T_base_antenna);
  EXPECT_TRUE(localizer.learn(
      PriorKind::kPosition, fixAt({T_map_antenna.x, T_map_antenna.y}, 1.0), T_base_antenna));
  robot.goTo({9.0, 4.0}, localizer);

  // THEN it knows its room
  EXPECT_EQ(localizer.state(), PlaceState::kSure);
  EXPECT_THAT(localizer.places().front().T_map_base.mean, poseNear(robot.truth(), 0.15, 0.05));
}

TEST(GlobalLocalizer, WhatIsLearntWronglyDoesNotHideThePlaceThatFits) {
  // GIVEN a robot at the corridor's end, which is like nothing else
  Robot robot(fourRooms(), {5.0, 7.2, 3.0});
  GlobalLocalizer localizer(oneThread(), robot.map);
  localizer.start();

  // WHEN fix and compass put it into a room far off, again and again
  const auto mislead = [&] {
    const Pose2 T_map_there = compose(robot.map->T_map_grid(), Pose2{20.0, 2.5, 0.0});
    localizer.learn(PriorKind::kPosition, fixAt({T_map_there.x, T_map_there.y}, 1.0));
    localizer.learn(PriorKind::kHeading, headingOf(robot.truth().phi + 2.0));
  };
  mislead();
  localizer.process(robot.scan());
  for (const Point2& to : {Point2{3.5, 7.2}, Point2{6.5, 7.0}, Point2{3.0, 7.3}}) {
    mislead();
    robot.goTo(to, localizer);
  }

  // THEN it is sure all the same
  EXPECT_EQ(localizer.state(), PlaceState::kSure);
  EXPECT_THAT(localizer.places().front().T_map_base.mean, poseNear(robot.truth(), 0.15, 0.05));
}

TEST(GlobalLocalizer, OfTheFixesAtOnePlaceTheSharpestCounts) {
  Robot robot(fourRooms(), {8.0, 2.5, 1.0});
  GlobalLocalizer localizer(oneThread(), robot.map);
  localizer.start();
  const auto learn = [&](double sigma_m) {
    return localizer.learn(PriorKind::kPosition, fixAt({0.0, 0.0}, sigma_m));
  };
  EXPECT_TRUE(learn(1.0));
  EXPECT_FALSE(learn(2.0));
  EXPECT_FALSE(learn(std::numeric_limits<double>::quiet_NaN()));
  EXPECT_TRUE(learn(1.0)) << "as sharp, and newer";
  EXPECT_TRUE(localizer.learn(PriorKind::kHeading, headingOf(0.0))) << "another kind";

  robot.goTo({9.0, 4.0}, localizer);
  EXPECT_TRUE(learn(2.0)) << "elsewhere";

  localizer.start();
  EXPECT_TRUE(learn(5.0)) << "a new search knows nothing of the one before";
}

TEST(GlobalLocalizer, OneFixThatIsFarOffIsOutvotedByTheOthers) {
  // GIVEN a robot in one of four equal rooms, 6 m apart, and fixes of its own room
  Robot robot(fourRooms(), {8.0, 2.5, 1.0});
  GlobalLocalizer localizer(oneThread(), robot.map);
  localizer.start();
  const auto learn = [&](double off_m) {
    const Pose2 T_grid{robot.T_grid_base.x + off_m, robot.T_grid_base.y, 0.0};
    const Pose2 T_map = compose(robot.map->T_map_grid(), T_grid);
    localizer.learn(PriorKind::kPosition, fixAt({T_map.x, T_map.y}, 1.0));
  };
  const std::vector<Point2> corners{{9.0, 4.0}, {7.5, 3.0}, {9.0, 4.0}, {8.0, 2.5}, {9.0, 4.0}};
  for (std::size_t i = 0; i < corners.size(); ++i) {
    learn(0.0);
    localizer.process(robot.scan());
    robot.goTo(corners[i], localizer);
  }
  ASSERT_EQ(localizer.state(), PlaceState::kSure);

  // WHEN the last one is of the next room
  learn(6.0);
  robot.goTo({8.0, 2.5}, localizer);

  // THEN the room stays the likeliest
  EXPECT_THAT(localizer.places().front().T_map_base.mean, poseNear(robot.truth(), 0.15, 0.05));
}

TEST(GlobalLocalizer, APlaceThatASensorContradictsMustBeMuchLikelier) {
  const auto stateWith = [](double heading_error_rad) {
    // GIVEN a robot in one of four equal rooms that was told which
    Robot robot(fourRooms(), {8.0, 2.5, 1.0});
    GlobalLocalizer localizer(oneThread(), robot.map);
    localizer.start(fixAt({robot.truth().x, robot.truth().y}, 1.0));
    localizer.process(robot.scan());
    // WHEN it has a compass, which says the same of all of them
    for (const Point2& to : {Point2{9.0, 4.0}, Point2{7.5, 3.0}, Point2{9.0, 4.0}}) {
      localizer.learn(PriorKind::kHeading, headingOf(robot.truth().phi + heading_error_rad));
      robot.goTo(to, localizer);
    }
    EXPECT_LT(distance(localizer.places().front().T_map_base.mean, robot.truth()), 0.15);
    return localizer.state();
  };
  EXPECT_EQ(stateWith(0.0), PlaceState::kSure);
  EXPECT_EQ(stateWith(2.0), PlaceState::kUnsure);
}

TEST(GlobalLocalizer, SearchesOnlyTheZone) {
  Robot robot(fourRooms(), {8.0, 2.5, 1.0});
  GlobalLocalizer localizer(oneThread(), robot.map);
  localizer.start({}, grid::SearchWindow{robot.truth(), 2.0, 2.0, 0.5});
  localizer.process(robot.scan());
  ASSERT_EQ(localizer.places().size(), 1U);
  EXPECT_LT(distance(localizer.places().front().T_map_base.mean, robot.truth()), 0.1);
}

TEST(GlobalLocalizer, FindsNothingWhereTheScansDoNotFit) {
  Robot robot(fourRooms(), {8.0, 2.5, 1.0});
  GlobalLocalizer localizer(oneThread(), robot.map);
  localizer.start();
  EXPECT_EQ(localizer.state(), PlaceState::kNowhere);
  LaserScan empty = robot.scan();
  for (float& range : empty.ranges_m) range = 99.0F;
  EXPECT_FALSE(localizer.process(empty));
  // A round room of 1.5 m is not on the map.
  LaserScan round = robot.scan();
  for (float& range : round.ranges_m) range = 1.5F;
  EXPECT_TRUE(localizer.process(round));
  EXPECT_NE(localizer.state(), PlaceState::kSure);
}

TEST(GlobalLocalizer, ConsidersAPlaceFromWhichMostOfTheViewIsNotMapped) {
  // GIVEN a map that ends in the middle of the first room, and a robot that looks out of it
  const auto all = fourRooms();
  std::vector<grid::Cell> cells;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      cells.push_back(x < 65 && y < 122 ? all->cell(x, y) : grid::Cell::kUnknown);
    }
  }
  const auto part = std::make_shared<const grid::OccupancyMap>(grid::OccupancyMap::fromCells(
      kWidth, kHeight, kResolution, {0, 0}, cells, all->T_map_grid()));
  Robot robot(all, {2.5, 2.2, 0.3});
  GlobalLocalizer localizer(oneThread(), part);
  localizer.start();
  const auto has_truth = [&] {
    const auto places = localizer.places();
    return std::any_of(places.begin(), places.end(), [&](const Place& place) {
      return distance(place.T_map_base.mean, robot.truth()) < 0.3;
    });
  };

  // WHEN it drives about there
  localizer.process(robot.scan());
  const bool found_at_once = has_truth();
  robot.goTo({3.0, 4.0}, localizer);

  // THEN the true place is a candidate, at once and after the way, but nothing to be sure of
  EXPECT_TRUE(found_at_once);
  EXPECT_TRUE(has_truth());
  EXPECT_NE(localizer.state(), PlaceState::kSure);
}

TEST(GlobalLocalizer, DropsWhatIsNotANumber) {
  Robot robot(fourRooms(), {8.0, 2.5, 1.0});
  GlobalLocalizer localizer(oneThread(), robot.map);
  localizer.start();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  LaserScan scan = robot.scan();
  scan.T_base_laser.phi = kNan;
  EXPECT_FALSE(localizer.process(scan)) << "laser pose unknown";
  scan = robot.scan();
  for (float& r : scan.ranges_m) r = static_cast<float>(kNan);
  EXPECT_FALSE(localizer.process(scan)) << "no beam is valid";
  WheelOdometry odometry;
  odometry.T_previous_now = {kNan, 0.0, 0.0};
  localizer.process(odometry);
  EXPECT_TRUE(localizer.process(robot.scan()));
  EXPECT_FALSE(localizer.places().empty());
  EXPECT_EQ(localizer.travelled(), 0.0);
}

TEST(GlobalLocalizer, BeamsWithoutAnEchoSpeakAgainstWallsThatAreNotThere) {
  // GIVEN two rooms that are equal but for a wall 6 m ahead, which one of them does not have
  constexpr int kSide = 400;
  std::vector<grid::Cell> cells(kSide * kSide, grid::Cell::kFree);
  const auto fill = [&](int x0, int x1, int y0, int y1) {
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        cells[static_cast<std::size_t>(y * kSide + x)] = grid::Cell::kOccupied;
      }
    }
  };
  for (const int y : {40, 240}) {
    fill(20, 22, y, y + 80);
    fill(20, 100, y, y + 2);
    fill(20, 80, y + 78, y + 80);
  }
  fill(150, 152, 40, 120);
  const auto map = std::make_shared<const grid::OccupancyMap>(
      grid::OccupancyMap::fromCells(kSide, kSide, kResolution, {0, 0}, cells, {}));
  // WHEN the robot is in the room without
  Robot robot(map, {2.5, 14.0, 0.0});
  const auto weightOfTruth = [&](double no_echo_share) {
    GlobalParams params = oneThread();
    params.no_echo_share = no_echo_share;
    GlobalLocalizer localizer(params, map);
    localizer.start();
    LaserScan scan = robot.scan();
    for (float& range : scan.ranges_m) {
      if (range > 8.8F) range = std::numeric_limits<float>::infinity();
    }
    localizer.process(scan);
    double weight = 0.0;
    for (const Place& place : localizer.places()) {
      if (distance(place.T_map_base.mean, robot.truth()) < 0.2) weight += place.weight;
    }
    return weight;
  };
  // THEN only the missing echoes tell
  EXPECT_NEAR(weightOfTruth(0.999), 0.5, 0.3);
  EXPECT_GT(weightOfTruth(0.1), 0.95);
}

TEST(GlobalLocalizer, GivesTheSamePlacesForAnyNumberOfThreads) {
  const auto run = [](int threads) {
    Robot robot(fourRooms(), {8.0, 2.5, 1.0});
    GlobalLocalizer localizer(oneThread(threads), robot.map);
    localizer.start();
    localizer.process(robot.scan());
    robot.goTo({9.0, 4.0}, localizer);
    return localizer.places();
  };
  const auto one = run(1);
  const auto three = run(3);
  ASSERT_EQ(one.size(), three.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].T_map_base.mean, three[i].T_map_base.mean);
    EXPECT_EQ(one[i].weight, three[i].weight);
  }
}

/// Counts poses by what they are worth.
struct PoseModes : Observer {
  int indoor = 0;
  int lost = 0;
  void onPose(const PoseEvent& event) override { ++(event.mode == Mode::kLost ? lost : indoor); }
};

TEST(Localizer, NoticesThatItWasCarriedAwayAndFindsItself) {
  Robot robot(fourRooms(), {3.5, 7.2, 0.0});
  AmclParams params;
  params.global = oneThread();
  PoseModes modes;
  Observers observers;
  observers.attach(modes);
  Localizer localizer(params, robot.map, 5, &observers);
  localizer.startAt({robot.truth(), Eigen::Vector3d(0.02, 0.02, 0.005).asDiagonal()});
  robot.goTo({9.0, 7.2}, localizer);
  EXPECT_FALSE(localizer.searching());
  EXPECT_EQ(modes.lost, 0);
  const int before = modes.indoor;
  EXPECT_GT(before, 0);
  // WHEN somebody carries it into a room and turns it round
  robot.T_grid_base = {20.0, 3.0, 2.0};
  robot.goTo({21.0, 5.0}, localizer);
  robot.goTo({21.0, 7.2}, localizer);
  robot.goTo({6.0, 7.2}, localizer);
  robot.goTo({3.5, 7.2}, localizer);
  // THEN it has searched, called its poses lost while it did, and is right again
  EXPECT_GE(localizer.recoveries(), 1);
  EXPECT_GT(modes.lost, 0);
  EXPECT_GT(modes.indoor, before);
  EXPECT_FALSE(localizer.searching());
  EXPECT_THAT(localizer.pose().mean, poseNear(robot.truth(), 0.1, 0.03));
}

TEST(Localizer, ForgetsWhatItSawBeforeItWasCarriedAwayWhileItSearched) {
  // GIVEN a robot that does not know in which of the equal rooms it is
  Robot robot(fourRooms(), {8.0, 2.5, 1.0});
  AmclParams params;
  params.global = oneThread();
  Localizer localizer(params, robot.map, 5);
  localizer.startAnywhere();
  robot.lookRound(localizer);
  ASSERT_TRUE(localizer.searching());

  // WHEN somebody carries it to the corridor, where there is but one place like that
  robot.T_grid_base = {9.0, 7.2, 3.0};
  robot.goTo({3.5, 7.2}, localizer);

  // THEN what it has seen in the room says nothing against that
  EXPECT_FALSE(localizer.searching());
  EXPECT_THAT(localizer.pose().mean, poseNear(robot.truth(), 0.1, 0.03));
}

TEST(Localizer, TakesFixesInWhileItSearchesOnly) {
  Robot robot(fourRooms(), {8.0, 2.5, 1.0});
  AmclParams params;
  params.global = oneThread();
  Localizer localizer(params, robot.map, 5);
  const Pose2 truth = robot.truth();
  localizer.startAt({truth, Eigen::Vector3d(0.02, 0.02, 0.005).asDiagonal()});
  EXPECT_FALSE(localizer.learn(PriorKind::kPosition, fixAt({truth.x, truth.y}, 1.0)));

  // WHEN it starts anywhere, with a fix before the first scan
  localizer.startAnywhere();
  EXPECT_TRUE(localizer.learn(PriorKind::kPosition, fixAt({truth.x, truth.y}, 1.0)));
  robot.lookRound(localizer);

  // THEN it has found its room of four, and has no use for more
  EXPECT_FALSE(localizer.searching());
  EXPECT_THAT(localizer.pose().mean, poseNear(robot.truth(), 0.1, 0.03));
  EXPECT_FALSE(localizer.learn(PriorKind::kPosition, fixAt({truth.x, truth.y}, 1.0)));
}

TEST(ScanContinuity, HoldsWhileTheRobotDrivesAndTurnsAndBreaksWhenItIsCarriedAway) {
  Robot robot(fourRooms(), {3.5, 7.2, 0.0});
  ScanContinuity continuity;
  Pose2 T_odom_base;
  const auto goes = [&](const Point2& to, int steps) {
    int breaks = 0;
    for (int i = 0; i < steps; ++i) {
      T_odom_base = compose(T_odom_base, robot.driveTo(to).T_previous_now);
      breaks += continuity.breaks(robot.scan(), T_odom_base) ? 1 : 0;
    }
    return breaks;
  };
  EXPECT_EQ(goes({9.0, 7.2}, 50), 0);
  EXPECT_EQ(goes({9.0, 4.0}, 30), 0);  // through the door

  robot.T_grid_base = {20.0, 3.0, -2.0};
  EXPECT_EQ(goes({21.0, 5.0}, 2), 1);

  EXPECT_EQ(goes({21.0, 7.2}, 20), 0);  // and goes on from there
}

TEST(ScanContinuity, OneScanThatIsCoveredIsNoBreakAndNeitherIsASilentLidar) {
  Robot robot(fourRooms(), {3.5, 7.2, 0.0});
  ScanContinuity continuity;
  EXPECT_FALSE(continuity.breaks(robot.scan(), {}));
  robot.t_s += 0.1;
  LaserScan covered = robot.scan();
  for (float& range : covered.ranges_m) range = 0.2F;

  EXPECT_FALSE(continuity.breaks(covered, {}));
  robot.t_s += 0.1;
  EXPECT_FALSE(continuity.breaks(robot.scan(), {}));

  // The robot is elsewhere after two seconds without a scan: odometry may have led it there.
  robot.t_s += 2.0;
  robot.T_grid_base = {20.0, 3.0, 2.0};
  EXPECT_FALSE(continuity.breaks(robot.scan(), {}));
  robot.t_s += 0.1;
  EXPECT_FALSE(continuity.breaks(robot.scan(), {}));
}

TEST(Localizer, SearchesAsSoonAsTheSurroundingsChangeAtOnce) {
  // GIVEN a tracked robot in the corridor
  Robot robot(fourRooms(), {3.5, 7.2, 0.0});
  AmclParams params;
  params.global = oneThread();
  Localizer localizer(params, robot.map, 5);
  localizer.startAt({robot.truth(), Eigen::Vector3d(0.02, 0.02, 0.005).asDiagonal()});
  robot.goTo({9.0, 7.2}, localizer);
  ASSERT_FALSE(localizer.searching());

  // WHEN it is carried into a room and has gone on by less than half a metre
  robot.T_grid_base = {20.0, 3.0, -2.0};
  for (int i = 0; i < 4; ++i) {
    localizer.process(robot.driveTo({21.0, 5.0}));
    localizer.process(robot.scan());
  }

  // THEN it does not claim to know where it is
  EXPECT_TRUE(localizer.searching());
}

TEST(Localizer, DoubtsAJumpIntoAnEqualRoom) {
  // GIVEN a robot that knows its room of four equal ones
  Robot robot(fourRooms(), {8.0, 3.0, 1.0});
  AmclParams params;
  params.global = oneThread();
  Localizer localizer(params, robot.map, 5);
  localizer.startAt({robot.truth(), Eigen::Vector3d(0.02, 0.02, 0.005).asDiagonal()});
  robot.goTo({9.0, 4.0}, localizer);
  robot.goTo({8.0, 2.5}, localizer);
  EXPECT_FALSE(localizer.searching());
  // WHEN it is carried nearly to where it was, but in the next room
  robot.T_grid_base.x += 6.7;
  robot.T_grid_base.y += 0.5;
  robot.goTo({15.0, 4.0}, localizer);
  robot.goTo({14.0, 2.5}, localizer);
  robot.goTo({15.0, 4.0}, localizer);
  // THEN it does not take the equal place of its old room for granted
  EXPECT_TRUE(localizer.searching());
  EXPECT_EQ(localizer.state(), PlaceState::kUnsure);
  // AND knows where it is once it has seen what differs
  robot.goTo({15.0, 7.2}, localizer);
  robot.goTo({3.0, 7.2}, localizer);
  EXPECT_FALSE(localizer.searching());
  EXPECT_THAT(localizer.pose().mean, poseNear(robot.truth(), 0.15, 0.05));
}

TEST(Localizer, IsNotLostWhereNobodyHasMapped) {
  // GIVEN a map without one of the rooms
  Robot robot(fourRooms(), {9.0, 8.0, kPi});
  std::vector<grid::Cell> cells;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool left_out = x < 118 && y < 120;
      cells.push_back(left_out ? grid::Cell::kUnknown : robot.map->cell(x, y));
    }
  }
  const auto map = std::make_shared<const grid::OccupancyMap>(grid::OccupancyMap::fromCells(
      kWidth, kHeight, kResolution, {0, 0}, cells, robot.map->T_map_grid()));
  AmclParams params;
  params.global = oneThread();
  Localizer localizer(params, map, 1);
  const Eigen::Matrix3d cov = Eigen::Vector3d(0.02, 0.02, 0.004).asDiagonal();
  localizer.startAt({robot.truth(), cov});
  // WHEN it drives into that room and about there
  robot.goTo({3.0, 7.2}, localizer);
  robot.goTo({3.0, 5.0}, localizer);
  robot.goTo({3.2, 2.5}, localizer);
  robot.goTo({4.0, 4.0}, localizer);
  EXPECT_TRUE(localizer.process(robot.scan()).trusted);
  robot.goTo({3.0, 5.0}, localizer);
  // THEN it goes on by odometry and what it still sees of the map, and does not search
  EXPECT_EQ(localizer.recoveries(), 0);
  EXPECT_EQ(localizer.state(), PlaceState::kSure);
  EXPECT_THAT(localizer.pose().mean, poseNear(robot.truth(), 0.4, 0.1));
  // AND it is right again in the corridor
  robot.goTo({3.0, 7.2}, localizer);
  robot.goTo({7.0, 7.5}, localizer);
  EXPECT_THAT(localizer.pose().mean, poseNear(robot.truth(), 0.1, 0.03));
}

TEST(Localizer, ABlindRobotIsTrustedOnlyAsFarAsItsOdometry) {
  Robot robot(fourRooms(), {3.0, 7.0, 0.0});
  AmclParams params;
  params.global = oneThread();
  Localizer localizer(params, robot.map, 1);
  const auto blind = [&robot] {
    LaserScan scan = robot.scan();
    std::fill(scan.ranges_m.begin(), scan.ranges_m.end(), 0.0F);
    return scan;
  };
  // GIVEN a start pose, and a lidar that sees nothing
  localizer.startAt({robot.truth(), Eigen::Vector3d(0.02, 0.02, 0.004).asDiagonal()});
  EXPECT_FALSE(localizer.process(blind()).trusted) << "nothing has confirmed the pose";
  robot.goTo({4.0, 7.0}, localizer);
  ASSERT_TRUE(localizer.process(robot.scan()).trusted);
  const auto driveBlindTo = [&](double x) {
    bool trusted = false;
    while (robot.T_grid_base.x < x) {
      localizer.process(robot.driveTo({30.0, 7.0}));
      trusted = localizer.process(blind()).trusted;
    }
    return trusted;
  };
  EXPECT_TRUE(driveBlindTo(5.0));
  EXPECT_FALSE(driveBlindTo(22.0));
  EXPECT_FALSE(localizer.searching()) << "what is not seen does not contradict the pose";
}

TEST(Localizer, KeepsItsPlaceInAClutteredRoomWhileNoOtherFitsBetter) {
  // GIVEN a room full of posts that the map does not know
  const auto map = fourRooms();
  std::vector<grid::Cell> cells;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool on_the_way = x > 46 && x < 74;
      const bool post = x < 116 && y < 116 && x % 14 < 4 && y % 14 < 4 && !on_the_way;
      cells.push_back(post ? grid::Cell::kOccupied : map->cell(x, y));
    }
  }
  const auto cluttered = std::make_shared<const grid::OccupancyMap>(grid::OccupancyMap::fromCells(
      kWidth, kHeight, kResolution, {0, 0}, cells, map->T_map_grid()));
  Robot robot(cluttered, {9.0, 8.0, kPi});
  AmclParams params;
  params.global = oneThread();
  Localizer localizer(params, map, 1);
  localizer.startAt({robot.truth(), Eigen::Vector3d(0.02, 0.02, 0.004).asDiagonal()});
  // WHEN the robot drives into it and stands there
  robot.goTo({3.0, 7.2}, localizer);
  robot.goTo({3.0, 2.0}, localizer);
  double worst_inlier_share = 1.0;
  for (int second = 0; second < 20; ++second) {
    robot.t_s += 1.0;
    worst_inlier_share = std::min(worst_inlier_share, localizer.process(robot.scan()).inlier_share);
  }
  // THEN the scans fit badly, and it is where it was all the same
  EXPECT_LT(worst_inlier_share, params.lost_inlier_share);
  EXPECT_GE(localizer.searches(), 1) << "it has looked elsewhere";
  EXPECT_EQ(localizer.recoveries(), 0);
  EXPECT_EQ(localizer.state(), PlaceState::kSure);
  EXPECT_THAT(localizer.pose().mean, poseNear(robot.truth(), 0.2, 0.05));
}

TEST(Localizer, StartsAnywhereAndMeansItsPoseOnlyWhenSure) {
  Robot robot(fourRooms(), {8.0, 2.5, 1.0});
  AmclParams params;
  params.global = oneThread();
  Localizer localizer(params, robot.map, 5);
  localizer.startAnywhere();
  robot.goTo({9.0, 4.0}, localizer);
  EXPECT_TRUE(localizer.searching());
  EXPECT_GT(std::sqrt(localizer.pose().cov.topLeftCorner<2, 2>().trace()), 2.0)
      << "the covariance must cover the other rooms";
  robot.goTo({9.0, 7.2}, localizer);
  robot.goTo({3.5, 7.2}, localizer);
  EXPECT_FALSE(localizer.searching());
  EXPECT_THAT(localizer.pose().mean, poseNear(robot.truth(), 0.1, 0.03));
  ASSERT_EQ(localizer.places().size(), 1U);
}

}  // namespace
}  // namespace vestibule::amcl
