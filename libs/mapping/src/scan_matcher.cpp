#include "vestibule/mapping/scan_matcher.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "vestibule/core/angles.hpp"

namespace vestibule::mapping {
namespace {

constexpr double kKernelRadius2 = 1.5 * 1.5;  // [cells^2] reach of a mean point
constexpr int kHitsCounted = 8;               // more hits make a mean point no heavier
constexpr double kConverged_m = 4e-4;
constexpr double kConverged_rad = 4e-5;

/// Weighted mean of the mean points around a position, in cells.
struct MeanPoint {
  bool found = false;
  double x = 0.0;
  double y = 0.0;
};

class MeanPointSum {
 public:
  MeanPointSum(double x, double y) : x_(x), y_(y) {}

  /// \param ends  of the cell: Patch::Ends or PointCell
  template <class EndPoints>
  void add(const EndPoints& ends, int ix, int iy) {
    constexpr double kUnit = 1.0 / 65536.0;
    const double mx = ix + kUnit * ends.mean_x;
    const double my = iy + kUnit * ends.mean_y;
    const double d2 = (mx - x_) * (mx - x_) + (my - y_) * (my - y_);
    if (d2 >= kKernelRadius2) return;
    const double falloff = 1.0 - d2 / kKernelRadius2;
    const double w = falloff * falloff * std::min<int>(ends.hits, kHitsCounted);
    sum_ += w;
    sum_x_ += w * mx;
    sum_y_ += w * my;
  }
  [[nodiscard]] MeanPoint mean() const {
    if (sum_ <= 0.0) return {};
    return {true, sum_x_ / sum_, sum_y_ / sum_};
  }

 private:
  double x_, y_;
  double sum_ = 0.0, sum_x_ = 0.0, sum_y_ = 0.0;
};

/// Occupied mean points in the 3 x 3 cells around (x, y), both in cells.
MeanPoint meanPointNear(const PatchMap& map, double x, double y) {
  const int ix = static_cast<int>(std::floor(x));
  const int iy = static_cast<int>(std::floor(y));
  constexpr int kMask = Patch::kSide - 1;
  const int lx = ix & kMask;
  MeanPointSum sum(x, y);
  if (lx >= 1 && lx < kMask) {
    const Patch* patch = nullptr;
    for (int row = iy - 1; row <= iy + 1; ++row) {
      if (row == iy - 1 || (row & kMask) == 0) {
        patch = map.patch(ix >> Patch::kBits, row >> Patch::kBits);
      }
      if (patch == nullptr) continue;
      const auto r = static_cast<std::size_t>(row & kMask);
      const auto left = static_cast<unsigned>(lx - 1);
      const std::uint32_t occupied = patch->occupied_rows[r] >> left & 7U;
      if (occupied == 0) continue;
      const std::uint32_t hit = patch->hit_rows[r] >> left & 7U;
      const Patch::Ends* ends = &patch->ends[patch->place(r, left)];
      for (unsigned k = 0; k < 3; ++k) {
        if ((hit >> k & 1U) == 0) continue;
        if ((occupied >> k & 1U) != 0) sum.add(*ends, ix - 1 + static_cast<int>(k), row);
        ++ends;
      }
    }
    return sum.mean();
  }
  for (int row = iy - 1; row <= iy + 1; ++row) {
    for (int col = ix - 1; col <= ix + 1; ++col) {
      const PointCell cell = map.cell(col, row);
      if (map.occupied(cell)) sum.add(cell, col, row);
    }
  }
  return sum.mean();
}

/// Residual across a wall, distance from a spot [m]; none where the surface is unclear.
double residual(const ScanPoint& p, double nx, double ny, double dx, double dy) {
  switch (p.surface) {
    case Surface::kWall:
      return nx * dx + ny * dy;
    case Surface::kSpot:
      return std::hypot(dx, dy);
    case Surface::kUnclear:
      break;
  }
  return 0.0;
}

double tempering(const MatcherParams& params, std::size_t beams) {
  return std::min(
      1.0, params.effective_beams / static_cast<double>(std::max<std::size_t>(beams, 1)));
}

}  // namespace

ScanFit ScanMatcher::fit(
    const PatchMap& map, const ScanPoints& scan, const Pose2& T_map_base) const {
  const double c = std::cos(T_map_base.phi);
  const double s = std::sin(T_map_base.phi);
  const double res = map.resolution();
  const double scale = 1.0 / res;
  const double log_rand = std::log(params_.z_rand);
  const double log_unknown = std::log(params_.z_unknown);
  const double k = 0.5 / (params_.sigma_m * params_.sigma_m);
  double sum = 0.0;
  std::size_t matched = 0;
  std::size_t known = 0;
  for (const ScanPoint& p : scan.points) {
    const double x = (T_map_base.x + c * p.x - s * p.y) * scale;
    const double y = (T_map_base.y + s * p.x + c * p.y) * scale;
    const MeanPoint near = meanPointNear(map, x, y);
    if (near.found) {
      const double r = residual(
          p, c * p.nx - s * p.ny, s * p.nx + c * p.ny, (x - near.x) * res, (y - near.y) * res);
      sum += std::log((1.0 - params_.z_rand) * std::exp(-k * r * r) + params_.z_rand);
      ++matched;
      ++known;
    } else if (map.cell(static_cast<int>(std::floor(x)), static_cast<int>(std::floor(y))).seen()) {
      sum += log_rand;
      ++known;
    } else {
      sum += log_unknown;
    }
  }
  ScanFit fit;
  const std::size_t n = scan.points.size();
  if (n == 0) return fit;
  fit.log_likelihood = sum * tempering(params_, n);
  fit.matched_share = static_cast<double>(matched) / static_cast<double>(n);
  fit.known_share = known == 0 ? 0.0 : static_cast<double>(matched) / static_cast<double>(known);
  return fit;
}

Refinement ScanMatcher::refine(
    const PatchMap& map, const ScanPoints& scan, const Pose2& start, const PosePrior& prior) const {
  const double res = map.resolution();
  const double scale = 1.0 / res;
  const double temper =
      tempering(params_, scan.points.size()) / (params_.sigma_m * params_.sigma_m);
  const double robust = 1.0 / (4.0 * params_.sigma_m * params_.sigma_m);
  Refinement result;
  Pose2 T = start;
  const auto fromPrior = [&](const Pose2& pose) {
    return Eigen::Vector3d(
        pose.x - prior.mean.x, pose.y - prior.mean.y, angleDiff(pose.phi, prior.mean.phi));
  };
  for (int iteration = 0; iteration < params_.iterations; ++iteration) {
    const double c = std::cos(T.phi);
    const double s = std::sin(T.phi);
    // Upper triangle of H = J'WJ and g = J'Wr.
    double hxx = 0.0, hxy = 0.0, hxt = 0.0, hyy = 0.0, hyt = 0.0, htt = 0.0;
    double gx = 0.0, gy = 0.0, gt = 0.0;
    const auto accumulate = [&](double jx, double jy, double jt, double r, double w) {
      hxx += w * jx * jx;
      hxy += w * jx * jy;
      hxt += w * jx * jt;
      hyy += w * jy * jy;
      hyt += w * jy * jt;
      htt += w * jt * jt;
      gx += w * jx * r;
      gy += w * jy * r;
      gt += w * jt * r;
    };
    for (const ScanPoint& p : scan.points) {
      if (p.surface == Surface::kUnclear) continue;
      const double rx = c * p.x - s * p.y;
      const double ry = s * p.x + c * p.y;
      const double x = (T.x + rx) * scale;
      const double y = (T.y + ry) * scale;
      const MeanPoint near = meanPointNear(map, x, y);
      if (!near.found) continue;
      const double dx = (x - near.x) * res;
      const double dy = (y - near.y) * res;
      if (p.surface == Surface::kWall) {
        const double nx = c * p.nx - s * p.ny;
        const double ny = s * p.nx + c * p.ny;
        const double r = nx * dx + ny * dy;
        const double w = 1.0 / (1.0 + r * r * robust);
        accumulate(nx, ny, ny * rx - nx * ry, r, w * w);
      } else {
        const double w = 1.0 / (1.0 + (dx * dx + dy * dy) * robust);
        accumulate(1.0, 0.0, -ry, dx, w * w);
        accumulate(0.0, 1.0, rx, dy, w * w);
      }
    }
    result.information << hxx, hxy, hxt, hxy, hyy, hyt, hxt, hyt, htt;
    result.information *= temper;
    const Eigen::Vector3d gradient =
        temper * Eigen::Vector3d(gx, gy, gt) + prior.information * fromPrior(T);
    const Eigen::Vector3d step = (result.information + prior.information).ldlt().solve(-gradient);
    if (!step.allFinite()) break;
    T.x += step.x();
    T.y += step.y();
    T.phi = wrapToPi(T.phi + step.z());
    if (std::hypot(step.x(), step.y()) < kConverged_m && std::abs(step.z()) < kConverged_rad) break;
  }
  result.T_map_base = T;
  const Eigen::Vector3d d = fromPrior(T);
  result.prior_chi2 = d.dot(prior.information * d);
  return result;
}

// --- correlative search
// ----------------------------------------------------------------------------

namespace {

constexpr double kBlur_m = 0.05;  // of the field that the search looks at
constexpr double kMinAngleStep_rad = degToRad(0.25);
constexpr double kMaxAngleStep_rad = degToRad(2.0);
constexpr std::size_t kSearchBeams = 90;
constexpr int kStampReach = 4;         // [cells] at least what a blurred cell reaches
constexpr double kPriorBound = 0.125;  // log-likelihood per beam that the prior can cost, at most

struct Candidate {
  double bound;
  int rotation;
  int dx;  // [cells], lower left of the block
  int dy;
  friend bool operator<(const Candidate& a, const Candidate& b) {
    if (a.bound != b.bound) return a.bound > b.bound;
    if (a.rotation != b.rotation) return a.rotation < b.rotation;
    if (a.dx != b.dx) return a.dx < b.dx;
    return a.dy < b.dy;
  }
};

/// Information of the yaw when x and y are free.
double marginalYawInformation(const Eigen::Matrix3d& information) {
  const Eigen::Matrix2d xy = information.topLeftCorner<2, 2>();
  if (xy.determinant() <= 0.0) return 0.0;
  const Eigen::Vector2d cross = information.block<2, 1>(0, 2);
  return std::max(0.0, information(2, 2) - cross.dot(xy.inverse() * cross));
}

}  // namespace

void ScanMatcher::drawField(const PatchMap& map, int x0, int y0, int x1, int y1) {
  field_.x0 = x0;
  field_.y0 = y0;
  field_.width = x1 - x0 + 1;
  field_.height = y1 - y0 + 1;
  const auto width = static_cast<std::size_t>(field_.width);
  field_.cells.assign(width * static_cast<std::size_t>(field_.height), 0);
  const int radius = std::max(1, static_cast<int>(std::lround(2.0 * kBlur_m / map.resolution())));
  const int side = 2 * radius + 1;
  std::vector<std::uint8_t> stamp;
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      const double d2 = (dx * dx + dy * dy) * map.resolution() * map.resolution();
      stamp.push_back(static_cast<std::uint8_t>(
          std::lround(255.0 * std::exp(-0.5 * d2 / (kBlur_m * kBlur_m)))));
    }
  }
  const auto draw = [&](int ix, int iy) {
    if (ix - radius < x0 || iy - radius < y0 || ix + radius > x1 || iy + radius > y1) return;
    for (int dy = 0; dy < side; ++dy) {
      std::uint8_t* row = &field_.cells
                               [static_cast<std::size_t>(iy - radius + dy - y0) * width +
                                static_cast<std::size_t>(ix - radius - x0)];
      const std::uint8_t* from = &stamp[static_cast<std::size_t>(dy * side)];
      for (int dx = 0; dx < side; ++dx) row[dx] = std::max(row[dx], from[dx]);
    }
  };
  for (int py = y0 >> Patch::kBits; py <= y1 >> Patch::kBits; ++py) {
    for (int px = x0 >> Patch::kBits; px <= x1 >> Patch::kBits; ++px) {
      const Patch* patch = map.patch(px, py);
      if (patch == nullptr) continue;
      for (int row = 0; row < Patch::kSide; ++row) {
        std::uint32_t bits = patch->occupied_rows[static_cast<std::size_t>(row)];
        while (bits != 0) {
          const int col = __builtin_ctz(bits);
          bits &= bits - 1;
          draw((px << Patch::kBits) + col, (py << Patch::kBits) + row);
        }
      }
    }
  }
}

Pose2 ScanMatcher::search(
    const PatchMap& map,
    const ScanPoints& scan,
    const PosePrior& prior,
    double window_m,
    double window_rad) {
  const double res = map.resolution();
  const int window = std::max(1, static_cast<int>(std::ceil(window_m / res)));
  // Levels so that the top one has a handful of blocks per axis.
  int levels = 0;
  while ((2 * window + 1) >> (levels + 1) >= 4) ++levels;
  const double angle_step =
      std::clamp(res / std::max(scan.reach_m, 0.1), kMinAngleStep_rad, kMaxAngleStep_rad);
  const int turns = static_cast<int>(std::ceil(window_rad / angle_step));

  const std::size_t n = std::min(scan.points.size(), kSearchBeams);
  if (n == 0) return prior.mean;

  // Cells of the end points, per rotation, and the box that holds them all.
  const auto rotations = static_cast<std::size_t>(2 * turns + 1);
  std::vector<std::pair<int, int>> ends(rotations * n);
  int x0 = std::numeric_limits<int>::max();
  int y0 = x0;
  int x1 = std::numeric_limits<int>::min();
  int y1 = x1;
  for (std::size_t r = 0; r < rotations; ++r) {
    const double yaw = prior.mean.phi + (static_cast<double>(r) - turns) * angle_step;
    const double c = std::cos(yaw);
    const double s = std::sin(yaw);
    for (std::size_t k = 0; k < n; ++k) {
      const ScanPoint& p = scan.points[k * scan.points.size() / n];
      const int ix = map.cellOf(prior.mean.x + c * p.x - s * p.y);
      const int iy = map.cellOf(prior.mean.y + s * p.x + c * p.y);
      ends[r * n + k] = {ix, iy};
      x0 = std::min(x0, ix);
      x1 = std::max(x1, ix);
      y0 = std::min(y0, iy);
      y1 = std::max(y1, iy);
    }
  }
  const int rim = window + (1 << levels) + kStampReach;
  drawField(map, x0 - rim, y0 - rim, x1 + rim, y1 + rim);
  const auto width = static_cast<std::size_t>(field_.width);
  const std::size_t cells = field_.cells.size();
  // max_[level](x, y) = maximum over [x, x + 2^level) x [y, y + 2^level).
  max_.resize(static_cast<std::size_t>(levels) + 1);
  max_[0].swap(field_.cells);
  for (int level = 1; level <= levels; ++level) {
    const auto& below = max_[static_cast<std::size_t>(level) - 1];
    auto& here = max_[static_cast<std::size_t>(level)];
    here.resize(cells);
    const std::size_t shift = std::size_t{1} << static_cast<unsigned>(level - 1);
    const std::size_t height = cells / width;
    for (std::size_t y = 0; y < height; ++y) {
      const std::uint8_t* low = &below[y * width];
      const std::uint8_t* high = &below[std::min(y + shift, height - 1) * width];
      std::uint8_t* out = &here[y * width];
      for (std::size_t x = 0; x + shift < width; ++x) {
        out[x] = std::max(std::max(low[x], low[x + shift]), std::max(high[x], high[x + shift]));
      }
      for (std::size_t x = width - shift; x < width; ++x) out[x] = std::max(low[x], high[x]);
    }
  }

  std::vector<std::size_t> offsets(ends.size());
  for (std::size_t i = 0; i < ends.size(); ++i) {
    offsets[i] = static_cast<std::size_t>(ends[i].second - field_.y0) * width +
                 static_cast<std::size_t>(ends[i].first - field_.x0);
  }
  const auto score = [&](int level, int rotation, int dx, int dy) {
    const std::uint8_t* grid = max_[static_cast<std::size_t>(level)].data();
    const std::size_t* offset = &offsets[static_cast<std::size_t>(rotation) * n];
    const std::ptrdiff_t shift = static_cast<std::ptrdiff_t>(dy) * field_.width + dx;
    unsigned sum = 0;
    for (std::size_t k = 0; k < n; ++k) sum += grid[static_cast<std::ptrdiff_t>(offset[k]) + shift];
    return static_cast<double>(sum) / (255.0 * static_cast<double>(n)) * params_.effective_beams;
  };
  // What the prior costs; above the lowest level the least that a block can cost: its yaw alone.
  const double yaw_information = marginalYawInformation(prior.information);
  const auto priorCost = [&](int level, int rotation, int dx, int dy) {
    const Eigen::Vector3d d(dx * res, dy * res, (rotation - turns) * angle_step);
    const double chi2 = level == 0 ? d.dot(prior.information * d) : d.z() * d.z() * yaw_information;
    return std::min(kPriorBound * params_.effective_beams, 0.5 * chi2);
  };

  std::vector<Candidate> open;
  const int block = 1 << levels;
  for (int r = 0; r < static_cast<int>(rotations); ++r) {
    for (int dy = -window; dy <= window; dy += block) {
      for (int dx = -window; dx <= window; dx += block) {
        open.push_back({score(levels, r, dx, dy) - priorCost(levels, r, dx, dy), r, dx, dy});
      }
    }
  }
  std::sort(open.begin(), open.end());
  Candidate best{-1e9, turns, 0, 0};
  struct Frame {
    int level;
    Candidate c;
  };
  std::vector<Frame> stack;
  for (const Candidate& top : open) {
    if (top.bound <= best.bound) break;
    stack.push_back({levels, top});
    while (!stack.empty()) {
      const Frame frame = stack.back();
      stack.pop_back();
      if (frame.c.bound <= best.bound) continue;
      if (frame.level == 0) {
        best = frame.c;
        continue;
      }
      const int level = frame.level - 1;
      // The best child comes to lie on top.
      const std::size_t bottom = stack.size();
      for (int k = 0; k < 4; ++k) {
        const int dx = frame.c.dx + ((k & 1) << level);
        const int dy = frame.c.dy + ((k >> 1) << level);
        if (dx > window || dy > window) continue;
        const double bound =
            score(level, frame.c.rotation, dx, dy) - priorCost(level, frame.c.rotation, dx, dy);
        if (bound <= best.bound) continue;
        const Candidate child{bound, frame.c.rotation, dx, dy};
        std::size_t at = stack.size();
        while (at > bottom && stack[at - 1].c < child) --at;
        stack.insert(stack.begin() + static_cast<std::ptrdiff_t>(at), Frame{level, child});
      }
    }
  }
  max_[0].swap(field_.cells);
  return {
      prior.mean.x + best.dx * res,
      prior.mean.y + best.dy * res,
      wrapToPi(prior.mean.phi + (best.rotation - turns) * angle_step)};
}

}  // namespace vestibule::mapping
