#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "vestibule/core/frames.hpp"

namespace vestibule::gui_headless {

/// A picture drawn at twice its size and shrunk at the end, which smooths lines and stroke fonts.
/// All coordinates and widths are in layout pixels, y down, fractions welcome; the final picture
/// has `density` pixels per layout pixel, so that text keeps its size beside the text of a page.
/// What is to be drawn is noted, and drawn band by band when the picture is asked for: that takes a
/// fraction of the memory of a whole picture at twice its size.
class Canvas {
 public:
  using Px = cv::Point2d;

  /// \param width_px,height_px of the final picture
  Canvas(int width_px, int height_px, double density, std::string_view background);

  /// Pixels that are really drawn per layout pixel.
  [[nodiscard]] double scale() const { return scale_; }

  void line(Px a, Px b, std::string_view colour, double width);
  void polyline(const std::vector<Px>& points, std::string_view colour, double width);
  /// \param on,off lengths of the dashes along the path
  void dashedPolyline(
      const std::vector<Px>& points, std::string_view colour, double width, double on, double off);
  void fillPolygon(const std::vector<Px>& points, std::string_view colour);
  void fillRect(const cv::Rect2d& rect, std::string_view colour);
  void strokeRect(const cv::Rect2d& rect, std::string_view colour, double width);
  void fillCircle(Px centre, double radius, std::string_view colour);
  void strokeCircle(Px centre, double radius, std::string_view colour, double width);

  enum class Align { kLeft, kCentre, kRight };
  struct TextLook {
    double size = 13.0;  ///< about the height of a capital letter times 1.4
    std::string_view colour;
    bool bold = false;
    bool halo = false;  ///< white rim, for text over drawings
    Align align = Align::kLeft;
  };
  /// `baseline` is the left (centre, right) end of the baseline.
  void text(const std::string& words, Px baseline, const TextLook& look);
  [[nodiscard]] double textWidth(const std::string& words, const TextLook& look) const;

  /// Whatever `draw` draws is blended with the given opacity, overlapping shapes only once.
  void blend(double opacity, const std::function<void()>& draw);
  /// Drawing outside of the rectangle is undone.
  void clipped(const cv::Rect2d& rect, const std::function<void()>& draw);

  /// Lays a premultiplied BGRA image over the picture. `M` takes edge coordinates of `image` (0 at
  /// the outer edge of the first pixel) to picture pixels.
  void overlay(const cv::Mat& image, const cv::Matx23d& M, bool smooth);

  [[nodiscard]] std::string png() const;

 private:
  /// Some rows of the picture that is really drawn.
  struct Band {
    cv::Mat& pixels;
    int top = 0;  ///< first of the rows
    [[nodiscard]] cv::Rect part(const cv::Rect& of_picture) const {
      const cv::Rect moved(of_picture.tl() - cv::Point(0, top), of_picture.size());
      return moved & cv::Rect(0, 0, pixels.cols, pixels.rows);
    }
  };
  using Step = std::function<void(const Band&)>;

  [[nodiscard]] cv::Point fixedPoint(Px p) const;
  [[nodiscard]] int fixedLength(double length) const;
  [[nodiscard]] int thickness(double width) const;
  [[nodiscard]] cv::Rect pixelRect(const cv::Rect2d& rect) const;
  /// What of a line is in the picture or near it.
  [[nodiscard]] std::optional<std::pair<Px, Px>> visible(Px a, Px b) const;
  [[nodiscard]] double fontScale(const TextLook& look) const;
  [[nodiscard]] int stroke(const TextLook& look) const;
  void circle(Px centre, double radius, std::string_view colour, int pen);
  /// The steps that `draw` notes.
  [[nodiscard]] std::vector<Step> stepsOf(const std::function<void()>& draw);

  int width_px_;
  int height_px_;
  double scale_;  ///< really drawn pixels per layout pixel
  cv::Scalar background_;
  std::vector<Step> steps_;
};

/// North-up mapping of a part of the map frame onto a rectangle of a canvas.
class View {
 public:
  View(const cv::Rect2d& area, const Point2& p_map_centre, double px_per_m)
      : area_(area), p_map_centre_(p_map_centre), px_per_m_(px_per_m) {}

  [[nodiscard]] Canvas::Px operator()(const Point2& p_map) const {
    return {
        area_.x + 0.5 * area_.width + (p_map.x - p_map_centre_.x) * px_per_m_,
        area_.y + 0.5 * area_.height - (p_map.y - p_map_centre_.y) * px_per_m_};
  }
  [[nodiscard]] Canvas::Px operator()(const Pose2& T_map_x) const {
    return (*this)(Point2(T_map_x.x, T_map_x.y));
  }
  [[nodiscard]] const cv::Rect2d& area() const { return area_; }
  [[nodiscard]] double pxPerMetre() const { return px_per_m_; }
  [[nodiscard]] double west() const { return p_map_centre_.x - 0.5 * area_.width / px_per_m_; }
  [[nodiscard]] double east() const { return p_map_centre_.x + 0.5 * area_.width / px_per_m_; }
  [[nodiscard]] double south() const { return p_map_centre_.y - 0.5 * area_.height / px_per_m_; }
  [[nodiscard]] double north() const { return p_map_centre_.y + 0.5 * area_.height / px_per_m_; }

 private:
  cv::Rect2d area_;
  Point2 p_map_centre_;
  double px_per_m_;
};

}  // namespace vestibule::gui_headless
