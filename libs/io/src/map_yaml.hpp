#pragma once

#include <optional>
#include <string>
#include <vector>

#include "vestibule/core/frames.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/io/map_io.hpp"

namespace vestibule::io {

enum class MapMode { kTrinary, kScale, kRaw };

/// The keys of a map_server YAML.
struct MapYaml {
  std::string image;  ///< as written: relative to the YAML
  double resolution = 0.0;
  Pose2 T_map_corner;  ///< origin: pose of the image's lower left corner
  MapMode mode = MapMode::kTrinary;
  bool negate = false;
  double occupied_thresh = 0.65;
  double free_thresh = 0.196;
  std::optional<MapGeoreference> georeference;
  SourceRef image_ref;  ///< where the image is named
  SourceRef free_thresh_ref;
  std::vector<std::string> ignored;  ///< keys of other programs, in words with file:line
};

void describe(ParamIo& io, MapGeoreference& georeference);
void describe(ParamIo& io, MapYaml& yaml);
/// Throws ConfigError with file:line of every problem.
[[nodiscard]] MapYaml readMapYaml(const std::string& path);
[[nodiscard]] MapYaml parseMapYaml(const std::string& text, const std::string& name);
[[nodiscard]] std::string formatMapYaml(
    const std::string& image,
    double resolution_m,
    const Pose2& T_map_corner,
    const std::optional<MapGeoreference>& georeference = {});

}  // namespace vestibule::io
