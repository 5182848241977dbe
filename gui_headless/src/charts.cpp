#include "vestibule/gui_headless/charts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "palette.hpp"
#include "text.hpp"

namespace vestibule::gui_headless {
namespace {

// One width for all charts, so that time axes of one section line up under each other.
constexpr double kWidth = 1100.0;
constexpr double kLeft = 64.0;
constexpr double kRight = 18.0;
constexpr double kPlotWidth = kWidth - kLeft - kRight;
constexpr double kTop = 46.0;
constexpr double kBottom = 46.0;

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void add(double v) {
    if (!std::isfinite(v)) return;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  [[nodiscard]] bool empty() const { return high < low; }
};

std::string attribute(std::string_view name, double value) {
  return " " + std::string(name) + "=\"" + compact(value, 2) + "\"";
}

std::string open(double height, const std::string& title) {
  return "<svg class=\"chart\" viewBox=\"0 0 " + compact(kWidth, 0) + " " + compact(height, 0) +
         "\" role=\"img\" aria-label=\"" + escape(title) + "\">\n";
}

struct TextStyle {
  double size = 12.0;
  std::string_view fill = palette::kMuted;
  std::string_view anchor = "start";
  bool bold = false;
};

std::string text(double x, double y, const std::string& words, const TextStyle& style = {}) {
  return "<text" + attribute("x", x) + attribute("y", y) + attribute("font-size", style.size) +
         " fill=\"" + std::string(style.fill) + "\"" +
         (style.anchor == "start" ? "" : " text-anchor=\"" + std::string(style.anchor) + "\"") +
         (style.bold ? " font-weight=\"600\"" : "") + ">" + escape(words) + "</text>\n";
}

std::string line(
    double x1,
    double y1,
    double x2,
    double y2,
    std::string_view colour,
    double width,
    const std::string& dashes = "") {
  return "<line" + attribute("x1", x1) + attribute("y1", y1) + attribute("x2", x2) +
         attribute("y2", y2) + " stroke=\"" + std::string(colour) + "\"" +
         attribute("stroke-width", width) +
         (dashes.empty() ? "" : " stroke-dasharray=\"" + dashes + "\"") + "/>\n";
}

std::string rect(
    double x,
    double y,
    double w,
    double h,
    std::string_view fill,
    double opacity,
    const std::string& tooltip = "",
    double radius = 0.0) {
  const std::string shape = "<rect" + attribute("x", x) + attribute("y", y) +
                            attribute("width", std::max(0.0, w)) + attribute("height", h) +
                            " fill=\"" + std::string(fill) + "\"" +
                            (opacity < 1.0 ? attribute("fill-opacity", opacity) : "") +
                            (radius > 0.0 ? attribute("rx", radius) : "");
  if (tooltip.empty()) return shape + "/>\n";
  return shape + "><title>" + escape(tooltip) + "</title></rect>\n";
}

std::string noData(double height, const std::string& title) {
  return open(height, title) + text(kLeft, 20.0, title, {14.0, palette::kInk, "start", true}) +
         rect(kLeft, kTop, kPlotWidth, height - kTop - 12.0, palette::kGround, 1.0, "", 6.0) +
         text(
             kLeft + 0.5 * kPlotWidth,
             kTop + 0.5 * (height - kTop - 12.0) + 4.0,
             "no data",
             {13.0, palette::kMuted, "middle"}) +
         "</svg>\n";
}

/// Linear map of a data interval onto pixels.
struct Axis {
  double low;
  double high;
  double px_low;
  double px_high;
  [[nodiscard]] double operator()(double v) const {
    return px_low + (v - low) / (high - low) * (px_high - px_low);
  }
};

struct Stroke {
  std::string_view colour;
  double width;
  std::string dashes;
};
Stroke strokeOf(SeriesLook look) {
  switch (look) {
    case SeriesLook::kEstimate:
      return {palette::kInk, 1.6, ""};
    case SeriesLook::kSecond:
      return {palette::kDoor, 1.5, ""};
    case SeriesLook::kThird:
      return {palette::kParticle, 1.5, ""};
    case SeriesLook::kBound:
      return {palette::kFaint, 1.4, "5 3"};
    case SeriesLook::kReference:
      return {palette::kMuted, 1.2, "2 3"};
  }
  return {palette::kInk, 1.5, ""};
}

/// The path of a series. Where several points share a pixel column, the column's first, lowest,
/// highest and last remain, in their order, so that no spike is lost.
std::string pathOf(const Series& series, const Axis& x, const Axis& y) {
  std::string d;
  bool pen_down = false;
  const auto emit = [&](const std::pair<double, double>& p) {
    d += pen_down ? "L" : "M";
    d += compact(x(p.first), 1) + " " + compact(std::clamp(y(p.second), y.px_high, y.px_low), 1);
    pen_down = true;
  };
  const auto& points = series.points;
  std::size_t i = 0;
  while (i < points.size()) {
    if (!std::isfinite(points[i].first) || !std::isfinite(points[i].second)) {
      pen_down = false;  // a hole in the data is a hole in the line
      ++i;
      continue;
    }
    const double column = std::floor(x(points[i].first));
    std::set<std::size_t> kept = {i};
    std::size_t lowest = i;
    std::size_t highest = i;
    std::size_t next = i;
    while (next < points.size() && std::isfinite(points[next].second) &&
           std::floor(x(points[next].first)) == column) {
      if (points[next].second < points[lowest].second) lowest = next;
      if (points[next].second > points[highest].second) highest = next;
      ++next;
    }
    kept.insert({lowest, highest, next - 1});
    for (const std::size_t k : kept) emit(points[k]);
    i = next;
  }
  return d;
}

std::string bandTooltip(const ModeBand& band) {
  std::string words =
      modeName(band.mode) + ", " + fixed(band.from, 1) + " to " + fixed(band.to, 1) + " s";
  if (!band.reason.empty()) words += ": " + band.reason;
  return words;
}

std::string xTicks(const Axis& x, double y_bottom) {
  std::string out;
  const Ticks ticks = niceTicks(x.low, x.high, 10);
  for (const double v : ticks.values) {
    out += line(x(v), y_bottom, x(v), y_bottom + 4.0, palette::kFaint, 1.0);
    out += text(x(v), y_bottom + 17.0, fixed(v, ticks.decimals), {11.5, palette::kMuted, "middle"});
  }
  return out;
}

/// Approximate width of proportional text, enough to keep labels apart.
double widthOf(const std::string& words, double size) {
  double sum = 0.0;
  for (const char c : words) {
    const std::string_view narrow = "fijlrtI.,:;'|!()[] ";
    const std::string_view wide = "mwMW%@";
    const bool is_capital = c >= 'A' && c <= 'Z';
    if (narrow.find(c) != std::string_view::npos) {
      sum += 0.36;
    } else if (wide.find(c) != std::string_view::npos) {
      sum += 0.9;
    } else {
      sum += is_capital ? 0.68 : 0.6;
    }
  }
  return size * sum;
}

double logChiSquareDensity(double value, int dof) {
  const double half = 0.5 * dof;
  return (half - 1.0) * std::log(value) - 0.5 * value - half * std::log(2.0) - std::lgamma(half);
}

}  // namespace

std::string lineChart(const LineChart& chart) {
  constexpr double kHeight = 290.0;
  Range x_range;
  Range y_range;
  for (const Series& series : chart.series) {
    for (const auto& [x, y] : series.points) {
      if (!std::isfinite(x) || !std::isfinite(y)) continue;
      x_range.add(x);
      y_range.add(y);
    }
  }
  if (x_range.empty()) return noData(150.0, chart.title);
  for (const ModeBand& band : chart.bands) {
    x_range.add(band.from);
    x_range.add(band.to);
  }
  if (chart.limit) y_range.add(*chart.limit);
  if (chart.include_zero) y_range.add(0.0);
  if (x_range.high <= x_range.low) x_range.high = x_range.low + 1.0;
  if (y_range.high <= y_range.low) {
    const double room = std::max(1e-3, 0.5 * std::abs(y_range.low));
    y_range.high += room;
    if (!chart.include_zero || y_range.low < 0.0) y_range.low -= room;
  }
  // The axis ends on round numbers, with a little air above the highest value.
  const double air = 0.06 * (y_range.high - y_range.low);
  const double step = niceStep((y_range.high + air - y_range.low) / 5.0);
  const double y_low = chart.share ? 0.0 : std::floor(y_range.low / step + 1e-9) * step;
  const double y_high = chart.share ? 1.0 : std::ceil((y_range.high + air) / step - 1e-9) * step;
  const Axis x{x_range.low, x_range.high, kLeft, kWidth - kRight};
  const Axis y{y_low, y_high, kHeight - kBottom, kTop};

  std::string out = open(kHeight, chart.title);
  out += text(kLeft, 18.0, chart.title, {14.0, palette::kInk, "start", true});
  out += rect(kLeft, kTop, kPlotWidth, kHeight - kTop - kBottom, palette::kPaper, 1.0);
  for (const ModeBand& band : chart.bands) {
    out += rect(
        x(band.from),
        kTop,
        x(band.to) - x(band.from),
        kHeight - kTop - kBottom,
        colourOf(band.mode),
        0.13,
        bandTooltip(band));
  }
  const Ticks y_ticks = niceTicks(y_low, y_high, 5);
  for (const double v : y_ticks.values) {
    out += line(kLeft, y(v), kWidth - kRight, y(v), palette::kLine, 0.8);
    out +=
        text(kLeft - 8.0, y(v) + 4.0, fixed(v, y_ticks.decimals), {11.5, palette::kMuted, "end"});
  }
  out += xTicks(x, kHeight - kBottom);
  out += line(kLeft, y.px_low, kWidth - kRight, y.px_low, palette::kFaint, 1.0);
  out += text(
      kLeft + 0.5 * kPlotWidth, kHeight - 8.0, chart.x_label, {12.0, palette::kMuted, "middle"});
  const double middle = 0.5 * (kTop + kHeight - kBottom);
  out += "<text transform=\"translate(16 " + compact(middle, 1) +
         ") rotate(-90)\" text-anchor=\"middle\" font-size=\"12\" fill=\"" +
         std::string(palette::kMuted) + "\">" + escape(chart.y_label) + "</text>\n";
  double free_from = kLeft;
  for (const ChartMarker& marker : chart.markers) {
    if (!(marker.x >= x.low && marker.x <= x.high)) continue;
    out += line(x(marker.x), kTop, x(marker.x), y.px_low, palette::kDoor, 1.2, "4 3");
    const double half = 0.5 * widthOf(marker.label, 11.0);
    if (x(marker.x) - half < free_from) continue;  // its neighbour's name stands here
    out += text(
        std::min(x(marker.x), kWidth - kRight - half),
        kTop - 5.0,
        marker.label,
        {11.0, palette::kDoor, "middle"});
    free_from = x(marker.x) + half + 8.0;
  }
  for (auto it = chart.series.rbegin(); it != chart.series.rend(); ++it) {
    const Stroke stroke = strokeOf(it->look);
    out += "<path d=\"" + pathOf(*it, x, y) + "\" fill=\"none\" stroke=\"" +
           std::string(stroke.colour) + "\"" + attribute("stroke-width", stroke.width) +
           (stroke.dashes.empty() ? "" : " stroke-dasharray=\"" + stroke.dashes + "\"") +
           " stroke-linejoin=\"round\"/>\n";
  }
  if (chart.limit) {
    out +=
        line(kLeft, y(*chart.limit), kWidth - kRight, y(*chart.limit), palette::kLost, 1.2, "6 4");
    out += text(
        kWidth - kRight - 6.0,
        y(*chart.limit) - 5.0,
        chart.limit_label,
        {11.0, palette::kLost, "end"});
  }
  // Legend at the right of the title, from right to left.
  double legend_x = kWidth - kRight;
  for (auto it = chart.series.rbegin(); it != chart.series.rend(); ++it) {
    const Stroke stroke = strokeOf(it->look);
    out += text(legend_x, 18.0, it->name, {12.0, palette::kInk, "end"});
    legend_x -= widthOf(it->name, 12.0) + 8.0;
    out += line(legend_x - 22.0, 14.0, legend_x, 14.0, stroke.colour, 2.0, stroke.dashes);
    legend_x -= 40.0;
  }
  return out + "</svg>\n";
}

std::string modeTimeline(const ModeTimeline& timeline) {
  constexpr double kStripTop = 58.0;
  constexpr double kStripHeight = 30.0;
  constexpr double kTickTop = 34.0;
  constexpr double kHeight = kStripTop + kStripHeight + 44.0;
  if (timeline.bands.empty() || !(timeline.to > timeline.from)) {
    return noData(110.0, timeline.title);
  }
  const Axis x{timeline.from, timeline.to, kLeft, kWidth - kRight};
  std::string out = open(kHeight, timeline.title);
  out += text(kLeft, 18.0, timeline.title, {14.0, palette::kInk, "start", true});
  std::set<Mode> modes;
  for (const ModeBand& band : timeline.bands) {
    const double left = x(std::max(band.from, timeline.from));
    const double right = x(std::min(band.to, timeline.to));
    // A mode held for less than a pixel still happened.
    const double width = std::max(1.5, right - left);
    out += rect(left, kStripTop, width, kStripHeight, colourOf(band.mode), 0.9, bandTooltip(band));
    if (width > widthOf(modeName(band.mode), 12.0) + 12.0) {
      out += text(
          left + 0.5 * width,
          kStripTop + 0.5 * kStripHeight + 4.0,
          modeName(band.mode),
          {12.0, palette::kPaper, "middle", true});
    }
    modes.insert(band.mode);
  }
  double free_from = 0.0;
  for (const ChartMarker& tick : timeline.ticks) {
    if (!(tick.x >= x.low && tick.x <= x.high)) continue;
    const double half = 0.5 * widthOf(tick.label, 11.0);
    const double centre = std::clamp(x(tick.x), kLeft + half, kWidth - kRight - half);
    const bool has_room = centre - half >= free_from;
    out += line(
        x(tick.x),
        has_room ? kTickTop + 12.0 : kStripTop - 6.0,
        x(tick.x),
        kStripTop,
        palette::kInk,
        1.0);
    if (!has_room) continue;
    out += text(centre, kTickTop + 7.0, tick.label, {11.0, palette::kInk, "middle"});
    free_from = centre + half + 10.0;
  }
  out += xTicks(x, kStripTop + kStripHeight);
  out +=
      text(kLeft + 0.5 * kPlotWidth, kHeight - 8.0, "time [s]", {12.0, palette::kMuted, "middle"});
  double legend_x = kWidth - kRight;
  for (auto it = modes.rbegin(); it != modes.rend(); ++it) {
    out += text(legend_x, 18.0, modeName(*it), {12.0, palette::kInk, "end"});
    legend_x -= widthOf(modeName(*it), 12.0) + 6.0;
    out += rect(legend_x - 14.0, 8.0, 14.0, 12.0, colourOf(*it), 0.9, "", 2.0);
    legend_x -= 32.0;
  }
  return out + "</svg>\n";
}

std::string histogram(const Histogram& chart) {
  constexpr double kHeight = 250.0;
  std::vector<double> values;
  for (const double v : chart.values) {
    if (std::isfinite(v) && v >= 0.0) values.push_back(v);
  }
  if (values.empty()) return noData(150.0, chart.title);
  std::sort(values.begin(), values.end());
  // The axis ends at the 98th percentile (or where the expectation ends): the last bin holds the
  // rest, so that one outlier does not squeeze all others into one bar.
  double high = values[static_cast<std::size_t>(0.98 * static_cast<double>(values.size() - 1))];
  if (chart.dof) high = std::max(high, *chart.dof + 4.0 * std::sqrt(2.0 * *chart.dof));
  if (high <= 0.0) high = 1.0;
  const double bin = niceStep(high / 40.0);
  const auto bins = static_cast<std::size_t>(std::ceil(high / bin));
  std::vector<double> share(bins, 0.0);
  for (const double v : values) {
    const auto k = static_cast<std::size_t>(std::min(v / bin, static_cast<double>(bins - 1)));
    share[k] += 1.0 / static_cast<double>(values.size());
  }
  std::vector<std::pair<double, double>> expected;
  if (chart.dof) {
    for (int i = 1; i <= 200; ++i) {
      const double v = bin * static_cast<double>(bins) * (i - 0.5) / 200.0;
      expected.emplace_back(v, bin * std::exp(logChiSquareDensity(v, *chart.dof)));
    }
  }
  double top = *std::max_element(share.begin(), share.end());
  for (const auto& p : expected) top = std::max(top, std::min(p.second, 1.6 * top));
  const double step = niceStep(1.05 * top / 4.0);
  const Axis x{0.0, bin * static_cast<double>(bins), kLeft, kWidth - kRight};
  const Axis y{0.0, std::ceil(1.05 * top / step) * step, kHeight - kBottom, kTop};

  std::string out = open(kHeight, chart.title);
  out += text(kLeft, 18.0, chart.title, {14.0, palette::kInk, "start", true});
  const Ticks y_ticks = niceTicks(0.0, y.high, 4);
  for (const double v : y_ticks.values) {
    out += line(kLeft, y(v), kWidth - kRight, y(v), palette::kLine, 0.8);
    out += text(
        kLeft - 8.0,
        y(v) + 4.0,
        fixed(100.0 * v, std::max(0, y_ticks.decimals - 2)) + " %",
        {11.5, palette::kMuted, "end"});
  }
  for (std::size_t k = 0; k < bins; ++k) {
    if (share[k] <= 0.0) continue;
    const double from = bin * static_cast<double>(k);
    const bool is_last = k + 1 == bins;
    const std::string tooltip = compact(from, 3) +
                                (is_last ? " and more: " : " to " + compact(from + bin, 3) + ": ") +
                                fixed(100.0 * share[k], 2) + " %";
    out += rect(
        x(from) + 0.75,
        y(share[k]),
        x(from + bin) - x(from) - 1.5,
        y.px_low - y(share[k]),
        palette::kFaint,
        0.85,
        tooltip);
  }
  if (!expected.empty()) {
    const Series curve{"chi-square", SeriesLook::kEstimate, expected};
    out += "<path d=\"" + pathOf(curve, x, y) + "\" fill=\"none\" stroke=\"" +
           std::string(palette::kInk) + "\" stroke-width=\"1.6\"/>\n";
    const std::string words = "honest filter: chi-square, " + std::to_string(*chart.dof) + " dof";
    out += text(kWidth - kRight, 18.0, words, {12.0, palette::kInk, "end"});
    const double legend_x = kWidth - kRight - widthOf(words, 12.0) - 8.0;
    out += line(legend_x - 22.0, 14.0, legend_x, 14.0, palette::kInk, 2.0);
  }
  out += xTicks(x, y.px_low);
  out += line(kLeft, y.px_low, kWidth - kRight, y.px_low, palette::kFaint, 1.0);
  out += text(
      kLeft + 0.5 * kPlotWidth, kHeight - 8.0, chart.x_label, {12.0, palette::kMuted, "middle"});
  return out + "</svg>\n";
}

}  // namespace vestibule::gui_headless
