#include "vestibule/io/map_io.hpp"

#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/maps/CSimpleMap.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "byte_stream.hpp"
#include "map_yaml.hpp"
#include "mrpt_object.hpp"
#include "vestibule/core/errors.hpp"
#include "wean_map.hpp"

namespace vestibule::io {

namespace fs = std::filesystem;
using grid::Cell;
using mrpt::maps::COccupancyGridMap2D;

namespace {

constexpr std::uint8_t kPgmOccupied = 0;
constexpr std::uint8_t kPgmUnknown = 205;
constexpr std::uint8_t kPgmFree = 254;
constexpr double kSimpleMapResolution_m = 0.05;

/// OpenCV's image readers write to std::cerr what is wrong with a file, and where in their code;
/// errors here name the file and the remedy.
class Quiet {
 public:
  Quiet() : cerr_(std::cerr.rdbuf(nullptr)) {}
  ~Quiet() {
    std::cerr.rdbuf(cerr_);
    std::cerr.clear();
  }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  std::streambuf* cerr_;
};

cv::Mat readImage(const std::string& path, const MapYaml& yaml) {
  if (!fs::is_regular_file(path)) {
    throw InputError(
        yaml.image_ref.text() + ": image: " + path +
        ": no such file; correct the path (it is relative to the YAML)");
  }
  cv::Mat image;
  try {
    const Quiet quiet;
    image = cv::imread(path, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    // imread reports some damaged files this way, others by an empty image.
  }
  if (image.empty()) {
    throw InputError(
        yaml.image_ref.text() + ": image: " + path +
        ": not a readable PGM, PNG or BMP image; export the map again");
  }
  if (image.depth() == CV_16U)
    image.convertTo(image, CV_MAKETYPE(CV_8U, image.channels()), 1.0 / 257);
  if (image.depth() != CV_8U) {
    throw InputError(path + ": only 8 and 16 bit images are maps; export it as 8 bit grey");
  }
  return image;
}

/// Grey value (mean of the colours) and alpha of a pixel.
struct Pixel {
  double grey;
  double alpha;
};

Pixel pixelAt(const cv::Mat& image, int row, int column) {
  const int channels = image.channels();
  const std::uint8_t* p = image.ptr<std::uint8_t>(row) + column * channels;
  const int colours = channels >= 3 ? 3 : 1;
  double sum = 0.0;
  for (int c = 0; c < colours; ++c) sum += p[c];
  const bool has_alpha = channels == 2 || channels == 4;
  return {sum / colours, has_alpha ? static_cast<double>(p[channels - 1]) : 255.0};
}

Cell cellOf(const Pixel& pixel, const MapYaml& yaml) {
  if (yaml.mode == MapMode::kRaw) {
    // Values are occupancy percentages 0..100; anything above is unknown.
    const double percent = pixel.grey;
    if (percent > 100.0) return Cell::kUnknown;
    if (percent / 100.0 >= yaml.occupied_thresh) return Cell::kOccupied;
    return percent / 100.0 <= yaml.free_thresh ? Cell::kFree : Cell::kUnknown;
  }
  if (yaml.mode == MapMode::kScale && pixel.alpha < 255.0) return Cell::kUnknown;
  const double shade = pixel.grey / 255.0;
  const double occupancy = yaml.negate ? shade : 1.0 - shade;
  if (occupancy > yaml.occupied_thresh) return Cell::kOccupied;
  return occupancy < yaml.free_thresh ? Cell::kFree : Cell::kUnknown;
}

grid::OccupancyMap loadMapServer(const std::string& path) {
  const MapYaml yaml = readMapYaml(path);
  const fs::path image_path = fs::path(yaml.image).is_absolute()
                                  ? fs::path(yaml.image)
                                  : fs::path(path).parent_path() / yaml.image;
  const cv::Mat image = readImage(image_path.string(), yaml);
  std::vector<Cell> cells;
  cells.reserve(static_cast<std::size_t>(image.cols) * static_cast<std::size_t>(image.rows));
  for (int row = image.rows - 1; row >= 0; --row) {
    for (int column = 0; column < image.cols; ++column) {
      cells.push_back(cellOf(pixelAt(image, row, column), yaml));
    }
  }
  // The origin is the pose of the lower left corner, its yaw turns the whole image.
  return grid::OccupancyMap::fromCells(
      image.cols, image.rows, yaml.resolution, {0.0, 0.0}, cells, yaml.T_map_corner);
}

/// Cells of an MRPT grid decided into three kinds, on a grid that starts at its corner. MRPT itself
/// takes every cell on the occupied side of 0.5 for an obstacle; cells this near to it are unknown.
grid::OccupancyMap fromMrptGrid(const COccupancyGridMap2D& source) {
  constexpr float kUndecided = 0.05F;
  const int width = static_cast<int>(source.getSizeX());
  const int height = static_cast<int>(source.getSizeY());
  std::vector<Cell> cells;
  cells.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int iy = 0; iy < height; ++iy) {
    for (int ix = 0; ix < width; ++ix) {
      const float freeness = source.getCell(ix, iy);
      cells.push_back(
          freeness < 0.5F - kUndecided
              ? Cell::kOccupied
              : (freeness > 0.5F + kUndecided ? Cell::kFree : Cell::kUnknown));
    }
  }
  return grid::OccupancyMap::fromCells(
      width,
      height,
      static_cast<double>(source.getResolution()),
      {static_cast<double>(source.getXMin()), static_cast<double>(source.getYMin())},
      cells);
}

bool endsWith(const std::string& text, std::string_view end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

grid::OccupancyMap loadMap(const std::string& path) {
  if (endsWith(path, ".yaml") || endsWith(path, ".yml")) return loadMapServer(path);
  if (endsWith(path, ".gridmap") || endsWith(path, ".gridmap.gz")) {
    COccupancyGridMap2D grid;
    readMrptObject(path, grid, "MRPT grid map");
    return fromMrptGrid(grid);
  }
  if (endsWith(path, ".simplemap") || endsWith(path, ".simplemap.gz")) {
    mrpt::maps::CSimpleMap simple_map;
    readMrptObject(path, simple_map, "MRPT simple map");
    COccupancyGridMap2D grid(-1.0F, 1.0F, -1.0F, 1.0F, static_cast<float>(kSimpleMapResolution_m));
    grid.loadFromSimpleMap(simple_map);
    return fromMrptGrid(grid);
  }
  if (endsWith(path, ".dat") || endsWith(path, ".dat.gz")) return readWeanMap(openFile(path));
  throw InputError(
      path +
      ": unknown kind of map; give a map_server .yaml, .simplemap[.gz], .gridmap[.gz] or the "
      ".dat[.gz] of the Wean Hall recordings");
}

bool isMap(const std::string& path) {
  for (const char* end :
       {".yaml", ".yml", ".gridmap", ".gridmap.gz", ".simplemap", ".simplemap.gz"}) {
    if (endsWith(path, end)) return true;
  }
  if (!endsWith(path, ".dat") && !endsWith(path, ".dat.gz")) return false;
  try {
    return looksLikeWeanMap(LineReader(openFile(path)));
  } catch (const InputError&) {
    return false;
  }
}

void saveMapServer(
    const grid::OccupancyMap& map,
    const std::string& yaml_path,
    const std::string& image_path,
    const std::string& image_name,
    const std::optional<MapGeoreference>& georeference) {
  const int width = map.width();
  const int height = map.height();
  std::ofstream image(image_path, std::ios::binary);
  image << "P5\n" << width << ' ' << height << "\n255\n";
  std::string row(static_cast<std::size_t>(width), '\0');
  for (int iy = height - 1; iy >= 0; --iy) {
    for (int ix = 0; ix < width; ++ix) {
      const Cell cell = map.cell(ix, iy);
      row[static_cast<std::size_t>(ix)] = static_cast<char>(
          cell == Cell::kOccupied ? kPgmOccupied
          : cell == Cell::kFree   ? kPgmFree
                                  : kPgmUnknown);
    }
    image << row;
  }
  image.close();
  if (!image) throw InputError(image_path + ": cannot be written; check the folder and the disk");

  const Pose2 T_map_corner = compose(map.T_map_grid(), Pose2{map.corner().x, map.corner().y, 0.0});
  std::ofstream yaml(yaml_path, std::ios::binary);
  yaml << formatMapYaml(
      image_name.empty() ? fs::path(image_path).filename().string() : image_name,
      map.resolution(),
      T_map_corner,
      georeference);
  yaml.close();
  if (!yaml) throw InputError(yaml_path + ": cannot be written; check the folder and the disk");
}

void saveLayer(
    const std::string& path,
    int width,
    int height,
    bool wide,
    const std::function<std::vector<std::uint16_t>(int iy)>& row) {
  std::ofstream image(path, std::ios::binary);
  image << "P5\n" << width << ' ' << height << (wide ? "\n65535\n" : "\n255\n");
  std::string pixels;
  for (int iy = height - 1; iy >= 0; --iy) {
    pixels.clear();
    for (const std::uint16_t value : row(iy)) {
      if (wide) pixels += static_cast<char>(value >> 8U);
      pixels += static_cast<char>(value & 255U);
    }
    image << pixels;
  }
  image.close();
  if (!image) throw InputError(path + ": cannot be written; check the folder and the disk");
}

}  // namespace vestibule::io
