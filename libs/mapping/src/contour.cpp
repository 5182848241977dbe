#include "contour.hpp"

#include <algorithm>
#include <cmath>

#include "vestibule/core/angles.hpp"

namespace vestibule::mapping {
namespace {

constexpr int kMaxBeams = 720;  // finer scans are thinned to so many
constexpr double kSampleSpacing_m = 0.05;
constexpr std::size_t kMaxSamples = 180;
constexpr int kLineHalfWidth = 5;            // beams to each side that a line is fitted to, at most
constexpr double kLineReach_m = 0.35;        // ... and no farther than this, or than ...
constexpr double kLineReachInSteps = 3.5;    // ... so many spacings of beams
constexpr double kMaxThickness_m = 0.03;     // one sigma across a line
constexpr double kMaxThickness_share = 0.3;  // and of that along it
constexpr int kMaxLook = 12;                 // beams to each side in which a neighbour is sought
constexpr double kThrough_m = 0.3;           // a beam this far behind a point saw through it ...
constexpr double kThroughShare = 0.03;       // ... and this share of the range more
constexpr double kReachQuantile = 0.8;
constexpr double kSameSide = 0.7;  // cosine between the normals of one surface, at least

/// atan2 to 1e-5 rad (Abramowitz and Stegun 4.4.49), enough to find a beam; it is asked for every
/// point of every pair of scans.
double directionOf(double y, double x) {
  const double ax = std::abs(x);
  const double ay = std::abs(y);
  const double largest = std::max(ax, ay);
  if (largest <= 0.0) return 0.0;
  const double t = std::min(ax, ay) / largest;
  const double t2 = t * t;
  double angle =
      t * (0.9998660 + t2 * (-0.3302995 + t2 * (0.1801410 + t2 * (-0.0851330 + t2 * 0.0208351))));
  if (ay > ax) angle = 0.5 * kPi - angle;
  if (x < 0.0) angle = kPi - angle;
  return y < 0.0 ? -angle : angle;
}

}  // namespace

Contour::Contour(const LaserScan& scan, double max_range_m) : T_base_laser_(scan.T_base_laser) {
  const std::size_t n = scan.ranges_m.size();
  if (n == 0) return;
  const std::size_t stride = 1 + (n - 1) / kMaxBeams;
  const double c = std::cos(T_base_laser_.phi);
  const double s = std::sin(T_base_laser_.phi);
  std::vector<double> ranges;
  beams_.reserve((n - 1) / stride + 1);
  for (std::size_t i = 0; i < n; i += stride) {
    ContourPoint point;
    const auto range = static_cast<double>(scan.ranges_m[i]);
    if (scan.valid(i) && range <= max_range_m) {
      const double x = range * std::cos(scan.angle(i));
      const double y = range * std::sin(scan.angle(i));
      point.x = static_cast<float>(T_base_laser_.x + c * x - s * y);
      point.y = static_cast<float>(T_base_laser_.y + s * x + c * y);
      point.range_m = static_cast<float>(range);
      ranges.push_back(range);
    }
    beams_.push_back(point);
  }
  step_rad_ = scan.angle_step_rad * static_cast<double>(stride);
  const auto count = static_cast<double>(beams_.size());
  const double middle_rad =
      T_base_laser_.phi + scan.angle_min_rad + 0.5 * (count - 1.0) * step_rad_;
  middle_cos_ = std::cos(middle_rad);
  middle_sin_ = std::sin(middle_rad);
  full_circle_ = count * std::abs(step_rad_) > 2.0 * kPi - 1.5 * std::abs(step_rad_);
  if (!ranges.empty()) {
    const auto k = static_cast<std::ptrdiff_t>(kReachQuantile * static_cast<double>(ranges.size()));
    std::nth_element(ranges.begin(), ranges.begin() + k, ranges.end());
    reach_m_ = ranges[static_cast<std::size_t>(k)];
  }
  findLines();
  sample();
}

int Contour::wrapped(int k) const {
  const int n = static_cast<int>(beams_.size());
  if (k >= 0 && k < n) return k;
  return full_circle_ ? ((k % n) + n) % n : -1;
}

void Contour::findLines() {
  const int n = static_cast<int>(beams_.size());
  const Point2 p_laser{T_base_laser_.x, T_base_laser_.y};
  for (int i = 0; i < n; ++i) {
    ContourPoint& point = beams_[static_cast<std::size_t>(i)];
    if (point.range_m <= 0.0F) continue;
    const double reach =
        std::max(kLineReach_m, kLineReachInSteps * double{point.range_m} * std::abs(step_rad_));
    double sum_x = 0.0, sum_y = 0.0, sum_xx = 0.0, sum_xy = 0.0, sum_yy = 0.0;
    int count = 0;
    const auto take = [&](int k) {
      const int w = wrapped(k);
      if (w < 0) return false;
      const ContourPoint& q = beams_[static_cast<std::size_t>(w)];
      if (q.range_m <= 0.0F) return false;
      const double dx = double{q.x} - double{point.x};
      const double dy = double{q.y} - double{point.y};
      if (dx * dx + dy * dy > reach * reach) return false;
      sum_x += dx;
      sum_y += dy;
      sum_xx += dx * dx;
      sum_xy += dx * dy;
      sum_yy += dy * dy;
      ++count;
      return true;
    };
    take(i);
    for (int k = 1; k <= kLineHalfWidth && take(i + k); ++k) {
    }
    for (int k = 1; k <= kLineHalfWidth && take(i - k); ++k) {
    }
    if (count < 4) continue;
    const double m = count;
    const double xx = (sum_xx - sum_x * sum_x / m) / m;
    const double xy = (sum_xy - sum_x * sum_y / m) / m;
    const double yy = (sum_yy - sum_y * sum_y / m) / m;
    const double mean = 0.5 * (xx + yy);
    const double half = std::hypot(0.5 * (xx - yy), xy);
    const double across = std::sqrt(std::max(mean - half, 0.0));
    const double along = std::sqrt(mean + half);
    if (across > kMaxThickness_m || across > kMaxThickness_share * along) continue;
    const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy) + kPi / 2.0;
    const double nx = std::cos(angle);
    const double ny = std::sin(angle);
    const bool away = nx * (p_laser.x - double{point.x}) + ny * (p_laser.y - double{point.y}) < 0.0;
    point.setNormal(away ? -nx : nx, away ? -ny : ny);
  }
}

void Contour::sample() {
  std::vector<std::uint16_t> spaced;
  Point2 last{1e9, 1e9};
  for (std::size_t k = 0; k < beams_.size(); ++k) {
    const Point2 p{beams_[k].x, beams_[k].y};
    if (beams_[k].range_m <= 0.0F) continue;
    if (std::hypot(p.x - last.x, p.y - last.y) < kSampleSpacing_m) continue;
    spaced.push_back(static_cast<std::uint16_t>(k));
    last = p;
  }
  const std::size_t n = std::min(spaced.size(), kMaxSamples);
  samples_.reserve(n);
  for (std::size_t k = 0; k < n; ++k) samples_.push_back(spaced[k * spaced.size() / n]);
}

Contour::Look Contour::look(const Point2& p_base, double gate_m) const {
  Look result;
  if (beams_.empty()) return result;
  const double dx = p_base.x - T_base_laser_.x;
  const double dy = p_base.y - T_base_laser_.y;
  const double range = std::sqrt(dx * dx + dy * dy);
  const double off_middle =
      directionOf(middle_cos_ * dy - middle_sin_ * dx, middle_cos_ * dx + middle_sin_ * dy);
  const double index = off_middle / step_rad_ + 0.5 * static_cast<double>(beams_.size() - 1);
  const int k0 = static_cast<int>(std::floor(index + 0.5));
  const double width = gate_m / std::max(range * std::abs(step_rad_), 1e-3);
  const int half = std::min(static_cast<int>(width) + 1, kMaxLook);
  double best = gate_m * gate_m;
  const auto compare = [&](const ContourPoint& q) {
    const double ex = double{q.x} - p_base.x;
    const double ey = double{q.y} - p_base.y;
    const double d2 = ex * ex + ey * ey;
    if (d2 < best && q.range_m > 0.0F) {
      best = d2;
      result.nearest = &q;
    }
  };
  const int n = static_cast<int>(beams_.size());
  if (k0 >= half && k0 + half < n) {
    const ContourPoint* first = beams_.data() + (k0 - half);
    std::for_each(first, first + (2 * half + 1), compare);
  } else {
    for (int k = k0 - half; k <= k0 + half; ++k) {
      if (const int w = wrapped(k); w >= 0) compare(beams_[static_cast<std::size_t>(w)]);
    }
  }
  result.seen_through = result.nearest == nullptr && sawBehind(k0, range);
  return result;
}

bool Contour::sawBehind(int k0, double range) const {
  const double behind = range + kThrough_m + kThroughShare * range;
  bool any_behind = false;
  for (int k = k0 - 1; k <= k0 + 1; ++k) {
    const int w = wrapped(k);
    if (w < 0) continue;
    const ContourPoint& q = beams_[static_cast<std::size_t>(w)];
    if (q.range_m <= 0.0F) continue;
    if (!(q.range_m > behind)) return false;
    any_behind = true;
  }
  return any_behind;
}

bool sameSide(const ContourPoint& p, const ContourPoint& q, double cos_q_p, double sin_q_p) {
  return !p.onLine() || !q.onLine() ||
         (cos_q_p * p.nx() - sin_q_p * p.ny()) * q.nx() +
                 (sin_q_p * p.nx() + cos_q_p * p.ny()) * q.ny() >
             kSameSide;
}

namespace {

/// Visits b's samples and what of a's contour they lie on: visit(p_a, echo of a, seen through).
template <class Visit>
void forMatches(
    const Contour& a, const Contour& b, const Pose2& T_a_b, double gate_m, const Visit& visit) {
  const double c = std::cos(T_a_b.phi);
  const double s = std::sin(T_a_b.phi);
  b.forSamples([&](const ContourPoint& p) {
    const Point2 p_a{T_a_b.x + c * p.x - s * p.y, T_a_b.y + s * p.x + c * p.y};
    const Contour::Look look = a.look(p_a, gate_m);
    const bool same = look.nearest != nullptr && sameSide(p, *look.nearest, c, s);
    visit(p_a, same ? look.nearest : nullptr, look.seen_through);
  });
}

}  // namespace

Overlap overlap(const Contour& a, const Contour& b, const Pose2& T_a_b, double gate_m) {
  Overlap result;
  const auto count = [&](const Point2&, const ContourPoint* q, bool through) {
    ++result.points;
    if (q != nullptr) ++result.matched;
    if (through) ++result.conflicting;
  };
  forMatches(a, b, T_a_b, gate_m, count);
  forMatches(b, a, inverse(T_a_b), gate_m, count);
  return result;
}

Quadratic pointToLine(
    const Contour& a, const Contour& b, const Pose2& T_a_b, const AlignmentParams& params) {
  Quadratic sum;
  const double scale2 = 4.0 * params.sigma_m * params.sigma_m;
  const auto add = [&](double residual, const Eigen::Vector3d& J) {
    const double r2 = residual * residual;
    const double w = 1.0 / ((1.0 + r2 / scale2) * (1.0 + r2 / scale2));
    sum.H += w * J * J.transpose();
    sum.g += w * residual * J;
    sum.weighted_squares += w * r2;
    sum.weight += w;
    ++sum.pairs;
  };
  // Points of b on surfaces of a: r = n_a . (T_a_b p_b - q_a).
  forMatches(a, b, T_a_b, params.gate_m, [&](const Point2& p_a, const ContourPoint* q, bool) {
    if (q == nullptr || !q->onLine()) return;
    const double nx = q->nx();
    const double ny = q->ny();
    const double r = nx * (p_a.x - double{q->x}) + ny * (p_a.y - double{q->y});
    const double rx = p_a.x - T_a_b.x;
    const double ry = p_a.y - T_a_b.y;
    add(r, {nx, ny, -nx * ry + ny * rx});
  });
  // Points of a on surfaces of b: r = n_b . (T_b_a p_a - q_b), by the change of T_a_b.
  const double c = std::cos(T_a_b.phi);
  const double s = std::sin(T_a_b.phi);
  forMatches(
      b, a, inverse(T_a_b), params.gate_m, [&](const Point2& p_b, const ContourPoint* q, bool) {
        if (q == nullptr || !q->onLine()) return;
        const double nx = q->nx();
        const double ny = q->ny();
        const double r = nx * (p_b.x - double{q->x}) + ny * (p_b.y - double{q->y});
        add(r, {-(c * nx - s * ny), -(s * nx + c * ny), nx * p_b.y - ny * p_b.x});
      });
  if (sum.pairs == 0) return sum;
  const double tempering =
      std::min(1.0, params.effective_points / sum.pairs) / (params.sigma_m * params.sigma_m);
  sum.H *= tempering;
  sum.g *= tempering;
  return sum;
}

}  // namespace vestibule::mapping
