#include "vestibule/sim/terrain.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>

#include "vestibule/core/errors.hpp"

namespace vestibule::sim {
namespace {

double heightIn(const HeightField& field, const Point2& p_map) {
  const Point2 p = transform(inverse(field.T_map_image), p_map);
  // Heights belong to the middles of the cells.
  const double column = p.x / field.resolution_m - 0.5;
  const double row = p.y / field.resolution_m - 0.5;
  if (column < -0.5 || row < -0.5 || column > field.columns - 0.5 || row > field.rows - 0.5) {
    return 0.0;
  }
  const auto at = [&](int ix, int iy) {
    ix = std::clamp(ix, 0, field.columns - 1);
    iy = std::clamp(iy, 0, field.rows - 1);
    return static_cast<double>(
        field.heights_m
            [static_cast<std::size_t>(iy) * static_cast<std::size_t>(field.columns) +
             static_cast<std::size_t>(ix)]);
  };
  const int ix = static_cast<int>(std::floor(column));
  const int iy = static_cast<int>(std::floor(row));
  const double sx = column - ix;
  const double sy = row - iy;
  return (1.0 - sy) * ((1.0 - sx) * at(ix, iy) + sx * at(ix + 1, iy)) +
         sy * ((1.0 - sx) * at(ix, iy + 1) + sx * at(ix + 1, iy + 1));
}

void loadAscii(HeightField& field, std::istream& in) {
  // ESRI ASCII grid: six header lines "key value", then rows from the top.
  double cell_m = 0.0;
  double no_data = -9999.0;
  std::string key;
  while (in >> std::ws && std::isalpha(in.peek()) != 0) {
    double value = 0.0;
    if (!(in >> key >> value)) break;
    std::transform(key.begin(), key.end(), key.begin(), [](unsigned char c) {
      return static_cast<char>(std::tolower(c));
    });
    if (key == "ncols") field.columns = static_cast<int>(value);
    if (key == "nrows") field.rows = static_cast<int>(value);
    if (key == "cellsize") cell_m = value;
    if (key == "nodata_value") no_data = value;
  }
  constexpr int kMost = 20000;
  if (field.columns < 1 || field.rows < 1 || field.columns > kMost || field.rows > kMost ||
      !(cell_m > 0.0)) {
    throw InputError(field.image + ": not an ESRI ASCII grid: needs ncols, nrows and cellsize");
  }
  field.resolution_m = cell_m;
  const auto columns = static_cast<std::size_t>(field.columns);
  field.heights_m.assign(columns * static_cast<std::size_t>(field.rows), 0.0F);
  for (int row = field.rows - 1; row >= 0; --row) {
    for (std::size_t column = 0; column < columns; ++column) {
      double value = 0.0;
      if (!(in >> value)) {
        throw InputError(field.image + ": ends before its last height; export it again");
      }
      field.heights_m[static_cast<std::size_t>(row) * columns + column] =
          value == no_data ? 0.0F : static_cast<float>(value);
    }
  }
}

/// PNG between the heights of black and white; TIFF of floats in metres.
void loadPicture(HeightField& field, std::istream& in) {
  const std::vector<char> bytes{
      std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  cv::Mat picture;
  if (!bytes.empty()) picture = cv::imdecode(bytes, cv::IMREAD_ANYDEPTH | cv::IMREAD_GRAYSCALE);
  if (picture.empty()) {
    throw InputError(field.image + ": not a picture of heights; expected PNG, float TIFF or .asc");
  }
  field.columns = picture.cols;
  field.rows = picture.rows;
  const bool metres = picture.depth() == CV_32F || picture.depth() == CV_64F;
  const double white = picture.depth() == CV_16U ? 65535.0 : 255.0;
  cv::Mat values;
  picture.convertTo(values, CV_32F);
  for (int row = picture.rows - 1; row >= 0; --row) {
    for (int column = 0; column < picture.cols; ++column) {
      const double v = static_cast<double>(values.at<float>(row, column));
      field.heights_m.push_back(
          static_cast<float>(metres ? v : field.low_m + v / white * (field.high_m - field.low_m)));
    }
  }
}

}  // namespace

double Terrain::height(const Point2& p_map) const {
  double height_m = fields.empty() ? 0.0 : heightIn(fields.front(), p_map);
  for (const Plate& plate : plates) {
    if (geo::contains(plate.outline, p_map)) height_m = plate.height_m;
  }
  for (const Ramp& ramp : ramps) {
    const double dx = ramp.to.x - ramp.from.x;
    const double dy = ramp.to.y - ramp.from.y;
    const double length2 = dx * dx + dy * dy;
    const double x = p_map.x - ramp.from.x;
    const double y = p_map.y - ramp.from.y;
    const double along = (x * dx + y * dy) / length2;
    const double across_m = std::abs(x * dy - y * dx) / std::sqrt(length2);
    if (along >= 0.0 && along <= 1.0 && across_m <= 0.5 * ramp.width_m) {
      height_m = ramp.start_m + along * ramp.rise_m;
    }
  }
  return height_m;
}

void loadHeights(HeightField& field) {
  std::ifstream file(field.image, std::ios::binary);
  if (!file) throw InputError(field.image + ": no such file");
  const auto dot = field.image.find_last_of('.');
  const bool ascii = dot != std::string::npos && field.image.substr(dot) == ".asc";
  (ascii ? loadAscii : loadPicture)(field, file);
  if (!std::all_of(field.heights_m.begin(), field.heights_m.end(), [](float h) {
        return std::isfinite(h);
      })) {
    throw InputError(field.image + ": has heights that are not finite; fill its gaps");
  }
}

}  // namespace vestibule::sim
