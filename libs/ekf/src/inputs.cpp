#include "inputs.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace vestibule::ekf {
namespace {

// Limits of what a ground robot can do between two messages; a factor of ten and more beyond.
constexpr double kMaxIncrement_m = 1e3;
constexpr double kMaxRate_radps = 1e3;
constexpr double kMaxPosition_m = 1e7;
constexpr double kMaxSpeed_mps = 1e3;
constexpr double kMaxVariance = 1e12;
constexpr double kMinVariance = 1e-12;
constexpr double kMaxInterval_s = 1e6;

struct Fault {
  const char* operator()(const Imu& m) const {
    if (!m.omega_radps.allFinite()) return "not finite";
    return m.omega_radps.norm() > kMaxRate_radps ? "impossible" : "";
  }
  const char* operator()(const Heading& m) const {
    const bool finite =
        std::isfinite(m.yaw_rad) && std::isfinite(m.sigma_rad.value_or(0.0)) &&
        (!m.tilt || (std::isfinite(m.tilt->roll_rad) && std::isfinite(m.tilt->pitch_rad)));
    return finite ? "" : "not finite";
  }
  const char* operator()(const WheelOdometry& m) const {
    if (!isFinite(m.T_previous_now) || !std::isfinite(m.dt_s)) return "not finite";
    const bool possible = m.dt_s >= 0.0 && m.dt_s < kMaxInterval_s &&
                          translationNorm(m.T_previous_now) < kMaxIncrement_m &&
                          std::abs(m.T_previous_now.phi) < kMaxRate_radps;
    return possible ? "" : "impossible";
  }
  const char* operator()(const MapFix& m) const {
    if (m.type == GnssFixType::kNone) return "";
    if (!m.p_map_antenna.allFinite()) return "not finite";
    return m.p_map_antenna.cwiseAbs().maxCoeff() > kMaxPosition_m ? "impossible" : "";
  }
  const char* operator()(const VelocityInput& m) const {
    const Eigen::Vector3d& v = m.velocity.enu_mps;
    // An upward velocity that is NaN is not there.
    const double up = std::isnan(v.z()) ? 0.0 : v.z();
    if (!v.head<2>().allFinite() || !std::isfinite(up)) return "not finite";
    if (!std::isfinite(m.velocity.sigma_mps.value_or(0.0))) return "not finite";
    const bool possible = std::max(v.head<2>().cwiseAbs().maxCoeff(), std::abs(up)) < kMaxSpeed_mps;
    return possible && m.velocity.sigma_mps.value_or(0.0) < kMaxSpeed_mps ? "" : "impossible";
  }
  static const char* ofPose(const PoseWithCovariance& T) {
    if (!isFinite(T.mean) || !T.cov.allFinite()) return "not finite";
    const bool possible =
        std::abs(T.mean.x) < kMaxPosition_m && std::abs(T.mean.y) < kMaxPosition_m &&
        T.cov.diagonal().minCoeff() > kMinVariance && T.cov.diagonal().maxCoeff() < kMaxVariance &&
        T.cov.llt().info() == Eigen::Success;
    return possible ? "" : "impossible";
  }
  const char* operator()(const PoseInput& m) const { return ofPose(m.T_map_base); }
  const char* operator()(const ResetInput& m) const { return ofPose(m.T_map_base); }
};

/// Every number of an input, in a fixed order.
struct Content {
  using Numbers = std::vector<double>;
  static void add(Numbers& n, const std::optional<double>& v) {
    n.push_back(v ? 1.0 : 0.0);
    n.push_back(v.value_or(0.0));
  }
  Numbers operator()(const Imu& m) const {
    Numbers n(m.omega_radps.data(), m.omega_radps.data() + 3);
    n.insert(n.end(), m.accel_mps2.data(), m.accel_mps2.data() + 3);
    return n;
  }
  Numbers operator()(const Heading& m) const {
    Numbers n{m.yaw_rad};
    add(n, m.sigma_rad);
    n.push_back(m.tilt ? 1.0 : 0.0);
    if (m.tilt) {
      n.push_back(m.tilt->roll_rad);
      n.push_back(m.tilt->pitch_rad);
    }
    add(n, m.offset_sigma_rad);
    return n;
  }
  Numbers operator()(const WheelOdometry& m) const {
    return {m.dt_s, m.T_previous_now.x, m.T_previous_now.y, m.T_previous_now.phi};
  }
  Numbers operator()(const MapFix& m) const {
    Numbers n(m.p_map_antenna.data(), m.p_map_antenna.data() + 3);
    n.push_back(static_cast<double>(m.type));
    add(n, m.hdop);
    n.push_back(m.satellites ? *m.satellites : -1.0);
    if (m.cov) n.insert(n.end(), m.cov->data(), m.cov->data() + 9);
    return n;
  }
  Numbers operator()(const VelocityInput& m) const {
    Numbers n(m.velocity.enu_mps.data(), m.velocity.enu_mps.data() + 3);
    add(n, m.velocity.sigma_mps);
    return n;
  }
  static Numbers ofPose(const PoseWithCovariance& T) {
    Numbers n{T.mean.x, T.mean.y, T.mean.phi};
    n.insert(n.end(), T.cov.data(), T.cov.data() + 9);
    return n;
  }
  Numbers operator()(const PoseInput& m) const { return ofPose(m.T_map_base); }
  Numbers operator()(const ResetInput& m) const { return ofPose(m.T_map_base); }
};

/// NaN (an accelerometer that is not there) compares equal to itself and after every number.
int compareNumber(double a, double b) {
  const bool a_nan = std::isnan(a);
  const bool b_nan = std::isnan(b);
  if (a_nan || b_nan) return static_cast<int>(a_nan) - static_cast<int>(b_nan);
  return a < b ? -1 : (b < a ? 1 : 0);
}

}  // namespace

Timestamp stampOf(const Input& input) {
  return std::visit([](const auto& m) { return m.stamp; }, input);
}

const char* unusable(const Input& input) { return std::visit(Fault(), input); }

int compare(const Input& a, const Input& b) {
  const Timestamp stamp_a = stampOf(a);
  const Timestamp stamp_b = stampOf(b);
  if (stamp_a != stamp_b) return stamp_a < stamp_b ? -1 : 1;
  if (a.index() != b.index()) return a.index() < b.index() ? -1 : 1;
  const auto x = std::visit(Content(), a);
  const auto y = std::visit(Content(), b);
  for (std::size_t i = 0; i < std::min(x.size(), y.size()); ++i) {
    const int order = compareNumber(x[i], y[i]);
    if (order != 0) return order;
  }
  return static_cast<int>(x.size() > y.size()) - static_cast<int>(x.size() < y.size());
}

}  // namespace vestibule::ekf
