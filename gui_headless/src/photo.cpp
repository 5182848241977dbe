#include <cmath>

#include "canvas.hpp"
#include "layers.hpp"
#include "palette.hpp"
#include "text.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/gui_headless/overview.hpp"

namespace vestibule::gui_headless {
namespace {

using Px = Canvas::Px;

void drawRobot(Canvas& canvas, const View& view, const PhotoView& photo) {
  const double l = photo.robot_half_length_m;
  const double w = photo.robot_half_width_m;
  const auto at = [&](double x, double y) {
    return view(transform(photo.T_map_base, Point2(x, y)));
  };
  const std::vector<Px> body = {at(l, w), at(-l, w), at(-l, -w), at(l, -w)};
  canvas.fillPolygon(body, palette::kPaper);
  canvas.blend(0.85, [&] { canvas.fillPolygon(body, palette::kOutdoor); });
  canvas.polyline({body[0], body[1], body[2], body[3], body[0]}, palette::kInk, 1.5);
  canvas.fillPolygon({at(0.75 * l, 0), at(-0.1 * l, 0.6 * w), at(-0.1 * l, -0.6 * w)}, "#ffffff");
  canvas.line(at(l, 0), at(l + 0.8, 0), palette::kInk, 1.5);
}

}  // namespace

std::string renderPhoto(const PhotoView& photo, const Scene& scene) {
  const int size_px = std::max(240, photo.size_px);
  constexpr double kSize = 540.0;
  constexpr double kCaption = 60.0;
  const double density = size_px / kSize;
  const int height_px = static_cast<int>(std::lround(density * (kSize + kCaption)));
  Canvas canvas(size_px, height_px, density, palette::kPaper);
  const cv::Rect2d area(0.0, 0.0, kSize, kSize);
  const View view(
      area, Point2(photo.T_map_base.x, photo.T_map_base.y), 0.5 * kSize / photo.radius_m);
  canvas.clipped(area, [&] {
    canvas.fillRect(area, palette::kGround);
    drawGrid(canvas, view);
    if (scene.site != nullptr) drawBuildingFill(canvas, view, *scene.site);
    for (const grid::OccupancyMap* map : scene.prior_maps) drawPriorMap(canvas, view, *map);
    if (scene.site != nullptr) {
      drawBuildingLines(canvas, view, *scene.site);
      drawDoors(canvas, view, *scene.site);
    }
    std::vector<Px> echoes;
    for (const Point2& p : photo.p_base_scan)
      echoes.push_back(view(transform(photo.T_map_base, p)));
    const Px robot = view(photo.T_map_base);
    canvas.blend(0.1, [&] {
      for (const Px& p : echoes) canvas.line(robot, p, palette::kOutdoor, 0.9);
    });
    for (const Px& p : echoes) canvas.fillCircle(p, 1.9, palette::kLost);
    drawRobot(canvas, view, photo);
    LabelPlacer labels(area);
    drawScaleBar(canvas, view, labels);
    drawNorthArrow(canvas, view, labels);
    labels.block({0.5 * kSize - 40, 0.5 * kSize - 40, 80, 80});
    for (const auto& waypoint : scene.waypoints) {
      const Px p = view(waypoint.second);
      // The one the robot stands on is named in the caption.
      const bool is_under_robot = std::hypot(p.x - robot.x, p.y - robot.y) < 40.0;
      if (!area.contains(p) || is_under_robot) continue;
      canvas.strokeCircle(p, 5.5, palette::kInk, 2.0);
      labels.draw(canvas, waypoint.first, p, 12.0, {13.0, palette::kInk, false, true});
    }
  });
  canvas.line({0.0, kSize}, {kSize, kSize}, palette::kLine, 1.0);
  const std::string name = photo.waypoint.empty() ? "view around the robot" : photo.waypoint;
  canvas.text(name, {16.0, kSize + 25.0}, {16.0, palette::kInk, true, false});
  const Pose2& T = photo.T_map_base;
  const std::string facts = "t = " + fixed(toSeconds(photo.stamp), 1) +
                            " s    x = " + fixed(T.x, 2) + " m    y = " + fixed(T.y, 2) +
                            " m    yaw = " + fixed(radToDeg(wrapToPi(T.phi)), 1) + " deg";
  canvas.text(facts, {16.0, kSize + 47.0}, {12.5, palette::kMuted, false, false});
  return canvas.png();
}

}  // namespace vestibule::gui_headless
