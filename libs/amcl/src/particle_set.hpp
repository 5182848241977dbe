#pragma once

#include <mrpt/bayes/CParticleFilterCapable.h>

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "kernels.hpp"
#include "likelihood_table.hpp"

namespace vestibule::amcl {

/// What one update does to the particles.
struct ParticleStep {
  NoisyIncrement increment;
  NoiseKey noise;
  const std::vector<Point2>* ends = nullptr;  ///< beam ends in base axes; lives during the update
};

/// The particles of a localization as separate arrays, under MRPT's particle filter:
/// CParticleFilter::executeOn() moves, weighs and normalises them with the kernels of kernels.hpp.
/// Its action and observation arguments stay null; the step given to prepare() stands for both.
/// Poses are in the map's grid frame.
class ParticleSet : public mrpt::bayes::CParticleFilterCapable {
 public:
  /// \param table outlives the set
  ParticleSet(const LikelihoodTable& table, int threads, Simd simd = bestSimd());

  void resize(std::size_t n);  ///< new particles are at the origin with weight 0 [log]
  void set(std::size_t i, const Pose2& T_grid_base);
  [[nodiscard]] Pose2 pose(std::size_t i) const;
  [[nodiscard]] std::size_t size() const { return count_; }

  void prepare(const ParticleStep& step) { step_ = step; }
  /// Weights must leave at least this effective share of the particles; otherwise the exponent of
  /// the likelihood goes below the options' powFactor.
  void keepEffective(double min_share) { min_effective_share_ = min_share; }
  [[nodiscard]] double usedExponent() const { return used_exponent_; }

  /// Normalised weights, sum 1. \pre normalizeWeights() was called after the last change
  [[nodiscard]] const std::vector<double>& weights() const { return weights_; }
  /// Weighted mean and covariance of the particles whose label is `label`, of all without labels.
  /// \param share the weight they carry together
  [[nodiscard]] PoseWithCovariance moments(
      double* share = nullptr, const std::vector<int>* labels = nullptr, int label = 0) const;
  /// How well a scan fits each particle, without moving or weighing them.
  [[nodiscard]] const std::vector<double>& logLikelihoods(const std::vector<Point2>& ends);

  /// Draws n particles in proportion to the weights with one uniform number (systematic
  /// resampling); weights become equal. \param u in [0, 1)
  void resample(std::size_t n, double u);
  /// Index of the particle each of n systematic draws takes, ascending.
  [[nodiscard]] std::vector<std::uint32_t> systematicDraws(std::size_t n, double u) const;
  /// Moves every particle by a draw of its own, without weighing.
  void diffuse(const NoisyIncrement& increment, const NoiseKey& noise);

  // --- mrpt::bayes::CParticleFilterCapable -----------------------------------------------------
  [[nodiscard]] double getW(size_t i) const override { return log_weights_[i]; }
  void setW(size_t i, double w) override { log_weights_[i] = w; }
  [[nodiscard]] size_t particlesCount() const override { return count_; }
  void performSubstitution(const std::vector<size_t>& indices) override;
  double normalizeWeights(double* out_max_log_w = nullptr) override;
  [[nodiscard]] double ESS() const override;

 protected:
  void prediction_and_update_pfStandardProposal(
      const mrpt::obs::CActionCollection* action,
      const mrpt::obs::CSensoryFrame* observation,
      const mrpt::bayes::CParticleFilter::TParticleFilterOptions& options) override;

 private:
  void weigh(const std::vector<Point2>& ends);
  [[nodiscard]] double exponentFor(double wanted) const;
  template <class Index>
  void take(const std::vector<Index>& indices);

  const LikelihoodTable& table_;
  int threads_;
  Simd simd_;
  std::size_t count_ = 0;
  std::vector<float> x_;  // padded to kLanes, as are y_ and yaw_
  std::vector<float> y_;
  std::vector<float> yaw_;
  std::vector<double> log_weights_;
  std::vector<double> weights_;
  std::vector<double> log_likelihoods_;
  ParticleStep step_;
  double min_effective_share_ = 0.0;
  double used_exponent_ = 1.0;

  // Room that is used again at every update.
  struct Sorted {
    std::vector<std::int32_t> bin_of;
    std::vector<std::uint32_t> bin_begin;
    std::vector<std::uint32_t> next;  // free place of each bin
    std::vector<std::uint32_t> order;
    std::vector<std::int32_t> x;
    std::vector<std::int32_t> y;
    std::vector<std::uint32_t> sum;
  } sorted_;
};

}  // namespace vestibule::amcl
