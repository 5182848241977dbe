#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vestibule/ekf/filter.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::tuning {

/// What the GNSS/IMU/wheel filter takes from a recording, in stamp order: read once, run often.
struct FilterLog {
  std::vector<Measurement> measurements;  ///< no scans
  std::optional<geo::TangentPlane> plane;
  Timestamp first;
  Timestamp last;
};

/// The filter over such a log, one measurement at a time. All that the tuning knows of the filter.
class FilterReplay {
 public:
  FilterReplay(const pipeline::Config& config, const FilterLog& log);

  /// dof is 0 where nothing was compared.
  ekf::UpdateReport feed(const Measurement& measurement);
  [[nodiscard]] bool ready() const { return filter_.ready(); }
  [[nodiscard]] std::string waitingFor() const { return filter_.waitingFor(); }
  [[nodiscard]] Timestamp time() const { return filter_.time(); }
  /// T_map_base. \pre ready()
  [[nodiscard]] PoseWithCovariance pose() const { return filter_.pose(); }
  /// \pre ready()
  [[nodiscard]] bool poseIsFinite() const;
  [[nodiscard]] Pose2 odometry() const;
  /// Estimated minus measured antenna position [m]. \pre ready()
  [[nodiscard]] Point2 missOf(const GnssFix& fix) const;

 private:
  const FilterLog& log_;
  ekf::MapFilter filter_;
};

/// Orders the measurements, keeps what the filter takes and puts the map frame's origin at the
/// first fix, as `fuse` does.
[[nodiscard]] FilterLog makeFilterLog(std::vector<Measurement> measurements);

}  // namespace vestibule::tuning
