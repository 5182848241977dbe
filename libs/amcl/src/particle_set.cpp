#include "particle_set.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/parallel.hpp"

namespace vestibule::amcl {
namespace {

// A scan is turned once per bin and serves all particles in it: at half a bin, 0.1 deg, a beam end
// 10 m away is 2 cm off, a fraction of a cell.
constexpr std::size_t kYawBins = 1800;
constexpr std::size_t kMinPiece = 4096;  // particles worth a thread

enum class Reach { kInside, kDoubtful, kOutside };

/// Whether all, some or none of [least, most] lie in [0, size).
Reach reachOf(std::int32_t least, std::int32_t most, std::int32_t size) {
  if (most < 0 || least >= size) return Reach::kOutside;
  return least >= 0 && most < size ? Reach::kInside : Reach::kDoubtful;
}

/// Calls work(begin, end) on pieces of [0, n) whose ends are multiples of `grain`: a few per
/// thread, and one for all where there is too little for several. Pieces must not depend on each
/// other.
template <class Work>
void forPieces(std::size_t n, std::size_t grain, int threads, const Work& work) {
  const std::size_t pieces =
      std::max<std::size_t>(1, std::min(static_cast<std::size_t>(threads), n / kMinPiece));
  const std::size_t piece = (n / pieces + grain) / grain * grain;
  parallelFor((n + piece - 1) / piece, static_cast<std::size_t>(threads), [&](std::size_t i) {
    work(i * piece, std::min(n, (i + 1) * piece));
  });
}

}  // namespace

ParticleSet::ParticleSet(const LikelihoodTable& table, int threads, Simd simd)
    : table_(table), threads_(threads), simd_(simd) {}

void ParticleSet::resize(std::size_t n) {
  count_ = n;
  x_.resize(padded(n));
  y_.resize(padded(n));
  yaw_.resize(padded(n));
  log_weights_.assign(n, 0.0);
  weights_.assign(n, n > 0 ? 1.0 / static_cast<double>(n) : 0.0);
}

void ParticleSet::set(std::size_t i, const Pose2& T_grid_base) {
  x_[i] = static_cast<float>(T_grid_base.x);
  y_[i] = static_cast<float>(T_grid_base.y);
  yaw_[i] = static_cast<float>(wrapToPi(T_grid_base.phi));
}

Pose2 ParticleSet::pose(std::size_t i) const {
  return {static_cast<double>(x_[i]), static_cast<double>(y_[i]), static_cast<double>(yaw_[i])};
}

void ParticleSet::diffuse(const NoisyIncrement& increment, const NoiseKey& noise) {
  const ParticleArrays arrays{x_.data(), y_.data(), yaw_.data()};
  forPieces(padded(count_), kLanes, threads_, [&](std::size_t begin, std::size_t end) {
    propagate(arrays, begin, end, increment, noise, simd_);
  });
}

void ParticleSet::prediction_and_update_pfStandardProposal(
    const mrpt::obs::CActionCollection* /*action*/,
    const mrpt::obs::CSensoryFrame* /*observation*/,
    const mrpt::bayes::CParticleFilter::TParticleFilterOptions& options) {
  diffuse(step_.increment, step_.noise);
  weigh(*step_.ends);
  used_exponent_ = exponentFor(options.powFactor);
  for (std::size_t i = 0; i < count_; ++i) {
    log_weights_[i] += used_exponent_ * log_likelihoods_[i];
  }
}

void ParticleSet::weigh(const std::vector<Point2>& ends) {
  // Counting sort by yaw, then one turned scan per bin: the loop over beams only adds and loads.
  Sorted& s = sorted_;
  s.bin_of.resize(count_);
  s.order.resize(count_);
  s.x.resize(count_);
  s.y.resize(count_);
  s.sum.resize(count_);
  s.bin_begin.assign(kYawBins + 1, 0);
  log_likelihoods_.resize(count_);
  const auto bins_per_rad = static_cast<float>(kYawBins / (2.0 * kPi));
  for (std::size_t i = 0; i < count_; ++i) {
    const auto bin = static_cast<std::uint32_t>((yaw_[i] + static_cast<float>(kPi)) * bins_per_rad);
    s.bin_of[i] = std::min<std::uint32_t>(bin, kYawBins - 1);
    ++s.bin_begin[s.bin_of[i] + 1];
  }
  for (std::size_t b = 0; b < kYawBins; ++b) s.bin_begin[b + 1] += s.bin_begin[b];
  std::vector<std::uint32_t> next(s.bin_begin.begin(), s.bin_begin.end() - 1);
  for (std::size_t i = 0; i < count_; ++i) {
    const std::uint32_t k = next[s.bin_of[i]]++;
    s.order[k] = static_cast<std::uint32_t>(i);
    s.x[k] = table_.fixedX(x_[i]);
    s.y[k] = table_.fixedY(y_[i]);
  }

  const std::size_t beams = ends.size();
  const TableView table = table_.view();
  const auto weighBins = [&](std::size_t bin_from, std::size_t bin_to) {
    std::vector<std::int32_t> beam_x(beams);
    std::vector<std::int32_t> beam_y(beams);
    for (std::size_t b = bin_from; b < bin_to; ++b) {
      const std::size_t from = s.bin_begin[b];
      const std::size_t to = s.bin_begin[b + 1];
      if (from == to) continue;
      const double yaw = (static_cast<double>(b) + 0.5) * (2.0 * kPi / kYawBins) - kPi;
      const auto c = static_cast<float>(std::cos(yaw));
      const auto sn = static_cast<float>(std::sin(yaw));
      const auto x = std::minmax_element(&s.x[from], &s.x[from] + (to - from));
      const auto y = std::minmax_element(&s.y[from], &s.y[from] + (to - from));
      // Beams that end in the table wherever in the bin the particle is go from the front, those
      // that may end outside from the back. What always ends outside adds nothing: it is left out.
      std::size_t sure = 0;
      std::size_t doubtful = beams;
      for (const Point2& end : ends) {
        const auto px = static_cast<float>(end.x);
        const auto py = static_cast<float>(end.y);
        const std::int32_t bx = table_.fixedLength(c * px - sn * py);
        const std::int32_t by = table_.fixedLength(sn * px + c * py);
        const auto in_x = reachOf(*x.first + bx, *x.second + bx, table.width << kFractionBits);
        const auto in_y = reachOf(*y.first + by, *y.second + by, table.height << kFractionBits);
        if (in_x == Reach::kOutside || in_y == Reach::kOutside) continue;
        const bool inside = in_x == Reach::kInside && in_y == Reach::kInside;
        const std::size_t k = inside ? sure++ : --doubtful;
        beam_x[k] = bx;
        beam_y[k] = by;
      }
      const auto add = [&](std::size_t first, std::size_t last, bool inside) {
        sumOverBeams(
            table,
            beam_x.data() + first,
            beam_y.data() + first,
            last - first,
            &s.x[from],
            &s.y[from],
            to - from,
            inside,
            &s.sum[from],
            simd_);
      };
      std::fill(&s.sum[from], &s.sum[from] + (to - from), 0U);
      add(0, sure, true);
      if (doubtful < beams) add(doubtful, beams, false);
      for (std::size_t k = from; k < to; ++k) {
        log_likelihoods_[s.order[k]] = table_.logLikelihood(s.sum[k], beams);
      }
    }
  };
  // Pieces of bins that hold about equally many particles.
  forPieces(count_, 1, threads_, [&](std::size_t begin, std::size_t end) {
    const auto binOf = [&](std::size_t particle) {
      return static_cast<std::size_t>(
          std::lower_bound(s.bin_begin.begin(), s.bin_begin.end() - 1, particle) -
          s.bin_begin.begin());
    };
    weighBins(binOf(begin), end == count_ ? kYawBins : binOf(end));
  });
}

double ParticleSet::exponentFor(double wanted) const {
  const auto effective = [&](double exponent) {
    double largest = -1e300;
    for (std::size_t i = 0; i < count_; ++i) {
      largest = std::max(largest, log_weights_[i] + exponent * log_likelihoods_[i]);
    }
    double sum = 0.0;
    double sum_of_squares = 0.0;
    for (std::size_t i = 0; i < count_; ++i) {
      const double w = std::exp(log_weights_[i] + exponent * log_likelihoods_[i] - largest);
      sum += w;
      sum_of_squares += w * w;
    }
    return sum * sum / sum_of_squares / static_cast<double>(count_);
  };
  if (min_effective_share_ <= 0.0 || effective(wanted) >= min_effective_share_) return wanted;
  // Halving the interval is enough: the share falls with the exponent, not always strictly.
  constexpr double kSmallestShare = 0.1;  // of the wanted exponent: a scan always says something
  constexpr int kHalvings = 5;
  double low = kSmallestShare * wanted;
  double high = wanted;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (effective(middle) >= min_effective_share_ ? low : high) = middle;
  }
  return low;
}

double ParticleSet::normalizeWeights(double* out_max_log_w) {
  double largest = -1e300;
  double smallest = 1e300;
  for (const double w : log_weights_) {
    largest = std::max(largest, w);
    smallest = std::min(smallest, w);
  }
  if (out_max_log_w != nullptr) *out_max_log_w = largest;
  weights_.resize(count_);
  double sum = 0.0;
  for (std::size_t i = 0; i < count_; ++i) {
    log_weights_[i] -= largest;
    weights_[i] = std::exp(log_weights_[i]);
    sum += weights_[i];
  }
  for (double& w : weights_) w /= sum;
  return std::exp(largest - smallest);
}

double ParticleSet::ESS() const {
  double sum_of_squares = 0.0;
  for (const double w : weights_) sum_of_squares += w * w;
  return count_ == 0 ? 0.0 : 1.0 / (sum_of_squares * static_cast<double>(count_));
}

const std::vector<double>& ParticleSet::logLikelihoods(const std::vector<Point2>& ends) {
  weigh(ends);
  return log_likelihoods_;
}

PoseWithCovariance ParticleSet::moments(
    double* share, const std::vector<int>* labels, int label) const {
  // Coordinates are averaged as differences from the first particle: exact in single precision,
  // and right for angles as long as the cloud stays within half a turn of it.
  const auto wrapped = [](double angle) {
    if (angle > kPi) return angle - 2.0 * kPi;
    return angle < -kPi ? angle + 2.0 * kPi : angle;
  };
  double total = 0.0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  std::size_t first = count_;
  for (std::size_t i = 0; i < count_; ++i) {
    if (labels != nullptr && (*labels)[i] != label) continue;
    if (first == count_) first = i;
    const double w = weights_[i];
    total += w;
    sum.x() += w * static_cast<double>(x_[i] - x_[first]);
    sum.y() += w * static_cast<double>(y_[i] - y_[first]);
    sum.z() += w * wrapped(static_cast<double>(yaw_[i] - yaw_[first]));
  }
  if (share != nullptr) *share = total;
  PoseWithCovariance result;
  if (total <= 0.0) return result;
  result.mean = pose(first);
  result.mean.x += sum.x() / total;
  result.mean.y += sum.y() / total;
  result.mean.phi = wrapToPi(result.mean.phi + sum.z() / total);
  for (std::size_t i = 0; i < count_; ++i) {
    if (labels != nullptr && (*labels)[i] != label) continue;
    const double dx = static_cast<double>(x_[i]) - result.mean.x;
    const double dy = static_cast<double>(y_[i]) - result.mean.y;
    const double dt = wrapped(static_cast<double>(yaw_[i]) - result.mean.phi);
    const double w = weights_[i];
    result.cov(0, 0) += w * dx * dx;
    result.cov(1, 0) += w * dx * dy;
    result.cov(1, 1) += w * dy * dy;
    result.cov(2, 0) += w * dx * dt;
    result.cov(2, 1) += w * dy * dt;
    result.cov(2, 2) += w * dt * dt;
  }
  result.cov /= total;
  result.cov(0, 1) = result.cov(1, 0);
  result.cov(0, 2) = result.cov(2, 0);
  result.cov(1, 2) = result.cov(2, 1);
  return result;
}

std::vector<std::uint32_t> ParticleSet::systematicDraws(std::size_t n, double u) const {
  std::vector<std::uint32_t> draws;
  draws.reserve(n);
  double reached = weights_.empty() ? 0.0 : weights_[0];
  std::size_t i = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const double wanted = (static_cast<double>(k) + u) / static_cast<double>(n);
    while (reached <= wanted && i + 1 < count_) reached += weights_[++i];
    draws.push_back(static_cast<std::uint32_t>(i));
  }
  return draws;
}

template <class Index>
void ParticleSet::take(const std::vector<Index>& indices) {
  const std::size_t n = indices.size();
  const auto taken = [&](const std::vector<float>& from) {
    std::vector<float> to(padded(n));
    for (std::size_t k = 0; k < n; ++k) to[k] = from[indices[k]];
    return to;
  };
  x_ = taken(x_);
  y_ = taken(y_);
  yaw_ = taken(yaw_);
  count_ = n;
  log_weights_.assign(n, 0.0);
  weights_.assign(n, n > 0 ? 1.0 / static_cast<double>(n) : 0.0);
}

void ParticleSet::resample(std::size_t n, double u) { take(systematicDraws(n, u)); }

void ParticleSet::performSubstitution(const std::vector<size_t>& indices) { take(indices); }

}  // namespace vestibule::amcl
