#include "wanderer.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::pipeline {
namespace {

constexpr double kSpeed_mps = 0.5;
constexpr double kTurn_radps = degToRad(60.0);

}  // namespace

template <class Visit>
void Ground::forNeighbours(std::size_t i, const Visit& visit) const {
  const std::size_t ix = i % width();
  if (ix > 0) visit(i - 1);
  if (ix + 1 < width()) visit(i + 1);
  if (i >= width()) visit(i - width());
  if (i + width() < open_.size()) visit(i + width());
}

Ground::Ground(const LostPlace& place) : map_(*place.map), open_(cellCount(), 0) {
  for (std::size_t i = 0; i < open_.size(); ++i) {
    const int ix = static_cast<int>(i % width());
    const int iy = static_cast<int>(i / width());
    const Point2 p = centreOf(i);
    open_[i] = map_.cell(ix, iy) == grid::Cell::kFree && place.inside(p) &&
                       place.clearance(p) > kWandererRadius_m
                   ? 1
                   : 0;
  }
  std::vector<char> unseen = open_;
  for (std::size_t i = 0; i < unseen.size(); ++i) {
    if (unseen[i] == 0) continue;
    std::vector<std::size_t> part{i};
    unseen[i] = 0;
    for (std::size_t next = 0; next < part.size(); ++next) {
      forNeighbours(part[next], [&](std::size_t j) {
        if (unseen[j] == 0) return;
        unseen[j] = 0;
        part.push_back(j);
      });
    }
    if (part.size() > cells_.size()) cells_ = std::move(part);
  }
  if (cells_.empty()) {
    throw InputError(place.name + ": no free place in this map that a robot fits into");
  }
  std::fill(open_.begin(), open_.end(), 0);
  for (const std::size_t i : cells_) open_[i] = 1;
}

Pose2 Ground::draw(RandomStream& rng) const {
  const Point2 p = centreOf(drawCell(rng));
  return {p.x, p.y, rng.uniform(-kPi, kPi)};
}

std::size_t Ground::drawCell(RandomStream& rng) const {
  return cells_[static_cast<std::size_t>(rng.uniform() * static_cast<double>(cells_.size()))];
}

std::vector<int> Ground::stepsTo(std::size_t goal) const {
  std::vector<int> steps(open_.size(), -1);
  std::vector<std::size_t> front{goal};
  steps[goal] = 0;
  for (std::size_t next = 0; next < front.size(); ++next) {
    forNeighbours(front[next], [&](std::size_t j) {
      if (open_[j] == 0 || steps[j] >= 0) return;
      steps[j] = steps[front[next]] + 1;
      front.push_back(j);
    });
  }
  return steps;
}

std::optional<Point2> Ground::ahead(const std::vector<int>& steps, const Point2& p) const {
  std::size_t i = nearestOpen(p);
  const int wanted = steps[i] - static_cast<int>(0.5 / map_.resolution());
  if (wanted <= 0) return std::nullopt;
  while (steps[i] > wanted) {
    std::size_t best = i;
    forNeighbours(i, [&](std::size_t j) {
      if (steps[j] >= 0 && steps[j] < steps[best]) best = j;
    });
    i = best;
  }
  return centreOf(i);
}

std::optional<Point2> Ground::towards(const Point2& from, const Point2& to) const {
  constexpr double kAround_m = 1.5;
  constexpr double kNearer_m = 0.1;
  struct Reached {
    std::size_t cell;
    std::size_t before;  // in the list
    int steps;
  };
  std::vector<Reached> reached{{nearestOpen(from), 0, 0}};
  std::set<std::size_t> seen{reached.front().cell};
  const auto off = [&](std::size_t i) {
    return std::hypot(centreOf(i).x - to.x, centreOf(i).y - to.y);
  };
  std::size_t best = 0;
  for (std::size_t next = 0; next < reached.size(); ++next) {
    const Reached at = reached[next];
    if (off(at.cell) < off(reached[best].cell)) best = next;
    if (at.steps * map_.resolution() > kAround_m) continue;
    forNeighbours(at.cell, [&](std::size_t j) {
      if (open_[j] != 0 && seen.insert(j).second) reached.push_back({j, next, at.steps + 1});
    });
  }
  if (off(reached[best].cell) > off(reached.front().cell) - kNearer_m) return std::nullopt;
  while (!straight(reached.front().cell, reached[best].cell)) best = reached[best].before;
  return centreOf(reached[best].cell);
}

bool Ground::straight(std::size_t from, std::size_t to) const {
  const auto x = [&](std::size_t i) { return static_cast<double>(i % width()); };
  const auto y = [&](std::size_t i) { return static_cast<double>(i / width()); };
  const double steps = 2.0 * std::max(std::abs(x(to) - x(from)), std::abs(y(to) - y(from)));
  for (double k = 1.0; k <= steps; ++k) {
    const double u = x(from) + k / steps * (x(to) - x(from));
    const double v = y(from) + k / steps * (y(to) - y(from));
    const auto i = static_cast<std::size_t>(std::lround(v)) * width() +
                   static_cast<std::size_t>(std::lround(u));
    if (open_[i] == 0 && i != from) return false;
  }
  return true;
}

Point2 Ground::centreOf(std::size_t i) const {
  return transform(
      map_.T_map_grid(),
      {map_.corner().x + (static_cast<double>(i % width()) + 0.5) * map_.resolution(),
       map_.corner().y + (static_cast<double>(i / width()) + 0.5) * map_.resolution()});
}

std::size_t Ground::nearestOpen(const Point2& p_map) const {
  const Point2 p = transform(inverse(map_.T_map_grid()), p_map);
  const int cx = static_cast<int>(std::floor((p.x - map_.corner().x) / map_.resolution()));
  const int cy = static_cast<int>(std::floor((p.y - map_.corner().y) / map_.resolution()));
  std::size_t best = cells_.front();
  double best_d2 = std::numeric_limits<double>::max();
  constexpr int kAround = 12;
  for (int iy = std::max(0, cy - kAround); iy <= std::min(map_.height() - 1, cy + kAround); ++iy) {
    for (int ix = std::max(0, cx - kAround); ix <= std::min(map_.width() - 1, cx + kAround); ++ix) {
      const std::size_t i = static_cast<std::size_t>(iy) * width() + static_cast<std::size_t>(ix);
      const double d2 = (ix - cx) * (ix - cx) + (iy - cy) * (iy - cy);
      if (open_[i] == 0 || d2 >= best_d2) continue;
      best = i;
      best_d2 = d2;
    }
  }
  return best;
}

Wanderer::Wanderer(
    const LostPlace& place, const Ground& ground, const Pose2& T_map_base, const RandomStream& rng)
    : place_(place), ground_(ground), truth_(T_map_base), rng_(rng) {
  range_max_m_ = rng_.uniform(10.0, 12.0);
  outliers_ = rng_.uniform(0.10, 0.15);
  scale_ = rng_.normal(1.0, 0.03);
  yaw_scale_ = rng_.normal(1.0, 0.03);
  yaw_drift_per_m_ = rng_.normal(0.0, degToRad(1.0));
}

void Wanderer::carryTo(const Pose2& T_map_base) {
  truth_ = T_map_base;
  steps_.clear();
}

WheelOdometry Wanderer::drive(const std::optional<Point2>& goal_base) {
  blocked_ = false;
  const Pose2 step = goal_base ? stepTowards(*goal_base) : nextStep();
  truth_ = compose(truth_, step);
  driven_m_ += step.x;
  time_ = time_ + durationFromSeconds(kWandererTick_s);
  WheelOdometry odometry;
  odometry.stamp = time_;
  odometry.dt_s = kWandererTick_s;
  odometry.T_previous_now = {
      step.x * (scale_ + rng_.normal(0.0, 0.05)),
      step.x * rng_.normal(0.0, 0.02),
      step.phi * (yaw_scale_ + rng_.normal(0.0, 0.05)) + step.x * yaw_drift_per_m_ +
          step.x * rng_.normal(0.0, degToRad(2.0))};
  return odometry;
}

LaserScan Wanderer::scan() {
  LaserScan scan;
  scan.stamp = time_;
  scan.T_base_laser = {0.1, 0.0, 0.0};
  scan.angle_min_rad = -0.75 * kPi;
  scan.angle_step_rad = kRadPerDeg;
  scan.range_min_m = 0.05;
  scan.range_max_m = range_max_m_;
  const Pose2 T_map_laser = compose(truth_, scan.T_base_laser);
  for (int i = 0; i <= 270; ++i) {
    const double yaw = T_map_laser.phi + scan.angle(static_cast<std::size_t>(i));
    double range = place_.ray({T_map_laser.x, T_map_laser.y}, yaw, range_max_m_);
    if (rng_.bernoulli(outliers_)) range = rng_.uniform(0.2, std::max(0.3, range));
    range = range < range_max_m_ ? std::max(0.05, range + rng_.normal(0.0, 0.02))
                                 : std::numeric_limits<double>::infinity();
    scan.ranges_m.push_back(static_cast<float>(range));
  }
  return scan;
}

Pose2 Wanderer::stepTowards(const Point2& goal_base) {
  steps_.clear();
  const auto target = ground_.towards({truth_.x, truth_.y}, transform(truth_, goal_base));
  blocked_ = !target;
  return target ? stepTo(*target) : Pose2{};
}

Pose2 Wanderer::nextStep() {
  if (steps_.empty()) steps_ = ground_.stepsTo(ground_.drawCell(rng_));
  const auto target = ground_.ahead(steps_, {truth_.x, truth_.y});
  if (!target) {
    steps_.clear();  // arrived
    return {};
  }
  return stepTo(*target);
}

Pose2 Wanderer::stepTo(const Point2& target) const {
  const double bearing =
      angleDiff(std::atan2(target.y - truth_.y, target.x - truth_.x), truth_.phi);
  const double turn =
      std::clamp(bearing, -kTurn_radps * kWandererTick_s, kTurn_radps * kWandererTick_s);
  const double forward = std::abs(bearing) < degToRad(30.0) ? kSpeed_mps * kWandererTick_s : 0.0;
  return {forward, 0.0, turn};
}

}  // namespace vestibule::pipeline
