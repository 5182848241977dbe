#include "vestibule/gui_headless/map_sheet.hpp"

#include <algorithm>
#include <cmath>

#include "canvas.hpp"
#include "layers.hpp"
#include "palette.hpp"

namespace vestibule::gui_headless {
namespace {

constexpr double kGap = 10.0;
constexpr double kLine = 12.5;
constexpr double kRim = 1.04;
constexpr double kDensity = 1.5;
constexpr double kMark = 2.6;

/// What is known of a map: centre and sides [m].
struct Extent {
  Point2 centre;
  double width_m = 0.0;
  double height_m = 0.0;
};

Extent extentOf(const grid::OccupancyMap& map) {
  const std::vector<Point2> corners = knownCorners(map);
  if (corners.empty()) return {};
  Point2 low = corners.front();
  Point2 high = low;
  for (const Point2& p : corners) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  return {Point2(0.5 * (low.x + high.x), 0.5 * (low.y + high.y)), high.x - low.x, high.y - low.y};
}

std::string_view colourOf(MapMark::Look look) {
  switch (look) {
    case MapMark::Look::kGood:
      return palette::kDoor;
    case MapMark::Look::kOpen:
      return palette::kIndoor;
    case MapMark::Look::kBad:
      break;
  }
  return palette::kLost;
}

/// The worse, the larger and the later.
void drawMarks(Canvas& canvas, const View& view, const std::vector<MapMark>& marks) {
  for (const auto look : {MapMark::Look::kGood, MapMark::Look::kOpen, MapMark::Look::kBad}) {
    const double radius = look == MapMark::Look::kGood ? kMark : 1.6 * kMark;
    for (const MapMark& mark : marks) {
      if (mark.look == look) canvas.fillCircle(view(mark.p_map), radius, colourOf(look));
    }
  }
}

}  // namespace

std::string renderMapSheet(const std::vector<MapPanel>& panels, int columns, double width) {
  if (panels.empty()) return {};
  double width_m = 1.0;
  double height_m = 1.0;
  for (const MapPanel& panel : panels) {
    const Extent e = extentOf(*panel.map);
    width_m = std::max(width_m, kRim * e.width_m);
    height_m = std::max(height_m, kRim * e.height_m);
  }
  const double px_per_m = width / width_m;
  const double panel_height = std::clamp(px_per_m * height_m, 0.25 * width, 2.0 * width);
  const double scale = std::min(px_per_m, panel_height / height_m);
  std::size_t most_lines = 0;
  for (const MapPanel& panel : panels) most_lines = std::max(most_lines, panel.lines.size());
  const double caption = kLine * static_cast<double>(most_lines) + 4.0;
  const auto n = static_cast<int>(panels.size());
  const int across = std::min(columns, n);
  const int rows = (n + across - 1) / across;
  Canvas canvas(
      static_cast<int>(std::lround(kDensity * (across * (width + kGap) + kGap))),
      static_cast<int>(std::lround(kDensity * (rows * (panel_height + caption + kGap) + kGap))),
      kDensity,
      palette::kPaper);
  for (int k = 0; k < n; ++k) {
    const MapPanel& panel = panels[static_cast<std::size_t>(k)];
    const double x = kGap + (k % across) * (width + kGap);
    const double y = kGap + (k / across) * (panel_height + caption + kGap);
    const cv::Rect2d area(x, y, width, panel_height);
    const View view{area, extentOf(*panel.map).centre, scale};
    canvas.clipped(area, [&] {
      canvas.fillRect(area, palette::kGround);
      drawPriorMap(canvas, view, *panel.map);
      drawMarks(canvas, view, panel.marks);
      LabelPlacer labels(area);
      if (k == 0) drawScaleBar(canvas, view, labels);
    });
    canvas.strokeRect(area, palette::kLine, 1.0);
    double line_y = y + panel_height;
    for (const std::string& line : panel.lines) {
      line_y += kLine;
      canvas.text(line, {x, line_y}, {9.5, palette::kInk, false, false});
    }
  }
  return canvas.png();
}

}  // namespace vestibule::gui_headless
