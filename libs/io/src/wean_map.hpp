#pragma once

#include <memory>

#include "byte_stream.hpp"
#include "vestibule/grid/occupancy_map.hpp"

namespace vestibule::io {

/// The grid map of the Wean Hall recordings: "key value" lines, then "global_map[0]: WIDTH HEIGHT"
/// and WIDTH lines of HEIGHT numbers, x by x from the left and y by y from below. Numbers are the
/// probability that a cell is free, -1 where nothing is known; cells have
/// "robot_specifications->resolution" centimetres; the origin is the corner.
/// Throws InputError naming the line.
[[nodiscard]] grid::OccupancyMap readWeanMap(std::unique_ptr<ByteStream> stream);

/// Whether the first line is one of such a map.
[[nodiscard]] bool looksLikeWeanMap(LineReader lines);

}  // namespace vestibule::io
