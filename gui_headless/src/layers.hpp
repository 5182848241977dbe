#pragma once

#include <string>
#include <vector>

#include "canvas.hpp"
#include "vestibule/core/events.hpp"
#include "vestibule/geo/site.hpp"
#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::gui_headless {

/// Finds room for labels: of the places around a point the one that covers the least of the
/// earlier labels and of what should stay visible.
class LabelPlacer {
 public:
  explicit LabelPlacer(const cv::Rect2d& area) : area_(area) {}
  /// Never write here if there is any other place.
  void block(const cv::Rect2d& rect) { taken_.push_back(rect); }
  /// Rather not write over these points.
  void avoid(const std::vector<Canvas::Px>& points) {
    avoided_.insert(avoided_.end(), points.begin(), points.end());
  }
  void draw(
      Canvas& canvas,
      const std::string& words,
      Canvas::Px anchor,
      double gap,
      const Canvas::TextLook& look);

 private:
  [[nodiscard]] double cost(const cv::Rect2d& rect) const;

  cv::Rect2d area_;
  std::vector<cv::Rect2d> taken_;
  std::vector<Canvas::Px> avoided_;
};

/// Metre grid with coordinates along the left and the lower edge.
void drawGrid(Canvas& canvas, const View& view);
/// Edge labels of the grid; separate so that they can go on top of everything.
void drawGridLabels(Canvas& canvas, const View& view, LabelPlacer& labels);
/// Occupied cells dark, free cells white, unknown cells transparent.
void drawPriorMap(Canvas& canvas, const View& view, const grid::OccupancyMap& map);
void drawBuildingFill(Canvas& canvas, const View& view, const geo::Site& site);
void drawBuildingLines(Canvas& canvas, const View& view, const geo::Site& site);
void drawDoors(Canvas& canvas, const View& view, const geo::Site& site);
void drawScaleBar(Canvas& canvas, const View& view, LabelPlacer& labels);
void drawNorthArrow(Canvas& canvas, const View& view, LabelPlacer& labels);

/// Corners of the smallest upright grid rectangle with all known cells, in the map frame; empty
/// when nothing is known.
[[nodiscard]] std::vector<Point2> knownCorners(const grid::OccupancyMap& map);

}  // namespace vestibule::gui_headless
