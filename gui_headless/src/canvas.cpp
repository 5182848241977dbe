#include "canvas.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "palette.hpp"
#include "text.hpp"

namespace vestibule::gui_headless {
namespace {

constexpr int kOversampling = 2;
constexpr int kShift = 4;  // sub-pixel bits of OpenCV's drawing functions
constexpr double kSubPixels = 1 << kShift;
constexpr double kClipMargin = 400.0;
constexpr int kBandRows = 64;  // of the final picture, drawn at a time

cv::Scalar bgr(std::string_view colour) {
  const std::string hex(colour.substr(1));
  const auto value = static_cast<unsigned>(std::strtoul(hex.c_str(), nullptr, 16));
  return {
      static_cast<double>(value & 255u),
      static_cast<double>((value >> 8) & 255u),
      static_cast<double>((value >> 16) & 255u)};
}

// Liang-Barsky against the picture with a margin: far coordinates would overflow OpenCV's integers.
std::optional<std::pair<Canvas::Px, Canvas::Px>> clip(
    Canvas::Px a, Canvas::Px b, double width, double height) {
  double t0 = 0.0;
  double t1 = 1.0;
  const Canvas::Px d = b - a;
  const auto cut = [&](double p, double q) {
    if (p == 0.0) return q >= 0.0;
    const double t = q / p;
    if (p < 0.0) {
      t0 = std::max(t0, t);
    } else {
      t1 = std::min(t1, t);
    }
    return t0 <= t1;
  };
  const bool visible = cut(-d.x, a.x + kClipMargin) && cut(d.x, width + kClipMargin - a.x) &&
                       cut(-d.y, a.y + kClipMargin) && cut(d.y, height + kClipMargin - a.y);
  if (!visible || !std::isfinite(a.x + a.y + b.x + b.y)) return std::nullopt;
  return std::make_pair(a + t0 * d, a + t1 * d);
}

constexpr int kFont = cv::FONT_HERSHEY_DUPLEX;
constexpr double kCapHeightOfFont = 21.0;  // pixels at scale 1
constexpr double kCapHeightOfSize = 0.72;

}  // namespace

Canvas::Canvas(int width_px, int height_px, double density, std::string_view background)
    : width_px_(width_px),
      height_px_(height_px),
      scale_(kOversampling * density),
      background_(bgr(background)) {}

// OpenCV puts the centre of the first pixel at 0; ours is its outer edge.
cv::Point Canvas::fixedPoint(Px p) const {
  return {
      static_cast<int>(std::lround((p.x * scale_ - 0.5) * kSubPixels)),
      static_cast<int>(std::lround((p.y * scale_ - 0.5) * kSubPixels))};
}

int Canvas::fixedLength(double length) const {
  return static_cast<int>(std::lround(length * scale_ * kSubPixels));
}

int Canvas::thickness(double width) const {
  return std::max(1, static_cast<int>(std::lround(width * scale_)));
}

cv::Rect Canvas::pixelRect(const cv::Rect2d& rect) const {
  const auto round = [&](double v) { return static_cast<int>(std::lround(v * scale_)); };
  const cv::Rect pixels(
      cv::Point(round(rect.x), round(rect.y)),
      cv::Point(round(rect.x + rect.width), round(rect.y + rect.height)));
  return pixels & cv::Rect(0, 0, kOversampling * width_px_, kOversampling * height_px_);
}

double Canvas::fontScale(const TextLook& look) const {
  return look.size * kCapHeightOfSize * scale_ / kCapHeightOfFont;
}

int Canvas::stroke(const TextLook& look) const {
  return thickness(look.size / (look.bold ? 13.0 : 20.0));
}

std::optional<std::pair<Canvas::Px, Canvas::Px>> Canvas::visible(Px a, Px b) const {
  return clip(a, b, kOversampling * width_px_ / scale_, kOversampling * height_px_ / scale_);
}

void Canvas::line(Px a, Px b, std::string_view colour, double width) {
  const auto part = visible(a, b);
  if (!part) return;
  steps_.emplace_back([from = fixedPoint(part->first),
                       to = fixedPoint(part->second),
                       ink = bgr(colour),
                       pen = thickness(width)](const Band& band) {
    const cv::Point up(0, band.top << kShift);
    cv::line(band.pixels, from - up, to - up, ink, pen, cv::LINE_AA, kShift);
  });
}

void Canvas::polyline(const std::vector<Px>& points, std::string_view colour, double width) {
  for (std::size_t i = 1; i < points.size(); ++i) line(points[i - 1], points[i], colour, width);
}

void Canvas::dashedPolyline(
    const std::vector<Px>& points, std::string_view colour, double width, double on, double off) {
  const double period = on + off;
  double phase = 0.0;  // position within the current dash and gap
  for (std::size_t i = 1; i < points.size(); ++i) {
    const auto part = visible(points[i - 1], points[i]);
    if (!part) continue;
    const Px d = part->second - part->first;
    const double length = std::hypot(d.x, d.y);
    double s = 0.0;
    while (s < length) {
      const double until = std::min(length, s + (phase < on ? on : period) - phase);
      if (phase < on) {
        line(part->first + d * (s / length), part->first + d * (until / length), colour, width);
      }
      phase += until - s;
      if (phase >= period - 1e-9) phase = 0.0;
      // A step lost to rounding would repeat for ever.
      s = until > s ? until : length;
    }
  }
}

void Canvas::fillPolygon(const std::vector<Px>& points, std::string_view colour) {
  if (points.size() < 3) return;
  std::vector<cv::Point> corners;
  for (const Px& p : points) {
    if (std::abs(p.x) > 1e6 || std::abs(p.y) > 1e6) return;
    corners.push_back(fixedPoint(p));
  }
  steps_.emplace_back([corners = std::move(corners), ink = bgr(colour)](const Band& band) {
    std::vector<cv::Point> there = corners;
    for (cv::Point& p : there) p.y -= band.top << kShift;
    cv::fillPoly(band.pixels, std::vector<std::vector<cv::Point>>{there}, ink, cv::LINE_AA, kShift);
  });
}

void Canvas::fillRect(const cv::Rect2d& rect, std::string_view colour) {
  steps_.emplace_back([rect = pixelRect(rect), ink = bgr(colour)](const Band& band) {
    const cv::Rect here = band.part(rect);
    if (here.area() > 0) band.pixels(here).setTo(ink);
  });
}

void Canvas::strokeRect(const cv::Rect2d& r, std::string_view colour, double width) {
  polyline(
      {{r.x, r.y},
       {r.x + r.width, r.y},
       {r.x + r.width, r.y + r.height},
       {r.x, r.y + r.height},
       {r.x, r.y}},
      colour,
      width);
}

void Canvas::fillCircle(Px centre, double radius, std::string_view colour) {
  circle(centre, radius, colour, cv::FILLED);
}

void Canvas::strokeCircle(Px centre, double radius, std::string_view colour, double width) {
  circle(centre, radius, colour, thickness(width));
}

void Canvas::circle(Px centre, double radius, std::string_view colour, int pen) {
  if (!(std::abs(centre.x) < 1e6 && std::abs(centre.y) < 1e6)) return;
  steps_.emplace_back(
      [at = fixedPoint(centre), r = fixedLength(radius), ink = bgr(colour), pen](const Band& band) {
        const cv::Point up(0, band.top << kShift);
        cv::circle(band.pixels, at - up, r, ink, pen, cv::LINE_AA, kShift);
      });
}

double Canvas::textWidth(const std::string& words, const TextLook& look) const {
  int base = 0;
  const cv::Size size =
      cv::getTextSize(asciiText(words), kFont, fontScale(look), stroke(look), &base);
  return size.width / scale_;
}

void Canvas::text(const std::string& words, Px baseline, const TextLook& look) {
  const double width = textWidth(words, look);
  double x = baseline.x;
  if (look.align == Align::kCentre) x -= 0.5 * width;
  if (look.align == Align::kRight) x -= width;
  const cv::Point origin(
      static_cast<int>(std::lround(x * scale_)),
      static_cast<int>(std::lround(baseline.y * scale_)));
  const auto put = [&](std::string_view colour, int pen) {
    steps_.emplace_back(
        [ascii = asciiText(words), origin, size = fontScale(look), ink = bgr(colour), pen](
            const Band& band) {
          const cv::Point up(0, band.top);
          cv::putText(band.pixels, ascii, origin - up, kFont, size, ink, pen, cv::LINE_AA);
        });
  };
  if (look.halo) put(palette::kPaper, stroke(look) + thickness(3.5));
  put(look.colour, stroke(look));
}

std::vector<Canvas::Step> Canvas::stepsOf(const std::function<void()>& draw) {
  std::vector<Step> steps;
  steps_.swap(steps);
  draw();
  steps_.swap(steps);
  return steps;
}

void Canvas::blend(double opacity, const std::function<void()>& draw) {
  steps_.emplace_back([opacity, steps = stepsOf(draw)](const Band& band) {
    const cv::Mat before = band.pixels.clone();
    for (const Step& step : steps) step(band);
    cv::addWeighted(band.pixels, opacity, before, 1.0 - opacity, 0.0, band.pixels);
  });
}

void Canvas::clipped(const cv::Rect2d& rect, const std::function<void()>& draw) {
  steps_.emplace_back([rect = pixelRect(rect), steps = stepsOf(draw)](const Band& band) {
    const cv::Rect here = band.part(rect);
    if (here.area() <= 0) return;
    const cv::Mat before = band.pixels.clone();
    for (const Step& step : steps) step(band);
    const cv::Mat inside = band.pixels(here).clone();
    before.copyTo(band.pixels);
    inside.copyTo(band.pixels(here));
  });
}

void Canvas::overlay(const cv::Mat& image, const cv::Matx23d& M, bool smooth) {
  // Both images count from pixel centres: shift by half a pixel before and after.
  cv::Matx23d pixels = M * scale_;
  pixels(0, 2) += 0.5 * (pixels(0, 0) + pixels(0, 1)) - 0.5;
  pixels(1, 2) += 0.5 * (pixels(1, 0) + pixels(1, 1)) - 0.5;
  steps_.emplace_back([image, pixels, smooth](const Band& band) {
    cv::Matx23d here = pixels;
    here(1, 2) -= band.top;
    cv::Mat warped;
    cv::warpAffine(
        image,
        warped,
        here,
        band.pixels.size(),
        smooth ? cv::INTER_LINEAR : cv::INTER_NEAREST,
        cv::BORDER_CONSTANT);
    for (int y = 0; y < warped.rows; ++y) {
      const auto* over = warped.ptr<cv::Vec4b>(y);
      auto* below = band.pixels.ptr<cv::Vec3b>(y);
      for (int x = 0; x < warped.cols; ++x) {
        const int transparency = 255 - over[x][3];
        if (transparency == 255) continue;
        for (int c = 0; c < 3; ++c) {
          below[x][c] =
              cv::saturate_cast<uchar>(over[x][c] + (below[x][c] * transparency + 127) / 255);
        }
      }
    }
  });
}

std::string Canvas::png() const {
  cv::Mat picture(height_px_, width_px_, CV_8UC3);
  cv::Mat drawn;
  for (int top = 0; top < height_px_; top += kBandRows) {
    cv::Mat part = picture.rowRange(top, std::min(top + kBandRows, height_px_));
    drawn.create(kOversampling * part.rows, kOversampling * part.cols, CV_8UC3);
    drawn.setTo(background_);
    const Band band{drawn, kOversampling * top};
    for (const Step& step : steps_) step(band);
    cv::resize(drawn, part, part.size(), 0.0, 0.0, cv::INTER_AREA);
  }
  std::vector<uchar> bytes;
  cv::imencode(".png", picture, bytes, {cv::IMWRITE_PNG_COMPRESSION, 6});
  return {bytes.begin(), bytes.end()};
}

}  // namespace vestibule::gui_headless
