#include "map_yaml.hpp"

#include <array>
#include <cctype>
#include <charconv>
#include <initializer_list>

#include "vestibule/core/angles.hpp"

namespace vestibule::io {
namespace {

constexpr double kMaxResolution_m = 100.0;
constexpr double kMinResolution_m = 1e-4;

/// Shortest decimals that read back as the same number.
template <class Number>
std::string shortest(Number value) {
  std::array<char, 40> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value);
  return {text.data(), end.ptr};
}

/// Grids keep their cell size in single precision: 0.05 shall not come back as 0.0500000007.
std::string shortestSingle(double value) { return shortest(static_cast<float>(value)); }

std::optional<MapMode> modeOf(std::string word) {
  for (char& c : word) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (word == "trinary") return MapMode::kTrinary;
  if (word == "scale") return MapMode::kScale;
  if (word == "raw") return MapMode::kRaw;
  return std::nullopt;
}

MapYaml finish(ParamFile& file) {
  MapYaml yaml;
  describe(file.io(), yaml);
  file.finishReading();
  return yaml;
}

}  // namespace

void describe(ParamIo& io, MapGeoreference& g) {
  std::vector<double> datum{g.datum.lat_deg, g.datum.lon_deg, g.datum.height_m};
  io.required("datum", datum, 3, 3);
  if (datum.size() == 3) g.datum = {datum[0], datum[1], datum[2]};
  io.required("T_map_grid", g.T_map_grid);
  std::vector<std::vector<double>> rows;
  for (int i = 0; i < 3; ++i) rows.push_back({g.cov(i, 0), g.cov(i, 1), g.cov(i, 2)});
  io.optional("covariance", rows, 3);
  if (rows.size() != 3) {
    io.problem("covariance", "must have three rows: x, y [m^2], yaw [rad^2]");
    return;
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      g.cov(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  }
  if (!(g.cov.diagonal().minCoeff() >= 0.0)) {
    io.problem("covariance", "must not have negative variances");
  }
}

void describe(ParamIo& io, MapYaml& yaml) {
  io.required("image", yaml.image);
  yaml.image_ref = io.here("image");
  io.required("resolution", yaml.resolution, within(kMinResolution_m, kMaxResolution_m));
  std::vector<double> origin;
  io.required("origin", origin, 2, 3);
  if (origin.size() >= 2) {
    yaml.T_map_corner = {origin[0], origin[1], origin.size() == 3 ? origin[2] : 0.0};
  }
  if (io.has("mode")) {  // in capitals, too, as map_server has it
    std::string word;
    io.optional("mode", word);
    const auto mode = modeOf(word);
    if (mode) yaml.mode = *mode;
    if (!mode) io.problem("mode", "must be one of trinary, scale, raw, is '" + word + "'");
  }
  // Some tools write 0 and 1, others false and true.
  if (io.has("negate")) {
    std::string word;
    io.optional("negate", word);
    yaml.negate = word == "1" || word == "true" || word == "True";
    if (!yaml.negate && word != "0" && word != "false" && word != "False") {
      io.problem("negate", "must be 0 or 1");
    }
  }
  io.optional("occupied_thresh", yaml.occupied_thresh, within(0.0, 1.0));
  io.optional("free_thresh", yaml.free_thresh, within(0.0, 1.0));
  io.section("georeference", yaml.georeference);
  yaml.free_thresh_ref = io.here("free_thresh");
  if (yaml.free_thresh > yaml.occupied_thresh) {
    io.problem("free_thresh", "must not be above occupied_thresh");
  }
  // map_server ignores what it does not know: names, dates, costmap tables.
  for (const std::string& key : io.takeForeignKeys()) {
    yaml.ignored.push_back(io.here(key).text() + ": " + key + ": says nothing here; ignored");
  }
}

MapYaml readMapYaml(const std::string& path) {
  ParamFile file = ParamFile::fromFile(path);
  return finish(file);
}

MapYaml parseMapYaml(const std::string& text, const std::string& name) {
  ParamFile file = ParamFile::fromText(text, name);
  return finish(file);
}

std::string formatMapYaml(
    const std::string& image,
    double resolution_m,
    const Pose2& T_map_corner,
    const std::optional<MapGeoreference>& georeference) {
  std::string text =
      "image: " + image + "\nmode: trinary\nresolution: " + shortestSingle(resolution_m) +
      "\norigin: [" + shortest(T_map_corner.x) + ", " + shortest(T_map_corner.y) + ", " +
      shortest(T_map_corner.phi) + "]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
  if (!georeference) return text;
  const MapGeoreference& g = *georeference;
  const auto list = [](std::initializer_list<double> values) {
    std::string items;
    for (const double value : values) items += (items.empty() ? "" : ", ") + shortest(value);
    return "[" + items + "]";
  };
  text +=
      "georeference:  # T_map_grid: x_m, y_m, yaw_deg of the grid in ENU at the datum\n  datum: " +
      list({g.datum.lat_deg, g.datum.lon_deg, g.datum.height_m}) +
      "\n  T_map_grid: " + list({g.T_map_grid.x, g.T_map_grid.y, radToDeg(g.T_map_grid.phi)}) +
      "\n  covariance:  # x, y [m^2], yaw [rad^2]\n";
  for (int i = 0; i < 3; ++i)
    text += "    - " + list({g.cov(i, 0), g.cov(i, 1), g.cov(i, 2)}) + "\n";
  return text;
}

}  // namespace vestibule::io
