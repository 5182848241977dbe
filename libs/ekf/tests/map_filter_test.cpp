#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <functional>
#include <limits>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"
#include "vestibule/ekf/filter.hpp"
#include "vestibule/metrics/statistics.hpp"

namespace vestibule::ekf {
namespace {

using std::chrono::milliseconds;

UpdateReport offerFix(
    MapFilter& filter,
    Timestamp stamp,
    const Eigen::Vector2d& p,
    GnssFixType type,
    const std::optional<Eigen::Matrix3d>& cov = std::nullopt) {
  MapFix fix;
  fix.stamp = stamp;
  fix.p_map_antenna.head<2>() = p;
  fix.type = type;
  fix.cov = cov;
  return filter.process(fix);
}

/// A robot on an eight of two 5 m circles at 1 m/s: gyro 50 Hz, wheels 10 Hz, GNSS 2 Hz.
/// The wheels over-count by 5 %, the gyro has a bias, GNSS errors last for a minute.
class Drive {
 public:
  explicit Drive(std::uint64_t seed, const Observers* observers = nullptr)
      : filter(FilterParams(), rigOf(), observers), random_(seed, "drive") {
    truth = Pose2(random_.uniform(-50, 50), random_.uniform(-50, 50), random_.uniform(-3, 3));
    gnss_error_ = {random_.normal(), random_.normal()};
  }

  static SensorRig rigOf() {
    SensorRig rig;
    rig.p_base_antenna = {1.0, 0.3};
    return rig;
  }

  void run(double seconds) {
    const int end = tick_ + static_cast<int>(std::lround(seconds * 50));
    while (tick_ < end) tick();
  }

  [[nodiscard]] double error() const { return distance(filter.pose().mean, truth); }
  [[nodiscard]] double nees() const {
    return metrics::nees(filter.pose(), truth).value_or(std::numeric_limits<double>::infinity());
  }
  [[nodiscard]] Timestamp now() const { return Timestamp{0} + milliseconds(20) * tick_; }
  [[nodiscard]] Eigen::Vector2d antenna() const {
    const Point2 p = transform(truth, rigOf().p_base_antenna);
    return {p.x, p.y};
  }

  MapFilter filter;
  Pose2 truth;
  double speed = 1.0;
  bool gnss = true;
  bool gyro = true;
  bool rtk = false;
  std::optional<double> heading_offset;  ///< there is a heading sensor, this much off [rad]
  Eigen::Vector2d gnss_shift = Eigen::Vector2d::Zero();
  double largest_jump_m = 0.0;  ///< of the estimate between consecutive wheel messages

 private:
  void tick() {
    ++tick_;
    const double dt = 0.02;
    const bool first_circle = std::fmod(tick_ * dt, 4 * kPi / 0.2) < 2 * kPi / 0.2;
    const double rate = speed == 0.0 ? 0.0 : (first_circle ? 0.2 : -0.2);
    const Pose2 step = expSe2({speed * dt, 0.0, rate * dt});
    truth = compose(truth, step);
    since_wheels_ = compose(since_wheels_, step);
    if (gyro) {
      Imu imu;
      imu.stamp = now();
      imu.omega_radps.z() = rate + 0.01 + random_.normal(0.0, 0.002 / std::sqrt(dt));
      imu.accel_mps2.z() = 9.81;
      (void)filter.process(imu);
    }
    if (heading_offset && tick_ % 5 == 0) {
      (void)filter.process(Heading{
          now(), wrapToPi(truth.phi + *heading_offset + random_.normal(0.0, 0.02)), {}, {}});
    }
    if (tick_ % 5 == 0) {
      const double noise = speed == 0.0 ? 0.0 : random_.normal(0.0, 0.01);
      WheelOdometry wheels{now(), 0.1, since_wheels_};
      wheels.T_previous_now.x = 1.05 * since_wheels_.x + noise;
      wheels.T_previous_now.y = 1.05 * since_wheels_.y;
      (void)filter.process(wheels);
      since_wheels_ = {};
      if (filter.ready()) {
        if (previous_) {
          largest_jump_m = std::max(largest_jump_m, distance(*previous_, filter.pose().mean));
        }
        previous_ = filter.pose().mean;
      }
    }
    if (tick_ % 25 == 0) {
      const double keep = std::exp(-0.5 / 60.0);
      gnss_error_ = keep * gnss_error_ + std::sqrt(1 - keep * keep) *
                                             Eigen::Vector2d(random_.normal(), random_.normal());
      if (!gnss) return;
      const Eigen::Vector2d white(random_.normal(0.0, 0.02), random_.normal(0.0, 0.02));
      const Eigen::Vector2d z = antenna() + gnss_shift + white;
      (void)offerFix(
          filter,
          now(),
          rtk ? z : Eigen::Vector2d(z + gnss_error_),
          rtk ? GnssFixType::kRtkFixed : GnssFixType::kDifferential);
    }
  }

  RandomStream random_;
  int tick_ = 0;
  Pose2 since_wheels_;
  Eigen::Vector2d gnss_error_;
  std::optional<Pose2> previous_;
};

TEST(MapFilter, ErrorAndNeesStayWithinBoundsOnAnEight) {
  // 12 seeds, one sample per 20 s over 10 min each. Errors of a minute's memory and 1.4 m rms
  // cannot be averaged away within that time: 3 m is twice their size. A mean NEES of 3 is perfect.
  double nees_sum = 0.0;
  double square_sum = 0.0;
  int n = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Drive drive(seed);
    drive.run(60);
    ASSERT_TRUE(drive.filter.ready()) << "seed " << seed << ": " << drive.filter.waitingFor();
    for (int k = 0; k < 30; ++k) {
      drive.run(20);
      EXPECT_LT(drive.error(), 3.5) << "seed " << seed << " at " << 80 + 20 * k << " s";
      nees_sum += drive.nees();
      square_sum += drive.error() * drive.error();
      ++n;
    }
    EXPECT_NEAR(drive.filter.state().wheel_scale, -std::log(1.05), 0.04) << "seed " << seed;
    EXPECT_LT(drive.largest_jump_m, 0.3) << "seed " << seed;
  }
  RecordProperty("rmse_m", std::to_string(std::sqrt(square_sum / n)));
  RecordProperty("mean_nees", std::to_string(nees_sum / n));
  EXPECT_LT(std::sqrt(square_sum / n), 1.3);
  EXPECT_GT(nees_sum / n, 0.6);
  EXPECT_LT(nees_sum / n, 6.0);
}

TEST(MapFilter, RtkWithALeverArmIsWithinCentimetres) {
  Drive drive(21);
  drive.rtk = true;
  drive.run(120);
  ASSERT_TRUE(drive.filter.ready());
  double worst = 0.0;
  for (int k = 0; k < 60; ++k) {
    drive.run(1.3);
    worst = std::max(worst, drive.error());
  }
  EXPECT_LT(worst, 0.15);
  EXPECT_LT(std::abs(angleDiff(drive.filter.pose().mean.phi, drive.truth.phi)), degToRad(2.0));
}

TEST(MapFilter, CovarianceCoversTheDriftOfAnOutage) {
  for (std::uint64_t seed = 31; seed <= 36; ++seed) {
    Drive drive(seed);
    drive.rtk = true;
    drive.run(200);
    drive.gnss = false;
    drive.run(60);
    EXPECT_LT(drive.error(), 1.2) << "seed " << seed << ": 2 % of 60 m";
    EXPECT_LT(drive.nees(), metrics::chiSquareQuantile(0.999, 3)) << "seed " << seed;
    drive.gnss = true;
    drive.run(20);
    EXPECT_LT(drive.error(), 0.3) << "seed " << seed;
  }
}

TEST(MapFilter, OneFarFixMovesNothing) {
  Drive drive(41);
  drive.run(100);
  const Pose2 before = drive.filter.pose().mean;
  const UpdateReport report = offerFix(
      drive.filter,
      drive.now(),
      drive.antenna() + Eigen::Vector2d(500, 500),
      GnssFixType::kRtkFixed);
  EXPECT_EQ(report.decision, Decision::kGated);
  EXPECT_GT(report.nis, report.gate);
  EXPECT_EQ(report.dof, 2);
  EXPECT_LT(distance(before, drive.filter.pose().mean), 1e-9);
}

TEST(MapFilter, AHalfMinuteOfConsistentFarFixesMovesNothing) {
  Drive drive(42);
  drive.run(100);
  drive.gnss_shift = {500, 500};
  drive.run(30);
  EXPECT_LT(drive.error(), 4.0);
  drive.gnss_shift.setZero();
  drive.run(30);
  EXPECT_LT(drive.error(), 4.0);
}

TEST(MapFilter, FollowsGnssThatInsistsWhileDrivingAlong) {
  // The robot was carried: every fix afterwards agrees with the odometry, on another place. On
  // the 20 m of an eight the cluster never travels far enough, so this one drives straight.
  FilterParams params;
  MapFilter filter(params, Drive::rigOf());
  bool reset = false;
  double last_error = 0.0;
  for (int i = 1; i <= 200 * 10; ++i) {
    const Timestamp t = Timestamp{0} + milliseconds(100) * i;
    (void)filter.process(WheelOdometry{t, 0.1, Pose2(0.1, 0, 0)});
    if (i % 10 != 0) continue;
    const double shift = i > 1000 ? 300.0 : 0.0;
    const Eigen::Vector2d p(0.1 * i + 1.0, 0.3 + shift);
    reset |= offerFix(filter, t, p, GnssFixType::kSingle).reason == "reset";
    if (filter.ready()) last_error = distance(filter.pose().mean, Pose2(0.1 * i, shift, 0));
  }
  EXPECT_TRUE(reset);
  EXPECT_LT(last_error, 3.0);
}

TEST(MapFilter, StartsLateWithoutHeadingAndPlacesTheTrackFromBefore) {
  Drive drive(51);
  drive.speed = 0.0;
  const Pose2 start = drive.truth;
  drive.run(30);
  EXPECT_FALSE(drive.filter.ready());
  EXPECT_THAT(drive.filter.waitingFor(), testing::HasSubstr("heading"));
  drive.speed = 1.0;
  drive.run(60);
  ASSERT_TRUE(drive.filter.ready());
  EXPECT_EQ(drive.filter.waitingFor(), "");
  ASSERT_TRUE(drive.filter.initialAlignment());
  // The odometry started at the origin, where the robot stood.
  EXPECT_LT(distance(drive.filter.initialAlignment()->mean, start), 4.0);
}

TEST(MapFilter, AHeadingSensorThatIsFarOffCannotWreckIt) {
  for (const double offset_deg : {0.0, 8.0, 120.0, -90.0}) {
    Drive drive(61);
    drive.heading_offset = degToRad(offset_deg);
    drive.run(200);
    ASSERT_TRUE(drive.filter.ready()) << offset_deg;
    EXPECT_LT(drive.error(), 4.0) << "offset " << offset_deg << " deg";
    EXPECT_LT(std::abs(angleDiff(drive.filter.pose().mean.phi, drive.truth.phi)), degToRad(12.0))
        << "offset " << offset_deg << " deg";
  }
}

TEST(MapFilter, DrivesOnTheWheelsWhenThereIsNoGyro) {
  Drive drive(71);
  drive.gyro = false;
  drive.run(200);
  ASSERT_TRUE(drive.filter.ready());
  EXPECT_LT(drive.error(), 4.0);
}

TEST(MapFilter, ResetMakesItReadyAndMapPosesKeepItThere) {
  Drive drive(81);
  drive.gnss = false;
  drive.run(5);
  PoseWithCovariance T{drive.truth, Eigen::Matrix3d::Identity() * 0.01};
  drive.filter.reset(drive.now(), T);
  ASSERT_TRUE(drive.filter.ready());
  for (int i = 0; i < 100; ++i) {
    drive.run(0.5);
    T.mean = drive.truth;
    EXPECT_NE(drive.filter.processExternalPose(drive.now(), T).decision, Decision::kGated);
  }
  EXPECT_LT(drive.error(), 0.2);
  T.mean.x += 30.0;
  EXPECT_EQ(drive.filter.processExternalPose(drive.now(), T).decision, Decision::kGated);
}

TEST(MapFilter, RefusesWhatIsNotFiniteOrTooLate) {
  Drive drive(91);
  drive.run(60);
  MapFilter& filter = drive.filter;
  const Pose2 before = filter.pose().mean;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  (void)filter.process(WheelOdometry{drive.now(), 0.1, Pose2(nan, 0, 0)});
  (void)filter.process(WheelOdometry{drive.now(), -1.0, Pose2(1, 0, 0)});
  (void)filter.process(WheelOdometry{drive.now(), 0.1, Pose2(1e9, 0, 0)});
  Imu imu;
  imu.stamp = drive.now();
  imu.omega_radps.z() = inf;
  (void)filter.process(imu);
  EXPECT_EQ(filter.process(Heading{drive.now(), nan, {}, {}}).decision, Decision::kRejected);
  const UpdateReport report = offerFix(filter, drive.now(), {nan, 0}, GnssFixType::kSingle);
  EXPECT_EQ(report.decision, Decision::kRejected);
  EXPECT_EQ(report.reason, "not finite");
  EXPECT_EQ(filter.dropped().at("not finite"), 4U);
  EXPECT_EQ(filter.dropped().at("impossible"), 2U);
  (void)filter.process(WheelOdometry{drive.now() - milliseconds(5000), 0.1, Pose2(1, 0, 0)});
  EXPECT_EQ(
      offerFix(filter, drive.now() - milliseconds(2900), {0, 0}, GnssFixType::kSingle).reason,
      "stale");
  EXPECT_EQ(filter.dropped().at("stale"), 2U);
  EXPECT_EQ(offerFix(filter, drive.now(), {0, 0}, GnssFixType::kNone).reason, "no fix");
  EXPECT_LT(distance(before, filter.pose().mean), 1e-9);
}

TEST(MapFilter, CovarianceStaysPositiveWhateverComes) {
  Drive drive(101);
  const Eigen::Matrix3d zero = Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
  for (int i = 0; i < 100; ++i) {
    drive.run(1);
    (void)offerFix(drive.filter, drive.now(), drive.antenna(), GnssFixType::kSingle, zero);
    (void)offerFix(
        drive.filter, drive.now(), drive.antenna(), GnssFixType::kRtkFixed, Eigen::Matrix3d(-one));
    if (!drive.filter.ready()) continue;
    const Eigen::Matrix3d P = drive.filter.pose().cov;
    ASSERT_EQ((P - P.transpose()).norm(), 0.0);
    ASSERT_GT(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(P).eigenvalues().minCoeff(), 0.0);
  }
  EXPECT_TRUE(drive.filter.ready());
}

TEST(MapFilter, GivesTheSameWithAndWithoutObservers) {
  struct Counter : Observer {
    int updates = 0;
    void onUpdate(const UpdateEvent& /*event*/) override { ++updates; }
  } counter;
  Observers observers;
  observers.attach(counter);
  Drive watched(111, &observers);
  Drive alone(111);
  watched.run(100);
  alone.run(100);
  EXPECT_EQ(counter.updates, 200);
  EXPECT_EQ(watched.filter.pose().mean, alone.filter.pose().mean);
}

void readCompass(MapFilter& filter, Timestamp stamp, double error_rad) {
  Heading heading;
  heading.stamp = stamp;
  heading.yaw_rad = error_rad;
  heading.sigma_rad = degToRad(2.0);
  heading.offset_sigma_rad = degToRad(2.0);
  (void)filter.process(heading);
}

/// A robot at 1 m/s to the east, messages at 10 Hz; every second a calibrated compass, off by
/// `compass_error_rad`, and a fix. \return the report of the last fix
UpdateReport driveEast(
    MapFilter& filter,
    int from_s,
    int to_s,
    const std::function<Eigen::Vector2d(double)>& fix_at,
    double compass_error_rad = 0.0) {
  UpdateReport report;
  for (int i = 10 * from_s + 1; i <= 10 * to_s; ++i) {
    const Timestamp now = Timestamp{0} + milliseconds(100) * i;
    Imu imu;
    imu.stamp = now;
    imu.accel_mps2.z() = 9.81;
    (void)filter.process(imu);
    (void)filter.process(WheelOdometry{now, 0.1, Pose2(0.1, 0.0, 0.0)});
    if (i % 10 != 0) continue;
    readCompass(filter, now, compass_error_rad);
    report = offerFix(filter, now, fix_at(0.1 * i), GnssFixType::kSingle);
  }
  return report;
}

TEST(MapFilter, DoubtsCodeFixesThatWalkAwayFromTheOdometry) {
  FilterParams untested;
  untested.gnss.drift_window_s = 0.0;
  MapFilter filter{FilterParams(), SensorRig()};
  MapFilter led{untested, SensorRig()};
  UpdateReport report;
  for (MapFilter* f : {&led, &filter}) {
    (void)driveEast(*f, 0, 60, [](double t) { return Eigen::Vector2d(t, 0.0); });
    // To the side: every fix is near the one before, and none is far from the estimate.
    report = driveEast(*f, 60, 90, [](double t) { return Eigen::Vector2d(t, 1.0 * (t - 60.0)); });
  }
  EXPECT_EQ(report.decision, Decision::kGated);
  EXPECT_EQ(report.reason, "drift");
  EXPECT_LT(filter.pose().mean.y, 0.6 * led.pose().mean.y) << led.pose().mean.y;
}

TEST(MapFilter, ARobotThatFellSilentMayBeAnywhereNear) {
  MapFilter filter{FilterParams(), SensorRig()};
  (void)driveEast(filter, 0, 60, [](double t) { return Eigen::Vector2d(t, 0.0); });
  ASSERT_TRUE(filter.ready()) << filter.waitingFor();
  // It drove on for 8 s, round a corner, and nothing was heard of it.
  const Timestamp now = Timestamp{0} + std::chrono::seconds(68);
  const auto report = offerFix(filter, now, {62.0, -8.0}, GnssFixType::kRtkFixed);
  EXPECT_NE(report.decision, Decision::kGated);
  EXPECT_GT(std::sqrt(filter.pose().cov(2, 2)), 0.5) << "[rad], it may have turned";
}

TEST(MapFilter, ACalibratedCompassStartsItAndKeepsItsCalibrationBesideSteel) {
  MapFilter filter{FilterParams(), SensorRig()};
  readCompass(filter, Timestamp{0}, 0.0);
  (void)offerFix(filter, Timestamp{0}, {0.0, 0.0}, GnssFixType::kSingle);
  ASSERT_TRUE(filter.ready()) << "without driving";
  const auto east = [](double t) { return Eigen::Vector2d(t, 0.0); };
  (void)driveEast(filter, 0, 30, east);
  (void)driveEast(filter, 30, 40, east, degToRad(50.0));
  (void)driveEast(filter, 40, 60, east);
  EXPECT_NEAR(radToDeg(filter.state().heading_offset), 0.0, 4.0);
  EXPECT_NEAR(radToDeg(filter.pose().mean.phi), 0.0, 4.0);
}

TEST(MapFilter, OdometryLearnsTheGyroBiasStandingAndNeverJumps) {
  MapFilter filter{FilterParams(), SensorRig()};
  RandomStream random(5, "odometry");
  Pose2 truth;
  Pose2 previous;
  for (int i = 1; i <= 60 * 50; ++i) {
    const double t = 0.02 * i;
    const bool moving = t < 20.0 || t > 40.0;
    const double rate = moving ? 0.3 * std::sin(0.5 * t) : 0.0;
    const Pose2 step = expSe2({moving ? 0.02 : 0.0, 0.0, rate * 0.02});
    truth = compose(truth, step);
    const Timestamp now = Timestamp{0} + milliseconds(20) * i;
    Imu imu;
    imu.stamp = now;
    imu.omega_radps.z() = -(rate + 0.02 + random.normal(0.0, 0.01));
    imu.accel_mps2.z() = -9.81;  // mounted upside down
    (void)filter.process(imu);
    (void)filter.process(WheelOdometry{now, 0.02, step});
    EXPECT_LT(distance(previous, filter.odometry().mean), 0.021) << "at " << t;
    previous = filter.odometry().mean;
    if (t > 39.9 && t < 39.95) {
      EXPECT_TRUE(filter.standstill());
      EXPECT_NEAR(filter.odometryState().gyro_bias.z(), 0.02, 0.001);
      EXPECT_EQ(filter.yawRate(), 0.0);
    }
  }
  // Only the first 20 s ran with the unknown bias: 0.4 rad.
  EXPECT_NEAR(angleDiff(filter.odometry().mean.phi, truth.phi), 0.4, 0.06);
  EXPECT_NEAR(filter.speed(), 1.0, 1e-4);  // the chord is a little shorter than the arc
}

TEST(MapFilter, AStopTellsTheBiasOfAGyroThatDrivingShakes) {
  FilterParams params;
  params.gyro.noise_rad_sqrt_s = 0.02;
  MapFilter filter(params, SensorRig());
  RandomStream random(6, "stop");
  for (int i = 1; i <= 20 * 50; ++i) {
    const Timestamp now = Timestamp{0} + milliseconds(20) * i;
    Imu imu;
    imu.stamp = now;
    imu.omega_radps.z() = 0.005 + random.normal(0.0, 0.003);
    imu.accel_mps2.z() = 9.81;
    (void)filter.process(imu);
    (void)filter.process(WheelOdometry{now, 0.02, {}});
  }
  EXPECT_NEAR(filter.odometryState().gyro_bias.z(), 0.005, 0.0004);
}

}  // namespace
}  // namespace vestibule::ekf
