// One prediction and one GNSS position update: both engines of the 24-state model against a dense
// 15-state filter written by hand on fixed-size Eigen, the usual way to do it. All in one run; the
// ratios are what counts. And the cost of a fix that comes half a second late.

#include <benchmark/benchmark.h>

#include <Eigen/Cholesky>
#include <cmath>

#include "vestibule/ekf/engine.hpp"
#include "vestibule/ekf/filter.hpp"

namespace vestibule::ekf {
namespace {

Motion motion() {
  Motion u;
  u.dt_s = 0.01;
  u.forward_m = 0.01;
  u.speed_mps = 1.0;
  u.turn_rad = {1e-4, -1e-4, 2e-3};
  u.turn_is_gyro = true;
  u.forward_var = 1e-6;
  u.left_var = 1e-6;
  u.up_var = 1e-6;
  u.turn_var = 1e-7;
  u.tilt_var = 1e-7;
  u.speed_var = 1e-3;
  u.gyro_bias_var = 1e-12;
  u.gnss_bias_decay = 0.9998;
  u.gnss_bias_var = 1e-3;
  u.disturbance_decay = 0.999;
  u.disturbance_var = 1e-4;
  return u;
}

StateMatrix prior(const Model& model) {
  StateMatrix P = 0.01 * StateMatrix::Identity();
  model.constrain(P);
  return P;
}

/// Model and covariance, as the filter does it at each IMU message.
void predict(benchmark::State& state, bool mrpt, bool planar) {
  const Model model(planar);
  const auto engine = mrpt ? makeMrptEngine() : makeFixedEngine(planar);
  StateMatrix P = prior(model);
  const Motion u = motion();
  State x;
  int n = 0;
  for (auto _ : state) {
    const auto predicted = model.predict(x, u);
    x = predicted.x;
    engine->predict(P, predicted.step);
    if (++n % 1000 == 0) P = prior(model);
    benchmark::DoNotOptimize(P.data());
  }
}
BENCHMARK_CAPTURE(predict, fixed_plane, false, true);
BENCHMARK_CAPTURE(predict, fixed_space, false, false);
BENCHMARK_CAPTURE(predict, mrpt_plane, true, true);

/// Innovation test and update.
void gnssUpdate(benchmark::State& state, bool mrpt, bool planar) {
  const Model model(planar);
  const auto engine = mrpt ? makeMrptEngine() : makeFixedEngine(planar);
  StateMatrix P = prior(model);
  State x;
  int n = 0;
  for (auto _ : state) {
    const Observation z =
        model.gnssPosition(x, {0.1, 0.1, 0.1}, {0.2, 0.1, 0.0}, Eigen::Matrix3d::Identity());
    const Correlation c = Engine::correlation(P, z);
    benchmark::DoNotOptimize(Engine::innovation(z, c).nis);
    x = plus(x, engine->update(P, z, c));
    if (++n % 1000 == 0) P = prior(model);
    benchmark::DoNotOptimize(P.data());
  }
}
BENCHMARK_CAPTURE(gnssUpdate, fixed_plane, false, true);
BENCHMARK_CAPTURE(gnssUpdate, fixed_space, false, false);
BENCHMARK_CAPTURE(gnssUpdate, mrpt_plane, true, true);

/// The yardstick: position, velocity, attitude, gyro and accelerometer bias; dense products, Joseph
/// form.
struct Dense15 {
  using Matrix = Eigen::Matrix<double, 15, 15>;
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  Eigen::Vector3d gyro_bias = Eigen::Vector3d::Zero();
  Eigen::Vector3d accel_bias = Eigen::Vector3d::Zero();
  Matrix P = 0.01 * Matrix::Identity();

  void predict(const Eigen::Vector3d& omega, const Eigen::Vector3d& force, double dt) {
    const Eigen::Matrix3d R = q.toRotationMatrix();
    const Eigen::Vector3d a = R * (force - accel_bias) - Eigen::Vector3d(0, 0, 9.81);
    const Eigen::Vector3d w = omega - gyro_bias;
    Matrix F = Matrix::Identity();
    F.block<3, 3>(0, 3) = dt * Eigen::Matrix3d::Identity();
    F.block<3, 3>(3, 6) = -dt * R * skew(force - accel_bias);
    F.block<3, 3>(3, 12) = -dt * R;
    F.block<3, 3>(6, 6) -= dt * skew(w);
    F.block<3, 3>(6, 9) = -dt * Eigen::Matrix3d::Identity();
    p += dt * v + 0.5 * dt * dt * a;
    v += dt * a;
    q = (q * rotationExp(dt * w)).normalized();
    P = (F * P * F.transpose()).eval();
    P.diagonal().array() += 1e-6;
    P = (0.5 * (P + P.transpose())).eval();
  }
  void update(const Eigen::Vector3d& z, const Eigen::Vector3d& lever, const Eigen::Matrix3d& R) {
    const Eigen::Matrix3d A = q.toRotationMatrix();
    Eigen::Matrix<double, 3, 15> H = Eigen::Matrix<double, 3, 15>::Zero();
    H.leftCols<3>().setIdentity();
    H.middleCols<3>(6) = -A * skew(lever);
    const Eigen::Vector3d r = z - p - A * lever;
    const Eigen::Matrix3d S = H * P * H.transpose() + R;
    const Eigen::LLT<Eigen::Matrix3d> llt(S);
    benchmark::DoNotOptimize(r.dot(llt.solve(r)));
    const Eigen::Matrix<double, 15, 3> K = llt.solve(H * P).transpose();
    const Eigen::Matrix<double, 15, 1> dx = K * r;
    const Matrix B = Matrix::Identity() - K * H;
    P = (B * P * B.transpose() + K * R * K.transpose()).eval();
    p += dx.segment<3>(0);
    v += dx.segment<3>(3);
    q = (q * rotationExp(dx.segment<3>(6))).normalized();
    gyro_bias += dx.segment<3>(9);
    accel_bias += dx.segment<3>(12);
  }
};

void denseBy15Predict(benchmark::State& state) {
  Dense15 filter;
  int n = 0;
  for (auto _ : state) {
    filter.predict({1e-2, -1e-2, 0.2}, {0.1, 0.0, 9.81}, 0.01);
    if (++n % 1000 == 0) filter = {};
    benchmark::DoNotOptimize(filter.P.data());
  }
}
BENCHMARK(denseBy15Predict);

void denseBy15GnssUpdate(benchmark::State& state) {
  Dense15 filter;
  int n = 0;
  for (auto _ : state) {
    filter.update({0.1, 0.1, 0.1}, {0.2, 0.1, 0.0}, Eigen::Matrix3d::Identity());
    if (++n % 1000 == 0) filter = {};
    benchmark::DoNotOptimize(filter.P.data());
  }
}
BENCHMARK(denseBy15GnssUpdate);

/// IMU 100 Hz, wheels 50 Hz, GNSS 5 Hz; each fix comes 0.5 s late.
void lateFix(benchmark::State& state) {
  MapFilter filter{FilterParams(), SensorRig()};
  Timestamp now{0};
  std::int64_t tick = 0;
  const auto advance = [&] {
    ++tick;
    now = now + std::chrono::milliseconds(10);
    Imu imu;
    imu.stamp = now;
    imu.omega_radps.z() = 0.1;
    imu.accel_mps2.z() = 9.81;
    (void)filter.process(imu);
    if (tick % 2 == 0) (void)filter.process(WheelOdometry{now, 0.02, Pose2(0.02, 0, 0.002)});
  };
  const auto fix = [&](Timestamp stamp) {
    const double yaw = 0.1 * toSeconds(stamp);
    MapFix f;
    f.stamp = stamp;
    f.p_map_antenna = {10 * std::sin(yaw), 10 - 10 * std::cos(yaw), 0.0};
    f.type = GnssFixType::kSingle;
    return f;
  };
  while (toSeconds(now) < 60.0) {
    advance();
    if (tick % 20 == 0) (void)filter.process(fix(now));
  }
  for (auto _ : state) {
    state.PauseTiming();
    for (int i = 0; i < 20; ++i) advance();
    const MapFix late = fix(now - std::chrono::milliseconds(500));
    state.ResumeTiming();
    benchmark::DoNotOptimize(filter.process(late));
  }
}
BENCHMARK(lateFix)->Unit(benchmark::kMicrosecond)->Iterations(2000);

}  // namespace
}  // namespace vestibule::ekf

BENCHMARK_MAIN();
