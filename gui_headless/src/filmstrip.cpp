#include "vestibule/gui_headless/filmstrip.hpp"

#include <algorithm>
#include <cmath>

#include "canvas.hpp"
#include "layers.hpp"
#include "palette.hpp"
#include "text.hpp"

namespace vestibule::gui_headless {
namespace {

constexpr std::size_t kPanels = 8;
constexpr int kColumns = 4;
constexpr double kPanel = 260.0;
constexpr double kGap = 10.0;
constexpr double kCaption = 40.0;
constexpr double kMinSide_m = 12.0;
constexpr double kDensity = 1.5;

View viewOf(const ParticleSnapshot& snapshot, const cv::Rect2d& area) {
  double x0 = 1e300;
  double y0 = 1e300;
  double x1 = -1e300;
  double y1 = -1e300;
  for (const Pose2& T : snapshot.T_map_particles) {
    x0 = std::min(x0, T.x);
    y0 = std::min(y0, T.y);
    x1 = std::max(x1, T.x);
    y1 = std::max(y1, T.y);
  }
  constexpr double kRim = 1.15;
  const double side_m = std::max(kMinSide_m, kRim * std::max(x1 - x0, y1 - y0));
  return {area, Point2(0.5 * (x0 + x1), 0.5 * (y0 + y1)), area.width / side_m};
}

void drawPanel(
    Canvas& canvas,
    const ParticleSnapshot& snapshot,
    const Scene& scene,
    double since_s,
    double x,
    double y) {
  const cv::Rect2d area(x, y, kPanel, kPanel);
  const View view = viewOf(snapshot, area);
  canvas.clipped(area, [&] {
    canvas.fillRect(area, palette::kGround);
    for (const grid::OccupancyMap* map : scene.prior_maps) drawPriorMap(canvas, view, *map);
    for (const Point2& p : snapshot.p_map_unmapped) {
      canvas.fillCircle(view(p), 2.4, palette::kLost);
    }
    canvas.blend(0.6, [&] {
      for (const Pose2& T : snapshot.T_map_particles) {
        const Canvas::Px at = view(T);
        canvas.fillCircle(at, 1.6, palette::kParticle);
        canvas.line(
            at,
            {at.x + 7.0 * std::cos(T.phi), at.y - 7.0 * std::sin(T.phi)},
            palette::kParticle,
            0.7);
      }
    });
    LabelPlacer labels(area);
    drawScaleBar(canvas, view, labels);
  });
  canvas.strokeRect(area, palette::kLine, 1.0);
  canvas.text(fixed(since_s, 1) + " s", {x, y + kPanel + 16.0}, {13.0, palette::kInk, true, false});
  canvas.text(
      std::to_string(snapshot.count) + " particles",
      {x + kPanel, y + kPanel + 16.0},
      {11.5, palette::kMuted, false, false, Canvas::Align::kRight});
  canvas.text(
      "spread " + fixed(snapshot.spread_m, 2) + " m, lost with " +
          fixed(100.0 * snapshot.lost_probability, 0) + " %",
      {x, y + kPanel + 32.0},
      {11.5, palette::kMuted, false, false});
}

}  // namespace

std::string renderFilmstrip(const RunRecorder& run, const Scene& scene) {
  const std::vector<ParticleSnapshot> snapshots = run.snapshots();
  if (snapshots.empty()) return {};
  const std::size_t n = std::min(kPanels, snapshots.size());
  const int columns = std::min(kColumns, static_cast<int>(n));
  const int rows = (static_cast<int>(n) + columns - 1) / columns;
  const double width = columns * (kPanel + kGap) + kGap;
  const double height = rows * (kPanel + kCaption + kGap) + kGap;
  Canvas canvas(
      static_cast<int>(std::lround(kDensity * width)),
      static_cast<int>(std::lround(kDensity * height)),
      kDensity,
      palette::kPaper);
  // As on the time axes of the charts.
  const Timestamp began = run.span() ? run.span()->first : snapshots.front().stamp;
  for (std::size_t k = 0; k < n; ++k) {
    const std::size_t i = n == 1 ? 0 : k * (snapshots.size() - 1) / (n - 1);
    const double since_s = toSeconds(snapshots[i].stamp - began);
    drawPanel(
        canvas,
        snapshots[i],
        scene,
        since_s,
        kGap + static_cast<double>(k % static_cast<std::size_t>(columns)) * (kPanel + kGap),
        kGap + static_cast<double>(k / static_cast<std::size_t>(columns)) *
                   (kPanel + kCaption + kGap));
  }
  return canvas.png();
}

}  // namespace vestibule::gui_headless
