#include "vestibule/gui_headless/overview.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "canvas.hpp"
#include "layers.hpp"
#include "palette.hpp"
#include "reference.hpp"
#include "text.hpp"
#include "vestibule/core/angles.hpp"

namespace vestibule::gui_headless {
namespace {

using Px = Canvas::Px;
using LookAlign = Canvas::Align;

// 95 % of a planar Gaussian lies within this many standard deviations (chi-square, 2 dof: 5.991).
constexpr double kSigmas95 = 2.4477;

constexpr double kLayoutWidth = 1126.0;

class Box {
 public:
  void add(const Point2& p) {
    // Beyond any site; a filter that diverged that far would leave nothing else to see.
    constexpr double kFar_m = 1e7;
    if (!(std::abs(p.x) < kFar_m && std::abs(p.y) < kFar_m)) return;  // nor NaN
    x0_ = std::min(x0_, p.x);
    x1_ = std::max(x1_, p.x);
    y0_ = std::min(y0_, p.y);
    y1_ = std::max(y1_, p.y);
  }
  void add(const Pose2& T) { add(Point2(T.x, T.y)); }
  [[nodiscard]] bool empty() const { return x1_ < x0_; }
  [[nodiscard]] Point2 centre() const { return {0.5 * (x0_ + x1_), 0.5 * (y0_ + y1_)}; }
  [[nodiscard]] double width() const { return x1_ - x0_; }
  [[nodiscard]] double height() const { return y1_ - y0_; }

 private:
  double x0_ = std::numeric_limits<double>::infinity();
  double x1_ = -std::numeric_limits<double>::infinity();
  double y0_ = std::numeric_limits<double>::infinity();
  double y1_ = -std::numeric_limits<double>::infinity();
};

Box contentBox(
    const Scene& scene, const std::vector<PoseSample>& track, const StampedPoses& reference) {
  Box box;
  for (const PoseSample& sample : track) box.add(sample.T.mean);
  for (const auto& row : reference) box.add(row.second);
  for (const auto& waypoint : scene.waypoints) box.add(waypoint.second);
  for (const auto& wall : scene.truth_walls) {
    box.add(wall.first);
    box.add(wall.second);
  }
  for (const grid::OccupancyMap* map : scene.prior_maps) {
    for (const Point2& p : knownCorners(*map)) box.add(p);
  }
  if (scene.site != nullptr) {
    for (const auto& building : scene.site->buildings) {
      for (const Point2& p : building.outline) box.add(p);
    }
  }
  if (box.empty()) {
    for (const Point2& p : scene.gnss_fixes) box.add(p);
  }
  return box;
}

/// Points of a path without those closer than `spacing_px` to the one before; the last one stays.
std::vector<Px> spacedPath(const std::vector<Px>& path, double spacing_px) {
  std::vector<Px> kept;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const bool is_last = i + 1 == path.size();
    if (!kept.empty() && !is_last) {
      const Px d = path[i] - kept.back();
      if (std::hypot(d.x, d.y) < spacing_px) continue;
    }
    kept.push_back(path[i]);
  }
  return kept;
}

constexpr double kInvisible_px = 0.5;

struct Run {
  Mode mode;
  std::vector<Px> path;
};

std::vector<Run> runsByMode(const std::vector<PoseSample>& track, const View& view) {
  std::vector<Run> runs;
  for (const PoseSample& sample : track) {
    const Px p = view(sample.T.mean);
    if (runs.empty() || runs.back().mode != sample.mode) {
      if (!runs.empty()) runs.back().path.push_back(p);  // no gap at the change
      runs.push_back({sample.mode, {}});
    }
    runs.back().path.push_back(p);
  }
  for (Run& run : runs) run.path = spacedPath(run.path, kInvisible_px);
  return runs;
}

std::vector<Px> ellipse95(const PoseSample& sample, const View& view) {
  const Eigen::Matrix2d cov = sample.T.cov.topLeftCorner<2, 2>();
  if (!cov.allFinite()) return {};
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(cov);
  if (eigen.eigenvalues()(0) < 0.0 || eigen.eigenvalues()(1) <= 0.0) return {};
  const Eigen::Vector2d axes = kSigmas95 * eigen.eigenvalues().cwiseSqrt();
  const double major_px = axes(1) * view.pxPerMetre();
  // Smaller than the line it belongs to, or larger than the picture: shows nothing.
  if (major_px < 7.0 || major_px > view.area().width) return {};
  std::vector<Px> ring;
  for (int i = 0; i <= 48; ++i) {
    const double a = 2.0 * kPi * i / 48.0;
    const Eigen::Vector2d p =
        eigen.eigenvectors() * Eigen::Vector2d(axes(0) * std::cos(a), axes(1) * std::sin(a));
    ring.push_back(view(Point2(sample.T.mean.x + p.x(), sample.T.mean.y + p.y())));
  }
  return ring;
}

struct DrawnEllipse {
  Mode mode;
  std::vector<Px> ring;
};

std::vector<DrawnEllipse> ellipsesAlong(const std::vector<PoseSample>& track, const View& view) {
  constexpr double kEvery_px = 70.0;
  std::vector<DrawnEllipse> ellipses;
  double since = kEvery_px;
  for (std::size_t i = 0; i < track.size(); ++i) {
    if (i > 0) since += distance(track[i - 1].T.mean, track[i].T.mean) * view.pxPerMetre();
    if (since < kEvery_px) continue;
    since = 0.0;
    auto ring = ellipse95(track[i], view);
    if (!ring.empty()) ellipses.push_back({track[i].mode, std::move(ring)});
  }
  return ellipses;
}

/// What the legend shows; only what is in the picture.
struct LegendItem {
  enum class Mark { kLine, kDashes, kDots, kEllipse, kSwatch, kWaypoint, kDoor, kWall };
  Mark mark;
  std::string_view colour;
  std::string words;
};

constexpr double kLegendText = 13.0;
constexpr double kLegendRow = 26.0;
constexpr double kLegendMark = 30.0;

double legendItemWidth(const Canvas& canvas, const LegendItem& item) {
  const Canvas::TextLook look{kLegendText, palette::kInk};
  return kLegendMark + 8.0 + canvas.textWidth(item.words, look) + 22.0;
}

int legendRows(const Canvas& canvas, const std::vector<LegendItem>& items, double width) {
  int rows = items.empty() ? 0 : 1;
  double x = 0.0;
  for (const LegendItem& item : items) {
    const double w = legendItemWidth(canvas, item);
    if (x > 0.0 && x + w > width) {
      ++rows;
      x = 0.0;
    }
    x += w;
  }
  return rows;
}

void drawLegend(Canvas& canvas, const std::vector<LegendItem>& items, const cv::Rect2d& area) {
  double x = area.x;
  double y = area.y + 0.5 * kLegendRow;
  for (const LegendItem& item : items) {
    const double w = legendItemWidth(canvas, item);
    if (x > area.x && x + w > area.x + area.width) {
      x = area.x;
      y += kLegendRow;
    }
    const Px left(x, y);
    const Px right(x + kLegendMark, y);
    const Px middle(x + 0.5 * kLegendMark, y);
    switch (item.mark) {
      case LegendItem::Mark::kLine:
        canvas.line(left, right, item.colour, 4.0);
        break;
      case LegendItem::Mark::kWall:
        canvas.line(left, right, item.colour, 1.5);
        break;
      case LegendItem::Mark::kDashes:
        canvas.dashedPolyline({left, right}, item.colour, 1.5, 7.0, 4.5);
        break;
      case LegendItem::Mark::kDots:
        for (const double dx : {-10.0, -3.0, 4.0, 11.0}) {
          canvas.fillCircle(middle + Px(dx, dx > 0.0 ? -2.0 : 2.0), 2.0, item.colour);
        }
        break;
      case LegendItem::Mark::kEllipse:
        canvas.blend(0.18, [&] { canvas.fillCircle(middle, 8.0, item.colour); });
        canvas.strokeCircle(middle, 8.0, item.colour, 1.0);
        break;
      case LegendItem::Mark::kSwatch:
        canvas.fillRect({x + 5, y - 7, 20, 14}, item.colour);
        canvas.strokeRect({x + 5, y - 7, 20, 14}, palette::kFaint, 0.5);
        break;
      case LegendItem::Mark::kWaypoint:
        canvas.fillCircle(middle, 5.5, palette::kPaper);
        canvas.strokeCircle(middle, 5.5, item.colour, 2.0);
        break;
      case LegendItem::Mark::kDoor:
        canvas.line(left, right, item.colour, 4.5);
        break;
    }
    canvas.text(item.words, {x + kLegendMark + 8.0, y + 5.0}, {kLegendText, palette::kInk});
    x += w;
  }
}

std::vector<LegendItem> legendOf(
    const RunRecorder& run,
    const Scene& scene,
    const OverviewStyle& style,
    const std::vector<PoseSample>& track,
    const std::vector<DrawnEllipse>& ellipses,
    const StampedPoses& reference) {
  using Mark = LegendItem::Mark;
  std::vector<LegendItem> items;
  std::set<Mode> modes;
  for (const PoseSample& sample : track) modes.insert(sample.mode);
  for (const Mode mode : modes) {
    const std::string words = style.path_words.empty() ? modeName(mode) : style.path_words;
    items.push_back({Mark::kLine, colourOf(mode), words});
  }
  if (!reference.empty()) {
    const std::string usual = scene.reference.empty() ? "ground truth" : "reference";
    const std::string words = style.reference_words.empty() ? usual : style.reference_words;
    items.push_back({Mark::kDashes, palette::kInk, words});
  }
  if (!ellipses.empty()) {
    items.push_back({Mark::kEllipse, colourOf(ellipses.front().mode), "95 % of position"});
  }
  if (style.particles && !run.snapshots().empty()) {
    items.push_back({Mark::kDots, palette::kParticle, "particles"});
  }
  if (!scene.gnss_fixes.empty()) items.push_back({Mark::kDots, palette::kFaint, "raw GNSS fixes"});
  if (!scene.waypoints.empty()) items.push_back({Mark::kWaypoint, palette::kInk, "waypoint"});
  if (!scene.prior_maps.empty()) items.push_back({Mark::kSwatch, palette::kWall, "map: occupied"});
  if (!scene.truth_walls.empty()) {
    items.push_back({Mark::kWall, palette::kTruthWall, "true walls"});
  }
  bool any[2] = {false, false};
  for (const Scene::Closure& c : scene.closures) any[c.accepted ? 1 : 0] = true;
  if (any[1]) items.push_back({Mark::kWall, palette::kDoor, "place recognised again"});
  if (any[0]) items.push_back({Mark::kWall, palette::kLost, "refused"});
  if (scene.site != nullptr && !scene.site->buildings.empty()) {
    items.push_back({Mark::kWall, palette::kBuilding, "building"});
  }
  if (scene.site != nullptr && !scene.site->doors.empty()) {
    items.push_back({Mark::kDoor, palette::kDoor, "door"});
  }
  return items;
}

void drawWaypointMark(Canvas& canvas, const View& view, const Pose2& T_map_waypoint) {
  const Px p = view(T_map_waypoint);
  const Px heading(std::cos(T_map_waypoint.phi), -std::sin(T_map_waypoint.phi));
  canvas.line(p, p + heading * 15.0, palette::kPaper, 4.5);
  canvas.line(p, p + heading * 14.0, palette::kInk, 2.0);
  canvas.fillCircle(p, 6.5, palette::kPaper);
  canvas.strokeCircle(p, 5.5, palette::kInk, 2.0);
}

void drawMapArea(
    Canvas& canvas,
    const View& view,
    const RunRecorder& run,
    const Scene& scene,
    const OverviewStyle& style,
    const std::vector<PoseSample>& track,
    const std::vector<DrawnEllipse>& ellipses,
    const StampedPoses& reference) {
  canvas.fillRect(view.area(), palette::kGround);
  drawGrid(canvas, view);
  if (scene.site != nullptr) drawBuildingFill(canvas, view, *scene.site);
  for (const grid::OccupancyMap* map : scene.prior_maps) drawPriorMap(canvas, view, *map);
  for (const auto& wall : scene.truth_walls) {
    canvas.line(view(wall.first), view(wall.second), palette::kTruthWall, 1.5);
  }
  if (scene.site != nullptr) {
    drawBuildingLines(canvas, view, *scene.site);
    drawDoors(canvas, view, *scene.site);
  }
  canvas.blend(0.5, [&] {
    for (const Point2& fix : scene.gnss_fixes) canvas.fillCircle(view(fix), 1.8, palette::kFaint);
  });
  if (style.particles) {
    canvas.blend(0.3, [&] {
      for (const ParticleSnapshot& snapshot : run.snapshots()) {
        for (const Pose2& T : snapshot.T_map_particles) {
          canvas.fillCircle(view(T), 1.7, palette::kParticle);
        }
      }
    });
  }
  canvas.blend(0.13, [&] {
    for (const auto& e : ellipses) canvas.fillPolygon(e.ring, colourOf(e.mode));
  });
  canvas.blend(0.6, [&] {
    for (const auto& e : ellipses) canvas.polyline(e.ring, colourOf(e.mode), 0.8);
  });
  const auto runs = runsByMode(track, view);
  canvas.blend(0.8, [&] {
    for (const auto& part : runs) canvas.polyline(part.path, palette::kPaper, 7.0);
  });
  for (const auto& part : runs) canvas.polyline(part.path, colourOf(part.mode), 4.2);
  canvas.blend(0.7, [&] {
    for (const Scene::Closure& c : scene.closures) {
      canvas.line(view(c.from), view(c.to), c.accepted ? palette::kDoor : palette::kLost, 1.2);
    }
  });
  std::vector<Px> truth;
  for (const auto& row : reference) truth.push_back(view(row.second));
  canvas.dashedPolyline(spacedPath(truth, kInvisible_px), palette::kInk, 0.9, 6.0, 6.0);

  LabelPlacer labels(view.area());
  drawScaleBar(canvas, view, labels);
  drawNorthArrow(canvas, view, labels);
  drawGridLabels(canvas, view, labels);
  for (const auto& part : runs) labels.avoid(spacedPath(part.path, 5.0));
  const Canvas::TextLook name{13.0, palette::kInk, false, true};
  for (const auto& waypoint : scene.waypoints) {
    const Px p = view(waypoint.second);
    labels.block({p.x - 7, p.y - 7, 14, 14});
  }
  for (const auto& waypoint : scene.waypoints) drawWaypointMark(canvas, view, waypoint.second);
  if (!track.empty()) {
    const Px start = view(track.front().T.mean);
    const Px end = view(track.back().T.mean);
    canvas.fillCircle(start, 9.0, palette::kPaper);
    canvas.fillCircle(start, 7.0, palette::kInk);
    canvas.fillRect({end.x - 8, end.y - 8, 16, 16}, palette::kPaper);
    canvas.fillRect({end.x - 6, end.y - 6, 12, 12}, palette::kInk);
    labels.block({start.x - 8, start.y - 8, 16, 16});
    labels.block({end.x - 8, end.y - 8, 16, 16});
    const Canvas::TextLook look{13.0, palette::kInk, true, true};
    if (std::hypot(start.x - end.x, start.y - end.y) < 16.0) {
      labels.draw(canvas, "start, end", end, 13.0, look);
    } else {
      labels.draw(canvas, "start", start, 13.0, look);
      labels.draw(canvas, "end", end, 13.0, look);
    }
  }
  std::set<std::string> named;  // a mission may come back to the same waypoint
  for (const auto& waypoint : scene.waypoints) {
    const Px p = view(waypoint.second);
    const std::string key = waypoint.first + "@" + fixed(p.x, 0) + "," + fixed(p.y, 0);
    if (named.insert(key).second) labels.draw(canvas, waypoint.first, p, 12.0, name);
  }
  if (scene.site != nullptr) {
    for (const auto& door : scene.site->doors) {
      labels.draw(canvas, door.name, view(door.centre()), 9.0, {12.0, palette::kDoor, false, true});
    }
    for (const auto& building : scene.site->buildings) {
      Box box;
      for (const Point2& p : building.outline) box.add(p);
      if (box.empty()) continue;
      const Px top = view(Point2(box.centre().x, box.centre().y + 0.5 * box.height()));
      labels.draw(
          canvas, building.name, {top.x, top.y - 12}, 1.0, {12.0, palette::kMuted, true, true});
    }
  }
}

}  // namespace

std::string renderOverview(const RunRecorder& run, const Scene& scene, const OverviewStyle& style) {
  const std::vector<PoseSample> track = run.primaryPoses();
  const StampedPoses reference = referenceOf(run, scene);
  const Box box = contentBox(scene, track, reference);

  // Laid out for the text column of the report, whatever the number of pixels.
  const int width_px = std::max(320, style.width_px);
  const double density = width_px / kLayoutWidth;
  const double pad = style.title.empty() ? 1.0 : 14.0;
  const double map_width = kLayoutWidth - 2.0 * pad;
  const double header = style.title.empty() ? pad : 46.0;

  // Room for labels around the content, and never a view so close that noise looks like motion.
  const double content_width = std::max(box.empty() ? 0.0 : 1.12 * box.width(), 4.0);
  const double content_height = std::max(box.empty() ? 0.0 : 1.12 * box.height(), 3.0);
  const double lowest = 0.4 * map_width;
  const double highest = 0.72 * map_width;
  const double map_height = std::clamp(map_width * content_height / content_width, lowest, highest);
  const double px_per_m = std::min(map_width / content_width, map_height / content_height);
  const cv::Rect2d area(pad, header, map_width, std::round(map_height));
  const View view(area, box.empty() ? Point2(0.0, 0.0) : box.centre(), px_per_m);

  const auto ellipses = style.ellipses ? ellipsesAlong(track, view) : std::vector<DrawnEllipse>{};
  const auto legend = legendOf(run, scene, style, track, ellipses, reference);
  const Canvas ruler(1, 1, density, palette::kPaper);
  const double legend_height = legendRows(ruler, legend, map_width) * kLegendRow;
  const double footer = legend.empty() ? pad : legend_height + 18.0;
  Canvas canvas(
      width_px,
      static_cast<int>(std::lround(density * (header + map_height + footer))),
      density,
      palette::kPaper);
  if (!style.title.empty()) {
    canvas.text(style.title, {pad, 30.0}, {19.0, palette::kInk, false, false});
  }
  canvas.clipped(area, [&] {
    if (box.empty()) {
      canvas.fillRect(area, palette::kGround);
      canvas.text(
          "no poses recorded",
          {area.x + 0.5 * area.width, area.y + 0.5 * area.height},
          {16.0, palette::kMuted, false, false, LookAlign::kCentre});
    } else {
      drawMapArea(canvas, view, run, scene, style, track, ellipses, reference);
    }
  });
  canvas.strokeRect(area, palette::kLine, 1.0);
  drawLegend(canvas, legend, {pad, header + area.height + 12.0, map_width, legend_height});
  return canvas.png();
}

}  // namespace vestibule::gui_headless
