#include "vestibule/io/map_io.hpp"

#include <fcntl.h>
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/maps/CSimpleMap.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "byte_stream.hpp"
#include "map_yaml.hpp"
#include "mrpt_object.hpp"
#include "pgm.hpp"
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
constexpr double kSaversFreeThresh = 0.196;
constexpr double kSimpleMapResolution_m = 0.05;

/// OpenCV and the libraries under it write to the standard error stream what is wrong with a file;
/// errors here name the file and the remedy. For the process: one at a time.
class Quiet {
 public:
  Quiet() : lock_(mutex()), kept_(dup(STDERR_FILENO)) {
    const int nowhere = open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (kept_ >= 0 && nowhere >= 0) dup2(nowhere, STDERR_FILENO);
    if (nowhere >= 0) close(nowhere);
  }
  ~Quiet() {
    if (kept_ < 0) return;
    (void)std::fflush(stderr);
    dup2(kept_, STDERR_FILENO);
    close(kept_);
  }
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  static std::mutex& mutex() {
    static std::mutex m;
    return m;
  }
  std::lock_guard<std::mutex> lock_;
  int kept_;
};

cv::Mat readImage(const std::string& path, const MapYaml& yaml) {
  const std::string where = yaml.image_ref.text() + ": image: " + path;
  if (!fs::is_regular_file(path)) {
    throw InputError(where + ": no such file; correct the path (it is relative to the YAML)");
  }
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  cv::Mat image;
  if (looksLikePgm(bytes)) {
    image = decodePgm(bytes, where);
  } else {
    try {
      const Quiet quiet;
      image =
          cv::imdecode(std::vector<std::uint8_t>(bytes.begin(), bytes.end()), cv::IMREAD_UNCHANGED);
    } catch (const cv::Exception&) {
      // imdecode reports some damaged files this way, others by an empty image.
    }
  }
  if (image.empty()) {
    throw InputError(
        where + ": not a readable PGM, PNG or BMP image, or cut short; export the map again");
  }
  if (image.depth() != CV_8U && image.depth() != CV_16U) {
    throw InputError(where + ": only 8 and 16 bit images are maps; export it as 8 bit grey");
  }
  return image;
}

/// Mean of the colours and alpha of a pixel, 0..1; alpha is absent where the image has none.
struct Pixel {
  double shade;
  std::optional<double> alpha;
};

template <class Depth>
Pixel pixelAt(const cv::Mat& image, int row, int column) {
  constexpr double kWhite = std::numeric_limits<Depth>::max();
  const int channels = image.channels();
  const Depth* p = image.ptr<Depth>(row) + column * channels;
  const int colours = channels >= 3 ? 3 : 1;
  int sum = 0;
  for (int c = 0; c < colours; ++c) sum += p[c];
  Pixel pixel{sum / (colours * kWhite), {}};
  if (channels == 2 || channels == 4) pixel.alpha = p[channels - 1] / kWhite;
  return pixel;
}

/// The value map_server gives a cell: 0 free to 100 occupied, -1 unknown.
int mapServerValue(const Pixel& pixel, const MapYaml& yaml) {
  if (yaml.mode == MapMode::kRaw) {  // percentages; negate does not touch them
    const auto percent = static_cast<int>(std::round(pixel.shade * 255.0));
    return percent <= 100 ? percent : -1;
  }
  const bool trinary = yaml.mode == MapMode::kTrinary;
  // Trinary takes alpha for one more colour, scale everything translucent for unknown.
  if (!trinary && pixel.alpha && *pixel.alpha < 1.0) return -1;
  const double shade =
      trinary && pixel.alpha ? (3.0 * pixel.shade + *pixel.alpha) / 4.0 : pixel.shade;
  const double occupancy = yaml.negate ? shade : 1.0 - shade;
  if (occupancy > yaml.occupied_thresh) return 100;
  if (occupancy < yaml.free_thresh) return 0;
  if (trinary || !(yaml.occupied_thresh > yaml.free_thresh)) return -1;
  return static_cast<int>(std::rint(
      (occupancy - yaml.free_thresh) / (yaml.occupied_thresh - yaml.free_thresh) * 100.0));
}

/// As AMCL takes them: only 0 is free and only 100 an obstacle. Raw percentages have not seen the
/// thresholds yet.
Cell cellOf(const Pixel& pixel, const MapYaml& yaml) {
  const int value = mapServerValue(pixel, yaml);
  if (value < 0) return Cell::kUnknown;
  const bool raw = yaml.mode == MapMode::kRaw;
  if (value > 0 && value >= (raw ? 100.0 * yaml.occupied_thresh : 100.0)) return Cell::kOccupied;
  return value <= (raw ? 100.0 * yaml.free_thresh : 0.0) ? Cell::kFree : Cell::kUnknown;
}

/// Whether an image has the three values that map savers write and nothing else, and the YAML would
/// take their unknown for free.
bool unknownWouldBeFree(const cv::Mat& image, const MapYaml& yaml) {
  if (yaml.mode != MapMode::kTrinary || yaml.negate || image.type() != CV_8UC1) return false;
  if (!(1.0 - kPgmUnknown / 255.0 < yaml.free_thresh)) return false;
  bool any = false;
  for (int row = 0; row < image.rows; ++row) {
    for (int column = 0; column < image.cols; ++column) {
      const std::uint8_t value = image.at<std::uint8_t>(row, column);
      any = any || value == kPgmUnknown;
      if (value != kPgmUnknown && value != kPgmOccupied && value < kPgmFree) return false;
    }
  }
  return any;
}

grid::OccupancyMap loadMapServer(const std::string& path, std::vector<std::string>* notes) {
  MapYaml yaml = readMapYaml(path);
  const fs::path image_path = fs::path(yaml.image).is_absolute()
                                  ? fs::path(yaml.image)
                                  : fs::path(path).parent_path() / yaml.image;
  const cv::Mat image = readImage(image_path.string(), yaml);
  if (notes != nullptr) notes->insert(notes->end(), yaml.ignored.begin(), yaml.ignored.end());
  if (unknownWouldBeFree(image, yaml)) {
    if (notes != nullptr) {
      notes->push_back(
          yaml.free_thresh_ref.text() +
          ": free_thresh would make free of the 205 that map savers write for unknown; taken as "
          "unknown (free_thresh: 0.196 says so)");
    }
    yaml.free_thresh = kSaversFreeThresh;
  }
  std::vector<Cell> cells;
  cells.reserve(static_cast<std::size_t>(image.cols) * static_cast<std::size_t>(image.rows));
  for (int row = image.rows - 1; row >= 0; --row) {
    for (int column = 0; column < image.cols; ++column) {
      cells.push_back(cellOf(
          image.depth() == CV_16U ? pixelAt<std::uint16_t>(image, row, column)
                                  : pixelAt<std::uint8_t>(image, row, column),
          yaml));
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

bool isMapServer(const std::string& path) {
  return endsWith(path, ".yaml") || endsWith(path, ".yml");
}

}  // namespace

grid::OccupancyMap loadMap(const std::string& path, std::vector<std::string>* notes) {
  if (isMapServer(path)) return loadMapServer(path, notes);
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

std::optional<MapGeoreference> loadGeoreference(const std::string& path) {
  if (!isMapServer(path)) return std::nullopt;
  return readMapYaml(path).georeference;
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
