#include "histogram_picture.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace vestibule::test {
namespace {

constexpr int kWidth = 640;  // of a panel
constexpr int kHeight = 330;
constexpr int kLeft = 30;
constexpr int kRight = 25;
constexpr int kTop = 62;
constexpr int kBottom = 46;
const cv::Scalar kReal(180, 105, 40);       // blue, filled
const cv::Scalar kSimulated(30, 110, 230);  // orange, line
const cv::Scalar kInk(60, 60, 60);

std::vector<double> shares(const Panel& panel, const Sample& sample) {
  std::vector<double> bins(static_cast<std::size_t>(panel.bins), 0.0);
  for (const double v : sample.values) {
    const int bin = static_cast<int>(v / panel.largest * panel.bins);
    bins[static_cast<std::size_t>(std::clamp(bin, 0, panel.bins - 1))] +=
        1.0 / static_cast<double>(sample.values.size());
  }
  return bins;
}

void text(
    cv::Mat& canvas, const std::string& what, cv::Point at, double size, const cv::Scalar& c) {
  cv::putText(canvas, what, at, cv::FONT_HERSHEY_SIMPLEX, size, c, 1, cv::LINE_AA);
}

std::string quantilesOf(const Sample& sample) {
  char line[160];
  std::snprintf(
      line,
      sizeof line,
      "%s: median %.2f, 90 %% %.2f, 99 %% %.2f",
      sample.name.c_str(),
      quantile(sample.values, 0.5),
      quantile(sample.values, 0.9),
      quantile(sample.values, 0.99));
  std::string text = line;
  if (sample.medians.size() > 1) {
    const auto [least, most] = std::minmax_element(sample.medians.begin(), sample.medians.end());
    std::snprintf(
        line,
        sizeof line,
        " (medians of %zu drives: %.2f to %.2f)",
        sample.medians.size(),
        *least,
        *most);
    text += line;
  }
  return text;
}

void drawPanel(cv::Mat canvas, const Panel& panel) {
  const std::vector<double> real = shares(panel, panel.real);
  const std::vector<double> simulated = shares(panel, panel.simulated);
  const double highest = std::max(
      *std::max_element(real.begin(), real.end()),
      *std::max_element(simulated.begin(), simulated.end()));
  const double bin_px = static_cast<double>(kWidth - kLeft - kRight) / panel.bins;
  const int floor_px = kHeight - kBottom;
  const auto x_of = [&](std::size_t bin) {
    return static_cast<int>(std::lround(kLeft + bin_px * static_cast<double>(bin)));
  };
  const auto y_of = [&](double share) {
    return static_cast<int>(std::lround(floor_px - share / highest * (floor_px - kTop - 44)));
  };
  for (std::size_t i = 0; i < real.size(); ++i) {
    cv::rectangle(
        canvas, {x_of(i) + 1, y_of(real[i])}, {x_of(i + 1) - 1, floor_px}, kReal, cv::FILLED);
  }
  std::vector<cv::Point> outline{{x_of(0), floor_px}};
  for (std::size_t i = 0; i < simulated.size(); ++i) {
    outline.emplace_back(x_of(i), y_of(simulated[i]));
    outline.emplace_back(x_of(i + 1), y_of(simulated[i]));
  }
  outline.emplace_back(x_of(simulated.size()), floor_px);
  cv::polylines(canvas, outline, false, kSimulated, 2, cv::LINE_AA);
  cv::line(canvas, {kLeft, floor_px}, {kWidth - kRight, floor_px}, kInk, 1);
  for (int tick = 0; tick <= 5; ++tick) {
    const int x = kLeft + (kWidth - kLeft - kRight) * tick / 5;
    char label[20];
    std::snprintf(label, sizeof label, "%.3g", panel.largest * tick / 5);
    cv::line(canvas, {x, floor_px}, {x, floor_px + 4}, kInk, 1);
    text(canvas, label, {x - 8, floor_px + 18}, 0.4, kInk);
  }
  text(canvas, panel.title, {kLeft, 24}, 0.55, kInk);
  text(canvas, quantilesOf(panel.real), {kLeft, 46}, 0.38, kReal);
  text(canvas, quantilesOf(panel.simulated), {kLeft, 66}, 0.38, kSimulated);
  text(canvas, panel.unit, {kLeft + 150, kHeight - 10}, 0.42, kInk);
}

}  // namespace

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  const double place = share * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (place - std::floor(place)) * (values[above] - values[below]);
}

void drawPanels(const std::vector<Panel>& panels, const std::string& png_path) {
  const int rows = (static_cast<int>(panels.size()) + 1) / 2;
  cv::Mat canvas(rows * kHeight, 2 * kWidth, CV_8UC3, cv::Scalar::all(255));
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const cv::Rect place(
        static_cast<int>(i % 2) * kWidth, static_cast<int>(i / 2) * kHeight, kWidth, kHeight);
    drawPanel(canvas(place), panels[i]);
  }
  if (!cv::imwrite(png_path, canvas)) throw std::runtime_error(png_path + ": cannot be written");
}

}  // namespace vestibule::test
