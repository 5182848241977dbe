#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/params.hpp"
#include "vestibule/sensors/compass.hpp"
#include "vestibule/sensors/measurements.hpp"

namespace vestibule::io {

/// Which of a CSV's local x/y columns is which: x north and y east, or x east and y north.
enum class CsvAxes { kEastNorth, kNorthEast };

struct CsvTime {
  std::string column;
  double unit_s = 1.0;  ///< [s] seconds per unit of the column, e.g. 1e-6 for microseconds
};

/// A position column pair: geodetic (lat/lon/height) or local metres (x/y/z), never both.
struct CsvGnss {
  std::string name;  ///< source name of its records
  std::optional<std::string> lat, lon, height;
  std::optional<std::string> x, y, z;
  std::optional<std::string> v_x, v_y;  ///< [m/s] velocity by the receiver, same axes as x and y
  std::optional<double> sigma_mps;      ///< [m/s] of it, per axis, constant; empty = unknown
  CsvAxes axes = CsvAxes::kEastNorth;   ///< of x and y, and of the velocity
  /// [m] x and y of the reference's zero in these columns: taken off. Local columns only.
  std::vector<double> origin_m{0.0, 0.0};
  GnssFixType type = GnssFixType::kUnknown;
  std::optional<double> sigma_m;           ///< [m] per axis, constant; empty = unknown
  std::optional<double> sigma_vertical_m;  ///< [m] empty = as sigma_m
  bool optional = true;                    ///< an empty or nan cell is "no fix", not an error
  bool repeats_are_stale = false;  ///< a fix equal to the row before's is a held one: left out
  double delay_s = 0.0;            ///< [s] subtracted from the row's stamp
};

struct CsvWheels {
  std::string left, right;      ///< wheel speeds
  double unit_mps = 1.0;        ///< [m/s] per unit of the columns
  double track_m = 0.0;         ///< [m] distance of the wheels' contact lines
  double distance_scale = 1.0;  ///< true distance / wheel distance
  double max_dt_s = 2.0;        ///< [s] over a longer gap between rows no increment is made
  bool optional = false;
  double delay_s = 0.0;
};

struct CsvHeading {
  std::string column;
  double unit_rad = 1.0;  ///< [rad] per unit of the column
  /// True for a compass-like column (clockwise from north); false: counter-clockwise from east.
  bool clockwise_from_north = false;
  double offset_rad = 0.0;          ///< added after the turn to ENU
  std::optional<double> sigma_rad;  ///< empty = unknown
  CompassDeviation compass;         ///< taken out after that; not known: that of the rig
  bool optional = true;
  bool emit = true;  ///< false: the column only feeds yaw_rate.from_heading
  double delay_s = 0.0;
};

struct CsvYawRate {
  std::optional<std::string> column;
  double sign = 1.0;  ///< -1 for a column that is positive clockwise
  /// Difference of the heading column over the row interval instead of a rate column. The mean
  /// rate between two rows is given the later row's stamp.
  bool from_heading = false;
  bool optional = true;
  double delay_s = 0.0;
};

struct CsvReference {
  std::string x, y;
  std::optional<std::string> yaw;
  CsvAxes axes = CsvAxes::kEastNorth;
  bool yaw_clockwise_from_north = false;
};

/// What the columns of a CSV recording mean. The YAML keys are the field names (angles in degrees
/// end in _deg).
struct CsvMapping {
  std::string description;
  std::string delimiter = ",";
  CsvTime time;
  std::vector<CsvGnss> gnss;
  std::optional<CsvWheels> wheels;
  std::optional<CsvHeading> heading;
  std::optional<CsvYawRate> yaw_rate;
  std::optional<CsvReference> reference;

  /// Every column name the mapping uses.
  [[nodiscard]] std::vector<std::string> columns() const;
};
void describe(ParamIo& io, CsvMapping& mapping);

}  // namespace vestibule::io
