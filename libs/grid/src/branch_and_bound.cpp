#include "vestibule/grid/branch_and_bound.hpp"

#include <algorithm>
#include <atomic>
#include <cassert>
#include <cmath>
#include <mutex>
#include <set>

#include "vestibule/core/parallel.hpp"

namespace vestibule::grid {
namespace {

constexpr int kTop = ScoreField::kTop;
constexpr int kTopSize = 1 << kTop;
constexpr std::size_t kMaxPoints = 256;  // sums of bytes stay below 2^16
constexpr int kYawSectors = 8;

/// Squares of cells at one yaw; `bound` is no less than the score of any pose in it.
struct Node {
  int bound = 0;
  int slice = 0;
  int ix = 0;
  int iy = 0;
};

/// One yaw: the end points as whole cells from the base.
struct Slice {
  double yaw_rad = 0.0;  // in the field
  std::vector<int> dx;
  std::vector<int> dy;
};

/// The prior's penalty in score units (ScoreField::kOne per point), exact for a pose and a lower
/// bound for a square of poses.
class Penalty {
 public:
  Penalty(const std::optional<PosePrior>& prior, const ScoreField& field, std::size_t points)
      : units_(static_cast<double>(points) * ScoreField::kOne), resolution_m_(field.resolution()) {
    if (!prior) return;
    active_ = true;
    weight_ = prior->weight;
    max_d2_ = prior->max_d2;
    T_field_prior_ = between(field.T_map_field(), prior->T_map_base);
    const double c = std::cos(field.T_map_field().phi);
    const double s = std::sin(field.T_map_field().phi);
    Eigen::Matrix3d R;  // map axes from field axes
    R << c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0;
    information_ = R.transpose() * prior->information * R;
    // One cell in x and one in y change d by at most this.
    slack_per_cell_ = resolution_m_ * (std::sqrt(std::max(0.0, information_(0, 0))) +
                                       std::sqrt(std::max(0.0, information_(1, 1))));
  }

  /// Smallest penalty among the cells of a square.
  [[nodiscard]] int of(int size, double yaw_rad, int ix, int iy) const {
    if (!active_) return 0;
    const double half = 0.5 * size;
    const Eigen::Vector3d e(
        (ix + half) * resolution_m_ - T_field_prior_.x,
        (iy + half) * resolution_m_ - T_field_prior_.y,
        angleDiff(yaw_rad, T_field_prior_.phi));
    const double d_centre = std::sqrt(std::max(0.0, e.dot(information_ * e)));
    const double rounding = size > 1 ? 1e-9 : 0.0;
    const double d = std::max(0.0, d_centre - (half - 0.5) * slack_per_cell_ - rounding);
    return static_cast<int>(std::floor(units_ * weight_ * std::min(d * d, max_d2_)));
  }

 private:
  bool active_ = false;
  double units_;
  double resolution_m_;
  double weight_ = 0.0;
  double max_d2_ = 0.0;
  double slack_per_cell_ = 0.0;
  Pose2 T_field_prior_;
  Eigen::Matrix3d information_ = Eigen::Matrix3d::Zero();
};

/// The best pose of every block, and the score that a pose must reach to matter. A pose is one
/// number: its score, then (inverted) its place in the order of poses, so that the larger number
/// is the better pose and no two are equal.
class BestOfBlocks {
 public:
  BestOfBlocks(std::size_t blocks, std::size_t wanted, int min_score, double relative_score)
      : best_(blocks), wanted_(wanted), relative_score_(relative_score), threshold_(min_score) {}

  static constexpr std::uint64_t kOrderMask = (std::uint64_t{1} << 40) - 1;
  static std::uint64_t packed(int score, std::uint64_t order) {
    return (static_cast<std::uint64_t>(score) << 40) | (kOrderMask - order);
  }
  static int scoreOf(std::uint64_t pose) { return static_cast<int>(pose >> 40); }
  static std::uint64_t orderOf(std::uint64_t pose) { return kOrderMask - (pose & kOrderMask); }

  /// Poses that score less change nothing.
  [[nodiscard]] int threshold() const { return threshold_.load(std::memory_order_relaxed); }
  [[nodiscard]] std::uint64_t best(std::size_t block) const {
    return best_[block].load(std::memory_order_relaxed);
  }

  void offer(std::size_t block, std::uint64_t pose) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const std::uint64_t old = best_[block].load(std::memory_order_relaxed);
    if (pose <= old) return;
    best_[block].store(pose, std::memory_order_relaxed);
    leading_.erase(old);
    leading_.insert(pose);
    if (leading_.size() > wanted_) leading_.erase(leading_.begin());
    int threshold = threshold_.load(std::memory_order_relaxed);
    if (leading_.size() == wanted_) threshold = std::max(threshold, scoreOf(*leading_.begin()));
    const double of_best = relative_score_ * scoreOf(*leading_.rbegin());
    threshold = std::max(threshold, static_cast<int>(std::ceil(of_best)));
    threshold_.store(threshold, std::memory_order_relaxed);
  }

  /// Best first. Only what reaches the final threshold: whatever the order of the offers was, it
  /// is all there.
  [[nodiscard]] std::vector<std::uint64_t> leading() const {
    std::vector<std::uint64_t> poses(leading_.rbegin(), leading_.rend());
    poses.erase(
        std::remove_if(
            poses.begin(), poses.end(), [this](auto p) { return scoreOf(p) < threshold(); }),
        poses.end());
    return poses;
  }

 private:
  std::vector<std::atomic<std::uint64_t>> best_;
  std::size_t wanted_;
  double relative_score_;
  std::atomic<int> threshold_;
  std::mutex mutex_;
  std::set<std::uint64_t> leading_;  // the `wanted_` largest of best_
};

std::vector<Point2> usable(const std::vector<Point2>& points, double reach_m) {
  std::vector<Point2> near;
  for (const Point2& p : points) {
    if (std::hypot(p.x, p.y) <= reach_m) near.push_back(p);
  }
  if (near.size() <= kMaxPoints) return near;
  std::vector<Point2> thinned;
  for (std::size_t i = 0; i < kMaxPoints; ++i) {
    thinned.push_back(near[i * near.size() / kMaxPoints]);
  }
  return thinned;
}

/// One search: the lattice, its squares and their bounds.
class Search {
 public:
  Search(
      const ScoreField& field,
      const std::vector<Point2>& points,
      const SearchWindow& window,
      const BaseMask* mask,
      const std::optional<PosePrior>& prior,
      const BranchAndBoundParams& params)
      : field_(field),
        mask_(mask),
        params_(params),
        points_(points.size()),
        penalty_(prior, field, points.size()),
        blocks_x_((field.width() + kTopSize - 1) / kTopSize),
        blocks_y_((field.height() + kTopSize - 1) / kTopSize),
        best_(
            static_cast<std::size_t>(blocks_x_ * blocks_y_ * kYawSectors),
            static_cast<std::size_t>(4 * params.max_matches),
            static_cast<int>(std::ceil(params.min_score * units())),
            params.relative_score) {
    const Pose2 centre = between(field.T_map_field(), window.T_map_centre);
    const double res = field.resolution();
    x_begin_ = std::max(0, static_cast<int>(std::floor((centre.x - window.half_x_m) / res)));
    y_begin_ = std::max(0, static_cast<int>(std::floor((centre.y - window.half_y_m) / res)));
    x_end_ = std::min(
        field.width(), static_cast<int>(std::floor((centre.x + window.half_x_m) / res)) + 1);
    y_end_ = std::min(
        field.height(), static_cast<int>(std::floor((centre.y + window.half_y_m) / res)) + 1);
    makeSlices(points, centre.phi, window.half_yaw_rad);
  }

  std::vector<PoseMatch> run() {
    if (x_begin_ >= x_end_ || y_begin_ >= y_end_ || points_ == 0) return {};
    const std::size_t threads = threadCount(params_.threads);
    std::vector<std::vector<Node>> of_slice(slices_.size());
    parallelFor(slices_.size(), threads, [&](std::size_t k) {
      of_slice[k] = topSquares(static_cast<int>(k));
    });
    const std::vector<Node> nodes = byBound(of_slice);
    constexpr std::size_t kBatch = 32;
    parallelFor((nodes.size() + kBatch - 1) / kBatch, threads, [&](std::size_t batch) {
      const std::size_t end = std::min(nodes.size(), (batch + 1) * kBatch);
      for (std::size_t i = batch * kBatch; i < end; ++i) descend(nodes[i], kTop);
    });
    return separated();
  }

 private:
  [[nodiscard]] double units() const { return static_cast<double>(points_) * ScoreField::kOne; }

  void makeSlices(const std::vector<Point2>& points, double centre_yaw_rad, double half_yaw_rad) {
    double radius_m = 0.0;
    for (const Point2& p : points) radius_m = std::max(radius_m, std::hypot(p.x, p.y));
    radius_m = std::max(field_.resolution(), std::min(radius_m, params_.yaw_radius_m));
    // A chord of one cell.
    const double step = 2.0 * std::asin(0.5 * field_.resolution() / radius_m);
    slice_count_ = static_cast<int>(std::ceil(2.0 * kPi / step));
    for (int k = 0; k < slice_count_; ++k) {
      Slice slice;
      slice.yaw_rad = wrapToPi(2.0 * kPi * k / slice_count_);
      if (std::abs(angleDiff(slice.yaw_rad, centre_yaw_rad)) > half_yaw_rad + 1e-9) continue;
      const double c = std::cos(slice.yaw_rad) / field_.resolution();
      const double s = std::sin(slice.yaw_rad) / field_.resolution();
      for (const Point2& p : points) {
        slice.dx.push_back(static_cast<int>(std::floor(0.5 + c * p.x - s * p.y)));
        slice.dy.push_back(static_cast<int>(std::floor(0.5 + s * p.x + c * p.y)));
      }
      slices_.push_back(std::move(slice));
    }
  }

  [[nodiscard]] std::size_t blockOf(int slice, int ix, int iy) const {
    const double turn = slices_[static_cast<std::size_t>(slice)].yaw_rad / (2.0 * kPi) + 0.5;
    const int sector = std::min(kYawSectors - 1, static_cast<int>(turn * kYawSectors));
    return static_cast<std::size_t>(
        (sector * blocks_y_ + iy / kTopSize) * blocks_x_ + ix / kTopSize);
  }

  /// Place of a pose in the order of poses.
  [[nodiscard]] std::uint64_t order(int slice, int ix, int iy) const {
    return (static_cast<std::uint64_t>(slice) * static_cast<std::uint64_t>(field_.height()) +
            static_cast<std::uint64_t>(iy)) *
               static_cast<std::uint64_t>(field_.width()) +
           static_cast<std::uint64_t>(ix);
  }

  [[nodiscard]] bool inWindow(int size, int ix, int iy) const {
    return ix < x_end_ && iy < y_end_ && ix + size > x_begin_ && iy + size > y_begin_;
  }

  /// All squares of the top level at one yaw whose bound reaches the threshold.
  std::vector<Node> topSquares(int slice_index) {
    const Slice& slice = slices_[static_cast<std::size_t>(slice_index)];
    const int i_begin = x_begin_ / kTopSize;
    const auto n = static_cast<std::size_t>((x_end_ - 1) / kTopSize - i_begin + 1);
    std::vector<std::uint16_t> sums(n);
    std::vector<Node> nodes;
    Node best;
    for (int iy = y_begin_ / kTopSize * kTopSize; iy < y_end_; iy += kTopSize) {
      std::fill(sums.begin(), sums.end(), std::uint16_t{0});
      for (std::size_t p = 0; p < points_; ++p) {
        const std::uint8_t* row = field_.topRow(i_begin * kTopSize + slice.dx[p], iy + slice.dy[p]);
        for (std::size_t i = 0; i < n; ++i) {
          sums[i] = static_cast<std::uint16_t>(sums[i] + row[i]);
        }
      }
      const int threshold = best_.threshold();
      for (std::size_t i = 0; i < n; ++i) {
        if (sums[i] < threshold) continue;
        const int ix = (i_begin + static_cast<int>(i)) * kTopSize;
        if (mask_ != nullptr && !mask_->any(kTop, ix, iy)) continue;
        const int bound = sums[i] - penalty_.of(kTopSize, slice.yaw_rad, ix, iy);
        if (bound < threshold) continue;
        nodes.push_back({bound, slice_index, ix, iy});
        if (bound > best.bound) best = nodes.back();
      }
    }
    // A first look at the most promising square raises the threshold for the other yaws.
    if (best.bound > 0) descend(best, kTop);
    return nodes;
  }

  /// All nodes, largest bound first, then in the order of poses (a counting sort).
  [[nodiscard]] std::vector<Node> byBound(const std::vector<std::vector<Node>>& of_slice) const {
    std::vector<std::size_t> start(static_cast<std::size_t>(units()) + 2);
    const int threshold = best_.threshold();
    const auto place = [&](const Node& node) {
      return start.size() - 2 - static_cast<std::size_t>(node.bound);
    };
    for (const auto& nodes : of_slice) {
      for (const Node& node : nodes) {
        if (node.bound >= threshold) ++start[place(node) + 1];
      }
    }
    for (std::size_t i = 1; i < start.size(); ++i) start[i] += start[i - 1];
    std::vector<Node> sorted(start.back());
    for (const auto& nodes : of_slice) {
      for (const Node& node : nodes) {
        if (node.bound >= threshold) sorted[start[place(node)]++] = node;
      }
    }
    return sorted;
  }

  void descend(const Node& node, int level) {
    if (node.bound < best_.threshold()) return;
    const std::size_t block = blockOf(node.slice, node.ix, node.iy);
    const std::uint64_t first =
        BestOfBlocks::packed(node.bound, order(node.slice, node.ix, node.iy));
    if (first <= best_.best(block)) return;  // not even its first pose could be better
    if (level == 0) {
      best_.offer(block, first);
      return;
    }
    std::array<Node, 4> children;
    const std::size_t n = expand(node, level - 1, children);
    for (std::size_t i = 0; i < n; ++i) descend(children[i], level - 1);
  }

  /// The four squares of the next level that may hold a match, most promising first.
  std::size_t expand(const Node& node, int level, std::array<Node, 4>& children) const {
    const Slice& slice = slices_[static_cast<std::size_t>(node.slice)];
    const int size = 1 << level;
    const std::uint8_t* cells = field_.level(level) + field_.index(node.ix, node.iy);
    const auto stride = static_cast<std::ptrdiff_t>(field_.stride());
    const std::ptrdiff_t up = size * stride;
    std::array<int, 4> sums{};
    for (std::size_t p = 0; p < points_; ++p) {
      const std::uint8_t* c = cells + slice.dy[p] * stride + slice.dx[p];
      sums[0] += c[0];
      sums[1] += c[size];
      sums[2] += c[up];
      sums[3] += c[up + size];
    }
    std::size_t n = 0;
    for (int i = 0; i < 4; ++i) {
      const int ix = node.ix + (i % 2) * size;
      const int iy = node.iy + (i / 2) * size;
      if (!inWindow(size, ix, iy) || (mask_ != nullptr && !mask_->any(level, ix, iy))) continue;
      const int bound =
          sums[static_cast<std::size_t>(i)] - penalty_.of(size, slice.yaw_rad, ix, iy);
      if (bound <= 0) continue;
      std::size_t place = n++;
      for (; place > 0 && children[place - 1].bound < bound; --place) {
        children[place] = children[place - 1];
      }
      children[place] = {bound, node.slice, ix, iy};
    }
    return n;
  }

  /// Non-maximum suppression.
  [[nodiscard]] std::vector<PoseMatch> separated() const {
    const auto width = static_cast<std::uint64_t>(field_.width());
    const auto height = static_cast<std::uint64_t>(field_.height());
    std::vector<PoseMatch> kept;
    for (const std::uint64_t pose : best_.leading()) {
      if (kept.size() == static_cast<std::size_t>(params_.max_matches)) break;
      const std::uint64_t order = BestOfBlocks::orderOf(pose);
      const Pose2 T_field_base{
          (static_cast<double>(order % width) + 0.5) * field_.resolution(),
          (static_cast<double>(order / width % height) + 0.5) * field_.resolution(),
          slices_[order / width / height].yaw_rad};
      const Pose2 T = compose(field_.T_map_field(), T_field_base);
      const bool separate = std::all_of(kept.begin(), kept.end(), [&](const PoseMatch& other) {
        return distance(other.T_map_base, T) >= params_.separation_m ||
               std::abs(angleDiff(other.T_map_base.phi, T.phi)) >= params_.separation_rad;
      });
      if (separate) kept.push_back({T, BestOfBlocks::scoreOf(pose) / units()});
    }
    return kept;
  }

  const ScoreField& field_;
  const BaseMask* mask_;
  const BranchAndBoundParams& params_;
  std::size_t points_;
  Penalty penalty_;
  int blocks_x_;
  int blocks_y_;
  BestOfBlocks best_;
  int x_begin_ = 0, y_begin_ = 0, x_end_ = 0, y_end_ = 0;  // cells of the window
  int slice_count_ = 0;
  std::vector<Slice> slices_;
};

}  // namespace

BaseMask::BaseMask(int width, int height, std::vector<std::uint8_t> allowed) {
  assert(allowed.size() == static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  levels_[0] = {width, std::move(allowed)};
  int rows = height;
  for (std::size_t h = 1; h < levels_.size(); ++h) {
    const Level& below = levels_[h - 1];
    Level& level = levels_[h];
    level.width = (below.width + 1) / 2;
    const int rows_below = rows;
    rows = (rows + 1) / 2;
    level.any.assign(static_cast<std::size_t>(level.width) * static_cast<std::size_t>(rows), 0);
    for (int iy = 0; iy < rows_below; ++iy) {
      for (int ix = 0; ix < below.width; ++ix) {
        if (below.any[static_cast<std::size_t>(iy * below.width + ix)] != 0) {
          level.any[static_cast<std::size_t>(iy / 2 * level.width + ix / 2)] = 1;
        }
      }
    }
  }
}

BaseMask BaseMask::freeSpace(const ScoreField& field, const OccupancyMap& map) {
  std::vector<std::uint8_t> allowed(
      static_cast<std::size_t>(field.width()) * static_cast<std::size_t>(field.height()));
  const int factor = static_cast<int>(std::lround(field.resolution() / map.resolution()));
  for (int iy = 0; iy < map.height(); ++iy) {
    for (int ix = 0; ix < map.width(); ++ix) {
      if (map.cell(ix, iy) != Cell::kFree) continue;
      allowed[static_cast<std::size_t>(iy / factor * field.width() + ix / factor)] = 1;
    }
  }
  return {field.width(), field.height(), std::move(allowed)};
}

bool BaseMask::any(int level, int ix, int iy) const {
  const Level& l = levels_[static_cast<std::size_t>(level)];
  return l.any[static_cast<std::size_t>((iy >> level) * l.width + (ix >> level))] != 0;
}

SearchWindow wholeField(const ScoreField& field) {
  const double half_x_m = 0.5 * field.width() * field.resolution();
  const double half_y_m = 0.5 * field.height() * field.resolution();
  return {compose(field.T_map_field(), Pose2{half_x_m, half_y_m, 0.0}), half_x_m, half_y_m, kPi};
}

void describe(ParamIo& io, BranchAndBoundParams& p) {
  io.optional("min_score", p.min_score, inside(0.0, 1.0));
  io.optional("relative_score", p.relative_score, within(0.0, 1.0));
  io.optional("max_matches", p.max_matches, within(1, 1000));
  io.optional("separation_m", p.separation_m, positive());
  io.optionalDegrees("separation_deg", p.separation_rad, positive());
  io.optional("yaw_radius_m", p.yaw_radius_m, positive());
  io.optional("threads", p.threads, within(0, 256));
}

std::vector<PoseMatch> BranchAndBoundMatcher::match(
    const ScoreField& field,
    const std::vector<Point2>& points_base,
    const SearchWindow& window,
    const BaseMask* mask,
    const std::optional<PosePrior>& prior) const {
  const std::vector<Point2> points = usable(points_base, field.reach());
  return Search(field, points, window, mask, prior, params_).run();
}

}  // namespace vestibule::grid
