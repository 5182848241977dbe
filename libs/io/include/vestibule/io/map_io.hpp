#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::io {

/// Where a map lies on the earth. `T_map_grid` is the pose of the frame of the YAML's origin in the
/// tangent plane (ENU) at the datum; `cov` orders x, y [m^2], yaw [rad^2].
struct MapGeoreference {
  Geodetic datum;
  Pose2 T_map_grid;
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
};

/// Loads a prebuilt map by its file name: map_server .yaml/.yml (PNG, PGM, BMP image; modes
/// trinary, scale and raw; negate; thresholds; origin with yaw), MRPT .gridmap[.gz], MRPT
/// .simplemap[.gz] (its scans inserted at 0.05 m), .dat[.gz] of the Wean Hall recordings. Throws
/// ConfigError with file:line for a problem in a map YAML, InputError for a missing or unreadable
/// image, MRPT or .dat file.
///
/// One thing is not read as map_server does: until 2025 Nav2's map saver wrote 205 for unknown and
/// a free_thresh of 0.25, by which 205 is free. An image of a saver's three values alone keeps its
/// unknown.
/// \param notes  told of that, in words with file:line
[[nodiscard]] grid::OccupancyMap loadMap(
    const std::string& path, std::vector<std::string>* notes = nullptr);

/// Where a map that loadMap() takes lies on the earth: the section `georeference` of a map YAML, as
/// saveMapServer() writes it. Empty where nobody said. Throws as loadMap().
[[nodiscard]] std::optional<MapGeoreference> loadGeoreference(const std::string& path);

/// Whether a file is one that loadMap() takes, by its name; a .dat[.gz], which may as well be a
/// recording, by its first word. False for what cannot be read.
[[nodiscard]] bool isMap(const std::string& path);

/// Writes a map_server map: YAML and an 8-bit PGM in trinary coding (0 occupied, 205 unknown, 254
/// free). The YAML names the image relative to itself. loadMap() gives the same cells and pose.
/// \param image_name  name of the image as the YAML shall write it, when the files are renamed
///                    later; empty = the file name of image_path
/// \param georeference written as a section that map_server does not look at; loadGeoreference()
///                    reads it
/// Throws InputError when a file cannot be written.
void saveMapServer(
    const grid::OccupancyMap& map,
    const std::string& yaml_path,
    const std::string& image_path,
    const std::string& image_name = {},
    const std::optional<MapGeoreference>& georeference = {});

/// Writes a layer of numbers beside a map: a PGM of the map's size.
/// \param wide  16 bits per cell; otherwise all are below 256
/// \param row   gives the cells of row iy, counted from the lowest, width of them
/// Throws InputError when the file cannot be written.
void saveLayer(
    const std::string& path,
    int width,
    int height,
    bool wide,
    const std::function<std::vector<std::uint16_t>(int iy)>& row);

}  // namespace vestibule::io
