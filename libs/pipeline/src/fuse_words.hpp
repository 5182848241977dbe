#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/time.hpp"
#include "vestibule/ekf/filter.hpp"

namespace vestibule::pipeline {

/// Says in words what stood out during a run.
class FuseWords {
 public:
  explicit FuseWords(Timestamp start) : start_(start) {}

  /// \param moved_m  by how much the fix moved the estimate
  void fix(
      Timestamp stamp,
      const Eigen::Vector2d& p_map_antenna,
      const ekf::UpdateReport& report,
      double moved_m);
  void heading(Timestamp stamp, const ekf::UpdateReport& report);
  /// The sentences so far, in the order of their times.
  [[nodiscard]] std::vector<std::string> text() const;

 private:
  struct Refusals {
    Timestamp first;
    Timestamp last;
    std::size_t count = 0;
    double worst_ratio = 0.0;  ///< NIS / gate
    double implied_mps = 0.0;  ///< from the last used fix to the first refused
    std::string reason;
  };
  void closeRefusals();
  [[nodiscard]] std::string span(Timestamp from, Timestamp to) const;

  Timestamp start_;
  std::optional<Timestamp> last_fix_;
  std::optional<Timestamp> last_used_;
  Eigen::Vector2d last_used_at_ = Eigen::Vector2d::Zero();
  std::optional<Refusals> refusals_;
  std::size_t short_refusals_ = 0;
  std::size_t heading_relearned_ = 0;
  std::vector<std::string> text_;
};

/// What the filter learnt of wheels, gyro and heading sensor, where it is out of the ordinary.
[[nodiscard]] std::vector<std::string> aboutSensors(const ekf::State& x, const ekf::StateMatrix& P);

}  // namespace vestibule::pipeline
