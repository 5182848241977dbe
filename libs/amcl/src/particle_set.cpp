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

/// The least and the most of some numbers.
struct Span {
  std::int32_t least;
  std::int32_t most;

  Span operator+(const Span& o) const { return {least + o.least, most + o.most}; }
  Span operator+(std::int32_t shift) const { return {least + shift, most + shift}; }
};

/// \pre n > 0
Span spanOf(const std::int32_t* values, std::size_t n) {
  std::int32_t least = values[0];
  std::int32_t most = values[0];
  for (std::size_t i = 1; i < n; ++i) {
    least = std::min(least, values[i]);
    most = std::max(most, values[i]);
  }
  return {least, most};
}

enum class Reach { kInside, kDoubtful, kOutside };

/// Whether all, some or none of them lie in [0, size).
Reach reachOf(const Span& span, std::int32_t size) {
  if (span.most < 0 || span.least >= size) return Reach::kOutside;
  return span.least >= 0 && span.most < size ? Reach::kInside : Reach::kDoubtful;
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
  log_likelihoods_.assign(count_, 0.0);
  if (ends.empty()) return;
  // Counting sort by yaw, then one turned scan per bin: the loop over beams only adds and loads.
  Sorted& s = sorted_;
  s.bin_of.resize(count_);
  s.order.resize(count_);
  s.x.resize(count_);
  s.y.resize(count_);
  s.sum.resize(count_);
  s.bin_begin.assign(kYawBins + 1, 0);
  const auto bins_per_rad = static_cast<float>(kYawBins / (2.0 * kPi));
  for (std::size_t i = 0; i < count_; ++i) {
    const auto bin = static_cast<std::int32_t>((yaw_[i] + static_cast<float>(kPi)) * bins_per_rad);
    s.bin_of[i] = std::min(bin, static_cast<std::int32_t>(kYawBins) - 1);
  }
  for (std::size_t i = 0; i < count_; ++i) ++s.bin_begin[s.bin_of[i] + 1];
  for (std::size_t b = 0; b < kYawBins; ++b) s.bin_begin[b + 1] += s.bin_begin[b];
  s.next.assign(s.bin_begin.begin(), s.bin_begin.end() - 1);
  for (std::size_t i = 0; i < count_; ++i) {
    const std::uint32_t k = s.next[s.bin_of[i]]++;
    s.order[k] = static_cast<std::uint32_t>(i);
    s.x[k] = table_.fixedX(x_[i]);
    s.y[k] = table_.fixedY(y_[i]);
  }

  const std::size_t beams = ends.size();
  const TableView table = table_.view();
  const std::int32_t size_x = table.width << kFractionBits;
  const std::int32_t size_y = table.height << kFractionBits;
  std::vector<float> end_x;
  std::vector<float> end_y;
  for (const Point2& end : ends) {
    end_x.push_back(static_cast<float>(end.x));
    end_y.push_back(static_cast<float>(end.y));
  }
  const auto weighBins = [&](std::size_t bin_from, std::size_t bin_to) {
    std::vector<std::int32_t> turned_x(beams);
    std::vector<std::int32_t> turned_y(beams);
    std::vector<std::int32_t> beam_x(beams);
    std::vector<std::int32_t> beam_y(beams);
    for (std::size_t b = bin_from; b < bin_to; ++b) {
      const std::size_t from = s.bin_begin[b];
      const std::size_t to = s.bin_begin[b + 1];
      if (from == to) continue;
      const double yaw = (static_cast<double>(b) + 0.5) * (2.0 * kPi / kYawBins) - kPi;
      const auto c = static_cast<float>(std::cos(yaw));
      const auto sn = static_cast<float>(std::sin(yaw));
      for (std::size_t k = 0; k < beams; ++k) {
        turned_x[k] = table_.fixedLength(c * end_x[k] - sn * end_y[k]);
        turned_y[k] = table_.fixedLength(sn * end_x[k] + c * end_y[k]);
      }
      const Span x = spanOf(&s.x[from], to - from);
      const Span y = spanOf(&s.y[from], to - from);
      const auto add = [&](const std::int32_t* bx, const std::int32_t* by, std::size_t n, bool in) {
        sumOverBeams(table, bx, by, n, &s.x[from], &s.y[from], to - from, in, &s.sum[from], simd_);
      };
      std::fill(&s.sum[from], &s.sum[from] + (to - from), 0U);
      const Span all_x = x + spanOf(turned_x.data(), beams);
      const Span all_y = y + spanOf(turned_y.data(), beams);
      if (reachOf(all_x, size_x) == Reach::kInside && reachOf(all_y, size_y) == Reach::kInside) {
        add(turned_x.data(), turned_y.data(), beams, true);
      } else {
        // Beams that end in the table wherever in the bin the particle is go from the front, those
        // that may end outside from the back. What always ends outside adds nothing: it is left
        // out.
        std::size_t sure = 0;
        std::size_t doubtful = beams;
        for (std::size_t i = 0; i < beams; ++i) {
          const Reach in_x = reachOf(x + turned_x[i], size_x);
          const Reach in_y = reachOf(y + turned_y[i], size_y);
          if (in_x == Reach::kOutside || in_y == Reach::kOutside) continue;
          const bool inside = in_x == Reach::kInside && in_y == Reach::kInside;
          const std::size_t k = inside ? sure++ : --doubtful;
          beam_x[k] = turned_x[i];
          beam_y[k] = turned_y[i];
        }
        add(beam_x.data(), beam_y.data(), sure, true);
        add(beam_x.data() + doubtful, beam_y.data() + doubtful, beams - doubtful, false);
      }
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
