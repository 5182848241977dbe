#include "layers.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "palette.hpp"
#include "text.hpp"

namespace vestibule::gui_headless {
namespace {

using Px = Canvas::Px;

cv::Vec3d bgrOf(std::string_view colour) {
  const auto channel = [&](std::size_t at) {
    return static_cast<double>(std::stoi(std::string(colour.substr(at, 2)), nullptr, 16));
  };
  return {channel(5), channel(3), channel(1)};
}

std::vector<Px> pixels(const View& view, const geo::Polygon& polygon) {
  std::vector<Px> corners;
  for (const Point2& p : polygon) corners.push_back(view(p));
  return corners;
}

/// A rectangle of a map's cells.
struct CellRange {
  int x0 = 0, y0 = 0, columns = 0, rows = 0;
};

/// The cells that the view shows, with some more around them.
CellRange shownCells(const View& view, const grid::OccupancyMap& map, int margin) {
  const Pose2 T_grid_map = inverse(map.T_map_grid());
  double x0 = std::numeric_limits<double>::infinity();
  double y0 = x0;
  double x1 = -x0;
  double y1 = -x0;
  for (const double x : {view.west(), view.east()}) {
    for (const double y : {view.south(), view.north()}) {
      const Point2 p_grid = transform(T_grid_map, Point2(x, y));
      x0 = std::min(x0, p_grid.x);
      x1 = std::max(x1, p_grid.x);
      y0 = std::min(y0, p_grid.y);
      y1 = std::max(y1, p_grid.y);
    }
  }
  const auto column = [&](double x) {
    const double cell = std::floor((x - map.corner().x) / map.resolution());
    return std::clamp(cell, -1e6, 1e6);
  };
  const auto row = [&](double y) {
    const double cell = std::floor((y - map.corner().y) / map.resolution());
    return std::clamp(cell, -1e6, 1e6);
  };
  CellRange range;
  range.x0 = std::max(0, static_cast<int>(column(x0)) - margin);
  range.y0 = std::max(0, static_cast<int>(row(y0)) - margin);
  range.columns = std::min(map.width(), static_cast<int>(column(x1)) + 1 + margin) - range.x0;
  range.rows = std::min(map.height(), static_cast<int>(row(y1)) + 1 + margin) - range.y0;
  return range;
}

/// Shares of the occupied and of the known cells, 0..255, block x block cells to a pixel; row 0 is
/// the southern one. What a block has beyond the range counts as unknown.
std::pair<cv::Mat, cv::Mat> averaged(
    const grid::OccupancyMap& map, const CellRange& range, int block) {
  const int w = (range.columns + block - 1) / block;
  const int h = (range.rows + block - 1) / block;
  cv::Mat occupied(h, w, CV_8U);
  cv::Mat known(h, w, CV_8U);
  std::vector<int> occupied_cells(static_cast<std::size_t>(w));
  std::vector<int> known_cells(static_cast<std::size_t>(w));
  for (int y = 0; y < h; ++y) {
    std::fill(occupied_cells.begin(), occupied_cells.end(), 0);
    std::fill(known_cells.begin(), known_cells.end(), 0);
    for (int row = y * block; row < std::min(range.rows, (y + 1) * block); ++row) {
      for (int column = 0; column < range.columns; ++column) {
        const grid::Cell cell = map.cell(range.x0 + column, range.y0 + row);
        const auto x = static_cast<std::size_t>(column / block);
        occupied_cells[x] += cell == grid::Cell::kOccupied ? 1 : 0;
        known_cells[x] += cell == grid::Cell::kUnknown ? 0 : 1;
      }
    }
    for (int x = 0; x < w; ++x) {
      const auto share = [&](const std::vector<int>& cells) {
        return static_cast<uchar>(255 * cells[static_cast<std::size_t>(x)] / (block * block));
      };
      occupied.at<uchar>(y, x) = share(occupied_cells);
      known.at<uchar>(y, x) = share(known_cells);
    }
  }
  return {occupied, known};
}

}  // namespace

double LabelPlacer::cost(const cv::Rect2d& rect) const {
  const cv::Rect2d roomy(rect.x - 3, rect.y - 2, rect.width + 6, rect.height + 4);
  double sum = 1e6 * (1.0 - (roomy & area_).area() / roomy.area());
  for (const cv::Rect2d& other : taken_) sum += 10.0 * (roomy & other).area();
  for (const Px& p : avoided_) sum += roomy.contains(p) ? 5.0 : 0.0;
  return sum;
}

void LabelPlacer::draw(
    Canvas& canvas, const std::string& words, Px anchor, double gap, const Canvas::TextLook& look) {
  const double w = canvas.textWidth(words, look);
  const double h = look.size;
  cv::Rect2d best;
  double least = std::numeric_limits<double>::infinity();
  for (const double ring : {1.0, 1.8, 2.8}) {
    const double g = ring * gap;
    const double d = 0.75 * g;
    const std::vector<Px> corners = {
        {g, -0.5 * h},
        {-g - w, -0.5 * h},
        {-0.5 * w, -g - h},
        {-0.5 * w, g},
        {d, -d - h},
        {d, d},
        {-d - w, -d - h},
        {-d - w, d}};
    for (const Px& corner : corners) {
      const cv::Rect2d rect(anchor.x + corner.x, anchor.y + corner.y, w, h);
      const double price = cost(rect) + 4.0 * (ring - 1.0);  // near is better
      if (price >= least) continue;
      least = price;
      best = rect;
    }
  }
  taken_.push_back(best);
  Canvas::TextLook left = look;
  left.align = Canvas::Align::kLeft;
  canvas.text(words, {best.x, best.y + 0.86 * h}, left);
}

void drawGrid(Canvas& canvas, const View& view) {
  const int wanted = std::max(2, static_cast<int>(view.area().width / 130.0));
  const Ticks x = niceTicks(view.west(), view.east(), wanted);
  const cv::Rect2d& a = view.area();
  for (const double v : x.values) {
    const double px = view(Point2(v, 0.0)).x;
    canvas.line({px, a.y}, {px, a.y + a.height}, palette::kLine, 0.5);
  }
  const auto first = static_cast<long long>(std::ceil(view.south() / x.step));
  const auto last = static_cast<long long>(std::floor(view.north() / x.step));
  for (long long i = first; i <= last; ++i) {
    const double py = view(Point2(0.0, static_cast<double>(i) * x.step)).y;
    canvas.line({a.x, py}, {a.x + a.width, py}, palette::kLine, 0.5);
  }
}

void drawGridLabels(Canvas& canvas, const View& view, LabelPlacer& labels) {
  const cv::Rect2d& a = view.area();
  const int wanted = std::max(2, static_cast<int>(a.width / 130.0));
  const Ticks x = niceTicks(view.west(), view.east(), wanted);
  Canvas::TextLook look{11.0, palette::kMuted, false, true, Canvas::Align::kCentre};
  for (const double v : x.values) {
    const double px = view(Point2(v, 0.0)).x;
    if (px < a.x + 30 || px > a.x + a.width - 40) continue;
    const std::string words = fixed(v, x.decimals);
    canvas.text(words, {px, a.y + a.height - 7}, look);
    labels.block({px - 25, a.y + a.height - 20, 50, 20});
  }
  look.align = Canvas::Align::kLeft;
  const auto first = static_cast<long long>(std::ceil(view.south() / x.step));
  const auto last = static_cast<long long>(std::floor(view.north() / x.step));
  for (long long i = first; i <= last; ++i) {
    const double v = static_cast<double>(i) * x.step;
    const double py = view(Point2(0.0, v)).y;
    if (py > a.y + a.height - 30 || py < a.y + 14) continue;
    const std::string words = fixed(v, x.decimals);
    canvas.text(words, {a.x + 7, py + 4}, look);
    labels.block({a.x, py - 8, canvas.textWidth(words, look) + 14, 16});
  }
}

void drawPriorMap(Canvas& canvas, const View& view, const grid::OccupancyMap& map) {
  // Where many cells share a pixel, average them first, and strengthen walls of one cell's width
  // so that they do not fade away.
  const double px_per_cell = canvas.scale() * view.pxPerMetre() * map.resolution();
  const double shrink = std::max(1.0, 1.0 / px_per_cell);
  const int block = static_cast<int>(shrink);
  const CellRange shown = shownCells(view, map, 2 * block);
  if (shown.columns <= 0 || shown.rows <= 0) return;
  auto [occupied, known] = averaged(map, shown, block);
  if (occupied.empty()) return;  // smaller than a pixel
  const double gain = shrink > 1.0 ? std::min(1.5 * shrink, 6.0) : 1.0;
  const cv::Size cells = occupied.size() * block;
  if (shrink > block) {
    const cv::Size size(
        std::max(1, static_cast<int>(std::lround(cells.width / shrink))),
        std::max(1, static_cast<int>(std::lround(cells.height / shrink))));
    cv::resize(occupied, occupied, size, 0.0, 0.0, cv::INTER_AREA);
    cv::resize(known, known, size, 0.0, 0.0, cv::INTER_AREA);
  }
  const cv::Vec3d paper = bgrOf(palette::kPaper);
  const cv::Vec3d wall = bgrOf(palette::kWall);
  cv::Mat image(occupied.size(), CV_8UC4);
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const double o = std::min(1.0, gain * occupied.at<uchar>(y, x) / 255.0);
      const double alpha = std::max(o, known.at<uchar>(y, x) / 255.0);
      const cv::Vec3d colour = ((1.0 - o) * paper + o * wall) * alpha;
      image.at<cv::Vec4b>(y, x) = {
          cv::saturate_cast<uchar>(colour[0]),
          cv::saturate_cast<uchar>(colour[1]),
          cv::saturate_cast<uchar>(colour[2]),
          cv::saturate_cast<uchar>(255.0 * alpha)};
    }
  }
  const double step_x = map.resolution() * cells.width / image.cols;
  const double step_y = map.resolution() * cells.height / image.rows;
  const Point2 first(
      map.corner().x + shown.x0 * map.resolution(), map.corner().y + shown.y0 * map.resolution());
  const auto toPixel = [&](double column, double row) {
    const Point2 p_grid(first.x + column * step_x, first.y + row * step_y);
    return view(transform(map.T_map_grid(), p_grid));
  };
  const Px origin = toPixel(0, 0);
  const Px along_x = toPixel(1, 0) - origin;
  const Px along_y = toPixel(0, 1) - origin;
  const cv::Matx23d M(along_x.x, along_y.x, origin.x, along_x.y, along_y.y, origin.y);
  canvas.overlay(image, M, px_per_cell < 2.0);
}

void drawBuildingFill(Canvas& canvas, const View& view, const geo::Site& site) {
  canvas.blend(0.5, [&] {
    for (const auto& building : site.buildings) {
      canvas.fillPolygon(pixels(view, building.outline), "#dde4ec");
    }
  });
}

void drawBuildingLines(Canvas& canvas, const View& view, const geo::Site& site) {
  for (const auto& building : site.buildings) {
    if (building.outline.empty()) continue;
    std::vector<Px> ring = pixels(view, building.outline);
    ring.push_back(ring.front());
    canvas.polyline(ring, palette::kBuilding, 1.0);
  }
}

void drawDoors(Canvas& canvas, const View& view, const geo::Site& site) {
  for (const auto& door : site.doors) {
    canvas.line(view(door.a), view(door.b), palette::kPaper, 7.5);
    canvas.line(view(door.a), view(door.b), palette::kDoor, 4.5);
  }
}

void drawScaleBar(Canvas& canvas, const View& view, LabelPlacer& labels) {
  const cv::Rect2d& a = view.area();
  // The largest nice length within a sixth of the picture.
  double length_m = niceStep(a.width / 6.0 / view.pxPerMetre());
  while (length_m * view.pxPerMetre() > a.width / 6.0 + 1.0) {
    length_m = niceStep(length_m * 0.4);
  }
  const double length = length_m * view.pxPerMetre();
  const double right = a.x + a.width - 28;
  const double y = a.y + a.height - 34;
  const cv::Rect2d plate(right - length - 16, y - 28, length + 32, 42);
  canvas.blend(0.85, [&] { canvas.fillRect(plate, palette::kPaper); });
  canvas.line({right - length, y}, {right, y}, palette::kInk, 2.0);
  canvas.line({right - length, y - 5}, {right - length, y + 5}, palette::kInk, 2.0);
  canvas.line({right, y - 5}, {right, y + 5}, palette::kInk, 2.0);
  const std::string words =
      length_m >= 1000.0 ? compact(length_m / 1000.0, 3) + " km" : compact(length_m, 3) + " m";
  canvas.text(
      words,
      {right - 0.5 * length, y - 10},
      {13.0, palette::kInk, false, false, Canvas::Align::kCentre});
  labels.block(plate);
}

void drawNorthArrow(Canvas& canvas, const View& view, LabelPlacer& labels) {
  const Px tip(view.area().x + view.area().width - 34, view.area().y + 34);
  canvas.blend(0.85, [&] { canvas.fillCircle({tip.x, tip.y + 12}, 30, palette::kPaper); });
  canvas.fillPolygon({tip, {tip.x - 9, tip.y + 26}, {tip.x, tip.y + 20}}, palette::kMuted);
  canvas.fillPolygon({tip, {tip.x + 9, tip.y + 26}, {tip.x, tip.y + 20}}, palette::kInk);
  canvas.text("N", {tip.x, tip.y - 4}, {12.0, palette::kInk, true, false, Canvas::Align::kCentre});
  labels.block({tip.x - 30, tip.y - 18, 60, 60});
}

std::vector<Point2> knownCorners(const grid::OccupancyMap& map) {
  int x0 = map.width();
  int x1 = -1;
  int y0 = map.height();
  int y1 = -1;
  for (int y = 0; y < map.height(); ++y) {
    for (int x = 0; x < map.width(); ++x) {
      if (map.cell(x, y) == grid::Cell::kUnknown) continue;
      x0 = std::min(x0, x);
      x1 = std::max(x1, x);
      y0 = std::min(y0, y);
      y1 = std::max(y1, y);
    }
  }
  std::vector<Point2> corners;
  if (x1 < 0) return corners;
  for (const int x : {x0, x1 + 1}) {
    for (const int y : {y0, y1 + 1}) {
      const Point2 p_grid(
          map.corner().x + x * map.resolution(), map.corner().y + y * map.resolution());
      corners.push_back(transform(map.T_map_grid(), p_grid));
    }
  }
  return corners;
}

}  // namespace vestibule::gui_headless
