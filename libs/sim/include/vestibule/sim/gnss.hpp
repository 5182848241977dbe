#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/sensors/measurements.hpp"
#include "vestibule/sim/constellation.hpp"
#include "vestibule/sim/world_geometry.hpp"

namespace vestibule::sim {

enum class GnssClass {
  kSingle,  ///< single point everywhere
  kSbas,    ///< with corrections of a geostationary satellite where it is seen
  kRtk      ///< fixed in the open, float and single where satellites are hidden
};

/// Errors are one sigma.
struct GnssParams {
  GnssClass receiver = GnssClass::kRtk;
  double rate_hz = 5.0;              ///< must divide 200 Hz
  double antenna_height_m = 1.0;     ///< above the ground under the base
  double mask_rad = degToRad(10.0);  ///< lower satellites are not used

  // pseudoranges of satellites in view
  double range_white_m = 0.6;    ///< at the zenith; grows with 1 / sin(elevation)
  double range_slow_m = 2.0;     ///< Gauss-Markov (orbit, clock, ionosphere), likewise
  double correlation_s = 120.0;  ///< of the slow errors

  // satellites out of view whose reflections are used
  double wall_share = 0.5;  ///< of the satellites behind a wall that stay in use
  double foliage_share = 0.8;
  double glass_share = 0.9;
  double roof_share = 0.04;    ///< under a roof; 0 = never a fix there
  double nlos_bias_m = 15.0;   ///< mean detour of a reflection; a fixed function of place
  double nlos_length_m = 8.0;  ///< over which that detour changes
  bool raim = true;            ///< leaves out up to two ranges that do not fit
  /// Over which the receiver's own filter evens out what changes in its code fixes (it knows its
  /// velocity, so it does not lag): noise shrinks, and a new reflection is followed gradually.
  double smoothing_s = 8.0;

  // Doppler
  double rate_white_mps = 0.05;  ///< range rate, at the zenith; grows like the ranges' noise
  double rate_slow_mps = 0.01;   ///< Gauss-Markov, likewise

  // carrier phase
  double float_sigma_m = 0.25;    ///< slow; the white part is 0.1 m
  double fixed_sigma_m = 0.014;   ///< slow; the white part is as large
  double wrong_fix_share = 0.02;  ///< of the times the integers are solved anew, 0.2-0.5 m off
  double min_first_fix_s = 1.0;   ///< after the sky was lost
  double max_first_fix_s = 5.0;
};
void describe(ParamIo& io, GnssParams& params);

/// What is behind the last fix, for checks.
struct GnssTruth {
  Eigen::Vector3d error_enu_m = Eigen::Vector3d::Zero();
  int in_view = 0;    ///< used satellites in view
  int reflected = 0;  ///< used satellites out of view
  /// What white and slow range errors make of the position with this fix's satellites and weights,
  /// before the receiver's own filter.
  Eigen::Matrix3d white_cov_enu = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d slow_cov_enu = Eigen::Matrix3d::Zero();
};

/// A receiver under a sky of single satellites (error sources as in Groves, "Principles of GNSS",
/// 2013, ch. 9 and 10): walls, roofs and trees hide some of them, some of the hidden ones stay in
/// use by their reflections, and the position is the weighted least-squares solution of what is
/// used. It claims HDOP times the range error of an open sky, which is right there and too good
/// beside walls.
class GnssModel {
 public:
  /// \param geometry must outlive the model
  GnssModel(
      const WorldGeometry& geometry,
      const Geodetic& datum,
      const GnssParams& params,
      std::uint64_t seed);

  /// Call at the receiver's rate: errors age by one period per call.
  /// \param v_map_antenna  its true velocity [m/s]
  [[nodiscard]] GnssFix measure(
      Timestamp stamp,
      const Moment& moment,
      const Eigen::Vector3d& p_map_antenna,
      const Eigen::Vector3d& v_map_antenna = Eigen::Vector3d::Zero());

  /// Adds an offset to every fix [m] and, if `blocked`, lets no satellite through; until changed.
  void disturb(const Eigen::Vector3d& offset_enu_m, bool blocked);

  [[nodiscard]] const GnssTruth& truth() const { return truth_; }

 private:
  struct Range {
    Eigen::Vector4d row;      // d(range) / d(east, north, up, clock)
    double white_m = 0.0;     // sigma
    double slow_m = 0.0;      // sigma
    double slow_unit = 0.0;   // the unit-variance process
    double bias_m = 0.0;      // reflection
    double receiver_m = 0.0;  // sigma that the receiver takes it for
    bool in_view = true;
    std::size_t satellite = 0;
  };
  [[nodiscard]] std::vector<Range> rangesNow(
      Timestamp stamp, const Moment& moment, const Eigen::Vector3d& p_map_antenna);
  [[nodiscard]] GnssFixType typeNow(Timestamp stamp, int in_view, int used, bool corrections);
  void ageErrors();
  /// Doppler of the ranges in use: a reflection's detour changes as the antenna moves.
  [[nodiscard]] GnssVelocity velocityNow(
      Timestamp stamp,
      const std::vector<Range>& ranges,
      const Eigen::Matrix4d& gain_q,
      const Eigen::Vector3d& v_map_antenna);
  [[nodiscard]] Eigen::Vector3d smoothed(Timestamp stamp, const Eigen::Vector3d& code_error_m);

  const WorldGeometry& geometry_;
  geo::TangentPlane plane_;
  GnssParams params_;
  std::uint64_t seed_;
  Constellation constellation_;
  std::uint64_t index_ = 0;
  std::vector<SkyPosition> sky_;
  std::optional<Timestamp> sky_stamp_;
  std::vector<double> slow_;      // per satellite, unit variance
  Eigen::Vector3d carrier_slow_;  // unit variance
  bool corrections_seen_ = false;
  bool had_sky_ = true;
  std::uint64_t sky_losses_ = 0;
  Timestamp first_fix_{};
  std::optional<Timestamp> sbas_since_;
  std::optional<Timestamp> float_since_;
  std::optional<Timestamp> fixed_since_;
  bool is_fixed_ = false;
  std::uint64_t fixes_solved_ = 0;
  Eigen::Vector3d wrong_fix_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d offset_m_ = Eigen::Vector3d::Zero();
  bool blocked_ = false;
  Geodetic last_position_;
  std::optional<Timestamp> smoothed_at_;
  Eigen::Vector3d smoothed_m_ = Eigen::Vector3d::Zero();
  std::vector<double> rate_slow_;  // per satellite, unit variance
  struct Detour {
    Timestamp stamp;
    double bias_m = 0.0;
  };
  std::map<std::size_t, Detour> detours_;  // of the last epoch, by satellite
  GnssTruth truth_;
};

}  // namespace vestibule::sim
