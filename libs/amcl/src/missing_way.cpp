#include "missing_way.hpp"

namespace vestibule::amcl {
namespace {

constexpr double kUsualSpeed_mps = 1.0;  // one sigma, before anything is known
constexpr double kUsualAccel_mps2 = 1.0;
// A reading was taken any time between two stamps: one sigma of the uniform distribution. Stamps
// themselves are off by some time as well.
constexpr double kTimeShare = 0.29;
constexpr double kStampSigma_s = 0.02;
// Bursts of stamps and gaps say nothing of the speed.
constexpr double kShortest_s = 0.02;
constexpr double kLongest_s = 1.0;
// A leap that neither a late reading nor a robot explains (chi-square, 0.1 %).
constexpr double kLeapChi2 = 10.8;

}  // namespace

void MissingWay::startAnew() {
  speed_mps_ = missing_m_ = 0.0;
  cov_ = Eigen::Vector2d(kUsualSpeed_mps * kUsualSpeed_mps, 0.0).asDiagonal();
}

void MissingWay::take(double along_m, double dt_s) {
  if (!(dt_s >= kShortest_s && dt_s <= kLongest_s)) return startAnew();
  // The way read is what was missing before, plus the way driven, less what is missing now.
  const double accel_var = kUsualAccel_mps2 * kUsualAccel_mps2;
  const double time_var = kTimeShare * kTimeShare * dt_s * dt_s + kStampSigma_s * kStampSigma_s;
  const double now_var = time_var * (speed_mps_ * speed_mps_ + cov_(0, 0));
  const Eigen::RowVector2d read(dt_s, 1.0);
  const double half_dt2 = 0.5 * dt_s * dt_s;
  const double var = read * cov_ * read.transpose() + half_dt2 * half_dt2 * accel_var + now_var;
  const double surprise_m = along_m - (speed_mps_ * dt_s + missing_m_);
  if (surprise_m * surprise_m > kLeapChi2 * var) return startAnew();

  const Eigen::Vector2d with_read(
      cov_.row(0) * read.transpose() + half_dt2 * dt_s * accel_var, -now_var);
  speed_mps_ += with_read(0) / var * surprise_m;
  missing_m_ = with_read(1) / var * surprise_m;
  cov_ = Eigen::Vector2d(cov_(0, 0) + dt_s * dt_s * accel_var, now_var).asDiagonal();
  cov_ -= with_read * with_read.transpose() / var;
}

}  // namespace vestibule::amcl
