// Whatever is thrown at the filter, its estimate stays finite and its covariance a covariance.
// VESTIBULE_FUZZ_SEQUENCES=10000000 ekf_test --gtest_filter='Fuzz*' for the long run.

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>

#include "vestibule/core/random.hpp"
#include "vestibule/ekf/filter.hpp"

namespace vestibule::ekf {
namespace {

class Thrower {
 public:
  Thrower(std::uint64_t seed, std::uint64_t index) : random_(seed, "fuzz", index) {}

  void throwAt(MapFilter& filter) {
    // Clocks that jump, messages that overtake each other, and two at once.
    const double step_s = random_() % 40 == 0 ? number(0.0, 5.0) : number(0.05, 0.05);
    if (random_() % 20 != 0) now_ns_ += static_cast<std::int64_t>(step_s * 1e9);
    const Timestamp stamp{now_ns_};
    switch (random_() % 8) {
      case 0:
      case 1: {
        Imu imu;
        imu.stamp = stamp;
        imu.omega_radps = {value(0.1), value(0.1), value(0.1)};
        imu.accel_mps2 = {value(0.5), value(0.5), 9.81 + value(0.5)};
        (void)filter.process(imu);
        break;
      }
      case 2:
      case 3:
        (void)filter.process(
            WheelOdometry{stamp, value(0.05), Pose2(value(0.1), value(0.01), value(0.02))});
        break;
      case 4: {
        Heading heading{stamp, value(1.0), {}, {}};
        if (random_() % 2 == 0) heading.sigma_rad = value(0.1);
        if (random_() % 2 == 0) heading.tilt = Tilt{value(0.1), value(0.1)};
        (void)filter.process(heading);
        break;
      }
      case 5: {
        MapFix fix;
        fix.stamp = stamp;
        fix.p_map_antenna = {value(3.0), value(3.0), value(3.0)};
        fix.type = static_cast<GnssFixType>(random_() % 6);
        if (random_() % 2 == 0) fix.cov = covariance();
        if (random_() % 2 == 0) fix.hdop = value(1.0);
        if (random_() % 2 == 0) fix.satellites = static_cast<int>(random_() % 12);
        (void)filter.process(fix);
        break;
      }
      case 6:
        (void)filter.processExternalPose(stamp, pose());
        break;
      default:
        (void)filter.reset(stamp, pose());
    }
  }

 private:
  double number(double mean, double sigma) { return random_.normal(mean, sigma); }
  /// Mostly of the usual size, sometimes anything at all.
  double value(double usual) {
    switch (random_() % 40) {
      case 0:
        return std::numeric_limits<double>::quiet_NaN();
      case 1:
        return std::numeric_limits<double>::infinity();
      case 2:
        return -std::numeric_limits<double>::infinity();
      case 3:
        return number(0.0, 1e300);
      case 4:
        return number(0.0, 1e6);
      case 5:
        return 0.0;
      case 6:
        return number(0.0, 1e-300);
      case 7:
        return number(0.0, 100.0 * usual);
      default:
        return number(0.0, usual);
    }
  }
  Eigen::Matrix3d covariance() {
    Eigen::Matrix3d C = Eigen::Matrix3d::Zero();
    for (int i = 0; i < 3; ++i) C(i, i) = value(2.0);
    if (random_() % 4 == 0) C(0, 1) = value(1.0);
    return C;
  }
  PoseWithCovariance pose() {
    PoseWithCovariance T{Pose2(value(3.0), value(3.0), value(1.0)), covariance().cwiseAbs()};
    return T;
  }

  RandomStream random_;
  std::int64_t now_ns_ = 0;
};

void expectSound(const State& x, const StateMatrix& P, std::uint64_t index) {
  ASSERT_TRUE(x.allFinite()) << "sequence " << index;
  ASSERT_TRUE(P.allFinite()) << "sequence " << index;
  ASSERT_EQ((P - P.transpose()).cwiseAbs().maxCoeff(), 0.0) << "sequence " << index;
  // Scaled to unit variances: states differ by fifteen orders of magnitude.
  Error scale;
  for (int i = 0; i < kStateSize; ++i) {
    ASSERT_GE(P(i, i), 0.0) << "sequence " << index << ", state " << i;
    scale[i] = P(i, i) > 0.0 ? 1.0 / std::sqrt(P(i, i)) : 0.0;
  }
  const StateMatrix correlation = scale.asDiagonal() * P * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<StateMatrix> eigen(correlation, Eigen::EigenvaluesOnly);
  ASSERT_GE(eigen.eigenvalues().minCoeff(), -1e-9) << "sequence " << index;
}

TEST(Fuzz, NothingBreaksTheFilter) {
  const char* wanted = std::getenv("VESTIBULE_FUZZ_SEQUENCES");
  const std::uint64_t sequences = wanted != nullptr ? std::strtoull(wanted, nullptr, 10) : 3000;
  const char* first = std::getenv("VESTIBULE_FUZZ_FIRST");
  const std::uint64_t begin = first != nullptr ? std::strtoull(first, nullptr, 10) : 0;
  Dropped dropped;
  std::size_t ready = 0;
  for (std::uint64_t index = begin; index < begin + sequences; ++index) {
    FilterParams params;
    params.plane = index % 2 == 0;
    params.init.trust_heading = index % 3 == 0;
    MapFilter filter(params, SensorRig());
    Thrower thrower(1, index);
    const int length = 1 + static_cast<int>(index % 40);
    for (int i = 0; i < length; ++i) thrower.throwAt(filter);
    if (filter.started()) {
      const PoseWithCovariance odometry = filter.odometry();
      ASSERT_TRUE(isFinite(odometry.mean) && odometry.cov.allFinite()) << "sequence " << index;
    }
    if (filter.ready()) {
      ++ready;
      expectSound(filter.state(), filter.covariance(), index);
      if (HasFatalFailure()) return;
    }
    for (const auto& [reason, count] : filter.dropped()) dropped[reason] += count;
  }
  EXPECT_GT(ready, sequences / 10);
  for (const char* reason : {"not finite", "impossible", "stale", "duplicate"}) {
    std::printf("refused as %s: %zu\n", reason, dropped[reason]);
  }
  EXPECT_GT(dropped["not finite"], sequences / 10);
  EXPECT_GT(dropped["impossible"], sequences / 100);
}

}  // namespace
}  // namespace vestibule::ekf
