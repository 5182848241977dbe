// A Kalman filter that knows every parameter of the simulator must be as wrong as it says, no more
// and no less: otherwise the simulator's noise is not what its parameters claim.

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/metrics/statistics.hpp"
#include "vestibule/sim/simulator.hpp"

namespace vestibule {
namespace {

// States: pose [m, rad], gyro bias [rad/s], grip of both sides, slow GNSS error [m].
enum : int { kX, kY, kYaw, kBias, kLeft, kRight, kEast, kNorth, kStates };
using Vector = Eigen::Matrix<double, kStates, 1>;
using Matrix = Eigen::Matrix<double, kStates, kStates>;

sim::SimParams knowable() {
  sim::SimParams params;
  params.robot.side_slip = 0.0;
  params.robot.burst_rate_hz = 0.0;
  params.robot.slip_tau_s = 10.0;
  params.wheels.ticks_per_m = 1e7;
  params.imu.rate_hz = params.wheels.rate_hz;
  params.imu.gyro = {};
  params.imu.gyro.noise = 1e-3;
  params.imu.gyro.bias_sigma = 2e-3;
  params.lidar.rate_hz = 0.1;
  return params;
}

class PerfectFilter {
 public:
  PerfectFilter(const sim::SimParams& params, const Pose2& start) : p_(params) {
    x_ << start.x, start.y, start.phi, 0.0, p_.robot.grip_left, p_.robot.grip_right, 0.0, 0.0;
    const double slip = p_.robot.slip_sigma;
    const double slow = p_.gnss.fixed_sigma_m;
    Vector sigma;
    sigma << 1e-4, 1e-4, 1e-5, p_.imu.gyro.bias_sigma, slip, slip, slow, slow;
    P_ = sigma.cwiseAbs2().asDiagonal();
  }

  void predict(const WheelOdometry& wheels) {
    const Eigen::Vector3d twist = logSe2(wheels.T_previous_now);
    left_m_ = twist.x() - 0.5 * twist.z() * p_.robot.nominal_track_m;
    right_m_ = twist.x() + 0.5 * twist.z() * p_.robot.nominal_track_m;
    dt_s_ = wheels.dt_s;
    const double keep = std::exp(-dt_s_ / p_.robot.slip_tau_s);
    const double keep_gnss = std::exp(-dt_s_ / p_.gnss.correlation_s);
    const auto move = [&](const Vector& s) {
      Vector next = s;
      next[kLeft] = p_.robot.grip_left + keep * (s[kLeft] - p_.robot.grip_left);
      next[kRight] = p_.robot.grip_right + keep * (s[kRight] - p_.robot.grip_right);
      next[kEast] *= keep_gnss;
      next[kNorth] *= keep_gnss;
      const double turn = turnOf(next);
      const double forward = (next[kRight] * right_m_ * p_.robot.icr_left_m -
                              next[kLeft] * left_m_ * p_.robot.icr_right_m) /
                             width();
      const Pose2 step = expSe2({forward, -turn * p_.robot.icr_x_m, turn});
      const double c = std::cos(s[kYaw]);
      const double sn = std::sin(s[kYaw]);
      next[kX] += c * step.x - sn * step.y;
      next[kY] += sn * step.x + c * step.y;
      next[kYaw] += step.phi;
      return next;
    };
    Matrix F;
    constexpr double kStep = 1e-6;
    for (int i = 0; i < kStates; ++i) {
      Vector up = x_;
      Vector down = x_;
      up[i] += kStep;
      down[i] -= kStep;
      F.col(i) = (move(up) - move(down)) / (2.0 * kStep);
    }
    x_ = move(x_);
    P_ = F * P_ * F.transpose();
    const double slip2 = p_.robot.slip_sigma * p_.robot.slip_sigma * (1.0 - keep * keep);
    const double slow2 =
        p_.gnss.fixed_sigma_m * p_.gnss.fixed_sigma_m * (1.0 - keep_gnss * keep_gnss);
    P_(kLeft, kLeft) += slip2;
    P_(kRight, kRight) += slip2;
    P_(kEast, kEast) += slow2;
    P_(kNorth, kNorth) += slow2;
  }

  /// \return NIS
  double gyro(const Imu& imu) {
    Eigen::Matrix<double, 1, kStates> H = Eigen::Matrix<double, 1, kStates>::Zero();
    H[kBias] = 1.0;
    H[kLeft] = -left_m_ / (width() * dt_s_);
    H[kRight] = right_m_ / (width() * dt_s_);
    const double sigma = p_.imu.gyro.noise * std::sqrt(p_.imu.rate_hz);
    const Eigen::Matrix<double, 1, 1> z(imu.omega_radps.z() - turnOf(x_) / dt_s_ - x_[kBias]);
    return update<1>(z, H, Eigen::Matrix<double, 1, 1>(sigma * sigma));
  }

  double fix(const Eigen::Vector2d& position_m) {
    const Point2& arm = p_.rig.p_base_antenna;
    const double c = std::cos(x_[kYaw]);
    const double s = std::sin(x_[kYaw]);
    const Eigen::Vector2d offset(c * arm.x - s * arm.y, s * arm.x + c * arm.y);
    Eigen::Matrix<double, 2, kStates> H = Eigen::Matrix<double, 2, kStates>::Zero();
    H(0, kX) = H(1, kY) = H(0, kEast) = H(1, kNorth) = 1.0;
    H(0, kYaw) = -offset.y();
    H(1, kYaw) = offset.x();
    const Eigen::Vector2d z =
        position_m - x_.head<2>() - offset - Eigen::Vector2d(x_[kEast], x_[kNorth]);
    const double white = p_.gnss.fixed_sigma_m;
    return update<2>(z, H, white * white * Eigen::Matrix2d::Identity());
  }

  [[nodiscard]] double nees(const Pose2& truth) const {
    PoseWithCovariance estimate;
    estimate.mean = {x_[kX], x_[kY], wrapToPi(x_[kYaw])};
    estimate.cov = P_.topLeftCorner<3, 3>();
    return *metrics::nees(estimate, truth);
  }

 private:
  [[nodiscard]] double width() const { return p_.robot.icr_left_m - p_.robot.icr_right_m; }
  [[nodiscard]] double turnOf(const Vector& s) const {
    return (s[kRight] * right_m_ - s[kLeft] * left_m_) / width();
  }
  template <int n>
  double update(
      const Eigen::Matrix<double, n, 1>& z,
      const Eigen::Matrix<double, n, kStates>& H,
      const Eigen::Matrix<double, n, n>& R) {
    const Eigen::Matrix<double, n, n> S = H * P_ * H.transpose() + R;
    const Eigen::Matrix<double, n, n> S_inverse = S.inverse();
    const Eigen::Matrix<double, kStates, n> K = P_ * H.transpose() * S_inverse;
    x_ += K * z;
    const Matrix A = Matrix::Identity() - K * H;
    P_ = A * P_ * A.transpose() + K * R * K.transpose();
    return z.dot(S_inverse * z);
  }

  sim::SimParams p_;
  Vector x_;
  Matrix P_;
  double left_m_ = 0.0;
  double right_m_ = 0.0;
  double dt_s_ = 0.02;
};

struct Mean {
  double sum = 0.0;
  int n = 0;
  void add(double v) {
    sum += v;
    ++n;
  }
  /// Whether the mean of n chi-square values of that many degrees of freedom is in its 95 % bounds.
  void expectConsistent(int dof, const char* what) const {
    const double low = metrics::chiSquareQuantile(0.025, n * dof) / n;
    const double high = metrics::chiSquareQuantile(0.975, n * dof) / n;
    std::printf("%s: mean %.4f of %d, 95 %% bounds [%.4f, %.4f]\n", what, sum / n, n, low, high);
    EXPECT_GE(sum / n, low) << what;
    EXPECT_LE(sum / n, high) << what;
  }
};

TEST(SimConsistency, APerfectFilterIsAsWrongAsItSays) {
  sim::World world;
  world.datum = {36.83, -2.405, 50.0};
  const geo::TangentPlane plane(world.datum);
  const sim::SimParams params = knowable();
  Mean nees;
  Mean nis_fix;
  Mean nis_gyro;
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    sim::Simulator simulator(world, params, {0, 0, 0.5}, seed);
    PerfectFilter filter(params, {0, 0, 0.5});
    for (int i = 0; i < 600; ++i) {
      simulator.command(0.7, i / 80 % 2 == 0 ? 0.3 : -0.25);
      for (const sim::Delivered& d : simulator.step(std::chrono::milliseconds(100))) {
        if (const auto* wheels = std::get_if<WheelOdometry>(&d.measurement)) {
          filter.predict(*wheels);
        } else if (const auto* imu = std::get_if<Imu>(&d.measurement)) {
          nis_gyro.add(filter.gyro(*imu));
        } else if (const auto* fix = std::get_if<GnssFix>(&d.measurement)) {
          ASSERT_EQ(fix->type, GnssFixType::kRtkFixed);
          const Eigen::Vector3d enu = plane.toEnu(std::get<Geodetic>(fix->position));
          nis_fix.add(filter.fix(enu.head<2>()));
        }
      }
    }
    nees.add(filter.nees(simulator.truth()));
  }
  nees.expectConsistent(3, "NEES of the pose");
  nis_fix.expectConsistent(2, "NIS of the fixes");
  nis_gyro.expectConsistent(1, "NIS of the gyro");
}

}  // namespace
}  // namespace vestibule
