#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/events.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/grid/occupancy_map.hpp"
#include "vestibule/gui_headless/run_recorder.hpp"
#include "vestibule/gui_headless/scene.hpp"

namespace vestibule::gui_headless {

/// A made-up drive: from a charging point in the yard through the west door of a stable that
/// stands 12 degrees askew, past two feeding points, out by the east door and around the building.
/// Building frame: x along the stable, 0..40 m, y 0..18 m.
class SyntheticRun {
 public:
  static constexpr double kLength = 40.0;
  static constexpr double kDepth = 18.0;
  static constexpr double kStep_s = 0.1;

  SyntheticRun() : T_map_building_(12.0, -4.0, 12.0 * kRadPerDeg), map_(makeMap()) {
    makeSite();
    scene_.prior_maps = {&map_};
    scene_.site = &site_;
    const std::vector<std::pair<std::string, Point2>> stops = {
        {"charging point", {-22, 2}},
        {"gate", {-8, 9}},
        {"door west", {0, 9}},
        {"feeding 1", {12, 13}},
        {"feeding 2", {28, 4}},
        {"door east", {40, 9}},
        {"yard", {48, 20}},
        {"back road", {10, 26}},
        {"charging point", {-22, 2}}};
    for (std::size_t i = 0; i < stops.size(); ++i) {
      const Point2 p = stops[i].second;
      const Point2 q = stops[(i + 1) % stops.size()].second;
      const double yaw = i + 1 < stops.size() ? std::atan2(q.y - p.y, q.x - p.x) : 0.0;
      scene_.waypoints.emplace_back(stops[i].first, compose(T_map_building_, Pose2(p.x, p.y, yaw)));
    }
  }

  [[nodiscard]] const Scene& scene() const { return scene_; }
  Scene& scene() { return scene_; }
  [[nodiscard]] const Pose2& T_map_building() const { return T_map_building_; }

  /// Sends the drive through the observer; fills the reference and the raw fixes of the scene.
  void drive(Observer& observer) {
    RandomStream noise(7, "synthetic");
    Timestamp t = timestampFromSeconds(1000.0);
    Mode mode = Mode::kOutdoor;
    double ex = 0.0;
    double ey = 0.0;
    double last_switch_s = -100.0;
    scene_.reference.clear();
    scene_.gnss_fixes.clear();
    observer.onMap({t, MapEvent::Kind::kLoaded, "stable", 12.25});
    int step = 0;
    for (std::size_t leg = 1; leg < scene_.waypoints.size(); ++leg) {
      const Pose2& from = scene_.waypoints[leg - 1].second;
      const Pose2& to = scene_.waypoints[leg].second;
      const double yaw = std::atan2(to.y - from.y, to.x - from.x);
      const int n = static_cast<int>(distance(from, to) / (0.8 * kStep_s));
      for (int i = 0; i < n; ++i, ++step) {
        const double s = static_cast<double>(i) / n;
        // A slight bend, so that the track does not look drawn with a ruler.
        const double bend = 0.8 * std::sin(kPi * s);
        const Pose2 truth(
            from.x + s * (to.x - from.x) - bend * std::sin(yaw),
            from.y + s * (to.y - from.y) + bend * std::cos(yaw),
            wrapToPi(yaw + 0.1 * std::cos(kPi * s)));
        scene_.reference.emplace_back(t, truth);
        const Point2 b = transform(inverse(T_map_building_), Point2(truth.x, truth.y));
        const bool inside = b.x > 0 && b.x < kLength && b.y > 0 && b.y < kDepth;
        const double now_s = step * kStep_s;
        Mode wanted = inside ? Mode::kIndoor : Mode::kOutdoor;
        if (wanted != mode && now_s - last_switch_s > 4.0 && mode != Mode::kDeadReckoning) {
          change(
              observer,
              t,
              mode,
              Mode::kDeadReckoning,
              inside ? "GNSS fades at the door" : "map ends");
          last_switch_s = now_s;
        } else if (mode == Mode::kDeadReckoning && now_s - last_switch_s > 3.0) {
          change(observer, t, mode, wanted, inside ? "scan matches the map" : "RTK fix is back");
          last_switch_s = now_s;
        }
        const double sigma = mode == Mode::kIndoor ? 0.03 : mode == Mode::kOutdoor ? 0.12 : 0.25;
        ex += 0.05 * (sigma * noise.normal() - ex);
        ey += 0.05 * (sigma * noise.normal() - ey);
        PoseEvent pose{t, PoseSource::kPublished, mode, {}};
        pose.T.mean = Pose2(truth.x + 2 * ex, truth.y + 2 * ey, truth.phi + 0.01 * noise.normal());
        pose.T.cov = Eigen::Vector3d(sigma * sigma, 0.6 * sigma * sigma, 1e-4).asDiagonal();
        observer.onPose(pose);
        if (step % 5 == 0) gnss(observer, t, truth, inside, noise);
        if (inside && step % 10 == 0) particles(observer, t, truth, noise);
        t = t + durationFromSeconds(kStep_s);
      }
      observer.onMission(
          {t,
           MissionEvent::Kind::kWaypointReached,
           "feeding round",
           scene_.waypoints[leg].first,
           ""});
    }
    observer.onMission(
        {t, MissionEvent::Kind::kDone, "feeding round", "", "all waypoints reached"});
    observer.onWarning({t, "gnss", "multipath <near the wall> & \"roof\"", 7.5, 5.0});
  }

 private:
  static void change(Observer& observer, Timestamp t, Mode& mode, Mode to, const std::string& why) {
    observer.onMode({t, mode, to, why, {{"gnss_sigma_m", 0.42}, {"inlier_share", 0.81}}});
    mode = to;
  }

  void gnss(Observer& observer, Timestamp t, const Pose2& truth, bool inside, RandomStream& noise) {
    if (inside && !noise.bernoulli(0.1)) return;
    const double sigma = inside ? 5.0 : 0.25;
    scene_.gnss_fixes.emplace_back(
        truth.x + sigma * noise.normal(), truth.y + sigma * noise.normal());
    UpdateEvent update{t, "gnss", Decision::kAccepted, "", 0.0, 9.21, 2};
    const double a = noise.normal();
    const double b = noise.normal();
    update.nis = (inside ? 30.0 : 1.0) * (a * a + b * b);
    if (update.nis > update.gate) {
      update.decision = Decision::kGated;
      update.reason = "chi2";
    }
    observer.onUpdate(update);
  }

  static void particles(Observer& observer, Timestamp t, const Pose2& truth, RandomStream& noise) {
    std::vector<Pose2> set;
    for (int i = 0; i < 500; ++i) {
      set.emplace_back(truth.x + 0.25 * noise.normal(), truth.y + 0.25 * noise.normal(), truth.phi);
    }
    const std::vector<double> weights(set.size(), 1.0 / static_cast<double>(set.size()));
    observer.onParticles({t, set, weights, 400.0, 0.9});
  }

  grid::OccupancyMap makeMap() const {
    constexpr double kRes = 0.1;
    const int w = static_cast<int>((kLength + 8.0) / kRes);
    const int h = static_cast<int>((kDepth + 8.0) / kRes);
    std::vector<grid::Cell> cells(static_cast<std::size_t>(w * h), grid::Cell::kUnknown);
    for (int iy = 0; iy < h; ++iy) {
      for (int ix = 0; ix < w; ++ix) {
        const double x = -4.0 + (ix + 0.5) * kRes;
        const double y = -4.0 + (iy + 0.5) * kRes;
        auto& cell = cells[static_cast<std::size_t>(iy * w + ix)];
        const bool in = x > 0 && x < kLength && y > 0 && y < kDepth;
        const bool wall_x = (std::abs(x) < 0.12 || std::abs(x - kLength) < 0.12) && y > -0.12 &&
                            y < kDepth + 0.12 && std::abs(y - 9.0) > 1.6;
        const bool wall_y =
            (std::abs(y) < 0.12 || std::abs(y - kDepth) < 0.12) && x > -0.12 && x < kLength + 0.12;
        const bool apron = std::abs(y - 9.0) < 3.0 && x > -3.0 && x < kLength + 3.0;
        if (in || apron) cell = grid::Cell::kFree;
        const double bay = std::fmod(x + 0.5, 5.0);
        const bool box = in && bay < 0.25 && (y > 15.0 || y < 2.5);
        const bool post = in && std::hypot(std::fmod(x, 8.0) - 4.0, y - 9.0) < 0.35 && x > 6.0;
        if (wall_x || wall_y || box || post) cell = grid::Cell::kOccupied;
      }
    }
    return grid::OccupancyMap::fromCells(w, h, kRes, Point2(-4.0, -4.0), cells, T_map_building_);
  }

  void makeSite() {
    const auto at = [&](double x, double y) { return transform(T_map_building_, Point2(x, y)); };
    site_.name = "farm";
    site_.buildings.push_back(
        {"stable", {at(0, 0), at(kLength, 0), at(kLength, kDepth), at(0, kDepth)}});
    site_.doors.push_back({"west", at(0, 7.4), at(0, 10.6)});
    site_.doors.push_back({"east", at(kLength, 7.4), at(kLength, 10.6)});
  }

  Pose2 T_map_building_;
  grid::OccupancyMap map_;
  geo::Site site_;
  Scene scene_;
};

}  // namespace vestibule::gui_headless
