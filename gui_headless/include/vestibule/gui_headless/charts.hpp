#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "vestibule/core/events.hpp"

namespace vestibule::gui_headless {

/// Charts are inline SVG fragments that share one look with the overview picture. Text is escaped,
/// empty input gives a chart that says "no data", and long series are reduced to the minimum and
/// maximum per pixel column, so spikes survive. Non-finite points are left out.

/// Reserved meanings; a chart never uses a mode's colour for anything else.
enum class SeriesLook { kEstimate, kSecond, kThird, kBound, kReference };

struct Series {
  std::string name;
  SeriesLook look = SeriesLook::kEstimate;
  std::vector<std::pair<double, double>> points;  ///< (x, y), x ascending
};

/// Background of the time between two moments.
struct ModeBand {
  double from = 0.0;
  double to = 0.0;
  Mode mode = Mode::kOutdoor;
  std::string reason;  ///< shown as a tooltip
};

/// A vertical line with a short name, e.g. a door crossing.
struct ChartMarker {
  double x = 0.0;
  std::string label;
};

struct LineChart {
  std::string title;
  std::string x_label = "time [s]";
  std::string y_label;  ///< with its unit in brackets
  std::vector<Series> series;
  std::vector<ModeBand> bands;
  std::vector<ChartMarker> markers;
  bool include_zero = true;     ///< y axis starts at (or spans) zero
  bool share = false;           ///< y axis from 0 to 1
  std::optional<double> limit;  ///< horizontal line of a bar that should be kept
  std::string limit_label;
};
[[nodiscard]] std::string lineChart(const LineChart& chart);

/// One coloured strip over the run, with named ticks (waypoints, doors) and the modes' reasons.
struct ModeTimeline {
  std::string title = "Mode";
  double from = 0.0;
  double to = 0.0;
  std::vector<ModeBand> bands;
  std::vector<ChartMarker> ticks;
};
[[nodiscard]] std::string modeTimeline(const ModeTimeline& timeline);

/// Share of values per bin. With `dof` the chi-square density of that many degrees of freedom is
/// drawn over it: what the normalised innovation squared of an honest filter looks like.
struct Histogram {
  std::string title;
  std::string x_label;
  std::vector<double> values;  ///< >= 0
  std::optional<int> dof;
};
[[nodiscard]] std::string histogram(const Histogram& chart);

}  // namespace vestibule::gui_headless
