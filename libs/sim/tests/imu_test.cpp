#include "vestibule/sim/imu.hpp"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>
#include <vector>

#include "moments.hpp"

namespace vestibule::sim {
namespace {

constexpr double kGravity_mps2 = 9.80665;
const Eigen::Vector3d kAtRest(0.0, 0.0, kGravity_mps2);

ImuParams silent() {
  ImuParams params;
  params.gyro = {};
  params.accel = {};
  return params;
}

Timestamp at(double seconds) { return timestampFromSeconds(1.7e9) + durationFromSeconds(seconds); }

/// Overlapping Allan variance of rates, from their integral theta (IEEE Std 952, annex C).
double allanVariance(const std::vector<double>& theta, std::size_t m, double tau_s) {
  double sum = 0.0;
  const std::size_t n = theta.size() - 2 * m;
  for (std::size_t k = 0; k < n; ++k) {
    const double second = theta[k + 2 * m] - 2.0 * theta[k + m] + theta[k];
    sum += second * second;
  }
  return sum / (2.0 * tau_s * tau_s * static_cast<double>(n));
}

/// Allan variance of a first-order Gauss-Markov process of unit variance (IEEE Std 952, C.1.7).
double markovVariance(double tau_s, double correlation_s) {
  const double r = tau_s / correlation_s;
  return 2.0 / (r * r) * (2.0 * r - 3.0 + 4.0 * std::exp(-r) - std::exp(-2.0 * r)) / 2.0;
}

/// N, instability and K that explain the Allan variance of one hour best, in relative terms.
Eigen::Vector3d fitAllan(const std::vector<double>& rates, double dt_s, double correlation_s) {
  std::vector<double> theta{0.0};
  for (const double rate : rates) theta.push_back(theta.back() + rate * dt_s);
  std::vector<Eigen::Vector3d> rows;
  for (double tau_s = 0.1; tau_s < 0.12 * dt_s * static_cast<double>(rates.size()); tau_s *= 1.6) {
    const auto m = static_cast<std::size_t>(std::lround(tau_s / dt_s));
    const double tau = static_cast<double>(m) * dt_s;
    const double measured = allanVariance(theta, m, tau);
    rows.emplace_back(
        Eigen::Vector3d(1.0 / tau, markovVariance(tau, correlation_s), tau / 3.0) / measured);
    // Long times have few independent samples: they count less.
    rows.back() *= 1.0 / std::sqrt(tau);
  }
  Eigen::MatrixXd A(static_cast<Eigen::Index>(rows.size()), 3);
  Eigen::VectorXd b(static_cast<Eigen::Index>(rows.size()));
  Eigen::Index i = 0;
  double tau_s = 0.1;
  for (const Eigen::Vector3d& row : rows) {
    A.row(i) = row.transpose();
    const auto m = static_cast<double>(std::lround(tau_s / dt_s));
    b(i++) = 1.0 / std::sqrt(m * dt_s);
    tau_s *= 1.6;
  }
  return A.colPivHouseholderQr().solve(b).cwiseMax(0.0).cwiseSqrt();
}

TEST(Imu, AllanDeviationOfAnHourGivesTheParametersBack) {
  ImuParams params = silent();
  params.rate_hz = 20.0;  // the parameters are densities: the rate does not matter
  params.gyro.noise = 1e-3;
  params.gyro.instability = 1.5e-3;
  params.gyro.instability_s = 2.0;
  params.gyro.walk = 2e-4;
  // One hour leaves K uncertain by about 10 % per axis: the mean over the axes of four units.
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  constexpr int kUnits = 4;
  for (std::uint64_t seed = 1; seed <= kUnits; ++seed) {
    ImuModel imu(params, seed);
    std::vector<double> rates[3];
    for (int i = 0; i < 3600 * 20; ++i) {
      const Imu m = imu.measure(at(0.05 * i), {0, 0, 0}, kAtRest, 0.0);
      for (int axis = 0; axis < 3; ++axis) rates[axis].push_back(m.omega_radps[axis]);
    }
    for (const auto& axis : rates) mean += fitAllan(axis, 0.05, 2.0) / (3.0 * kUnits);
  }
  EXPECT_NEAR(mean[0], params.gyro.noise, 0.1 * params.gyro.noise) << "N";
  EXPECT_NEAR(mean[1], params.gyro.instability, 0.1 * params.gyro.instability) << "B";
  EXPECT_NEAR(mean[2], params.gyro.walk, 0.1 * params.gyro.walk) << "K";
  std::printf("N %.3g B %.3g K %.3g\n", mean[0], mean[1], mean[2]);
}

TEST(Imu, StartsWithABiasAndKeepsItsScale) {
  ImuParams params = silent();
  params.gyro.bias_sigma = 1e-3;
  params.accel.scale_sigma = 0.01;
  Moments bias;
  Moments scale;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    ImuModel imu(params, seed);
    const Imu m = imu.measure(at(0), {0, 0, 0.3}, {2.0, 0, 0}, 0.0);
    bias.add(m.omega_radps.z() - 0.3);
    scale.add(m.accel_mps2.x() / 2.0 - 1.0);
  }
  // 400 samples: sigma within 18 % at 5 sigma.
  EXPECT_NEAR(bias.sigma(), 1e-3, 0.18e-3);
  EXPECT_NEAR(scale.sigma(), 0.01, 0.0018);
}

TEST(Imu, SaturatesAndShakes) {
  ImuParams params = silent();
  params.gyro.limit = 0.5;
  params.accel.vibration = 0.2;
  ImuModel imu(params, 1);
  Moments still;
  Moments moving;
  for (int i = 0; i < 1000; ++i) {
    const Imu m = imu.measure(at(0.01 * i), {0, 0, 2.0}, kAtRest, i < 500 ? 0.0 : 2.0);
    EXPECT_EQ(m.omega_radps.z(), 0.5);
    (i < 500 ? still : moving).add(m.accel_mps2.x());
  }
  EXPECT_EQ(still.rms(), 0.0);
  EXPECT_NEAR(moving.rms(), 0.4 / std::sqrt(2.0), 0.02);
}

}  // namespace
}  // namespace vestibule::sim
