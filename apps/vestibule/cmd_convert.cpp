#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <sstream>

#include "commands.hpp"
#include "run_output.hpp"
#include "terminal.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/io/rawlog_writer.hpp"
#include "vestibule/io/recording.hpp"
#include "vestibule/io/sweep_io.hpp"
#include "vestibule/io/trajectory.hpp"
#include "vestibule/pipeline/config.hpp"
#include "vestibule/sensors/slips.hpp"

namespace vestibule::app {
namespace {

namespace fs = std::filesystem;

struct ConvertArguments {
  std::string in;
  std::string out;
  std::string config;
  std::string csv_mapping;
  std::string mount;
  std::string datum;
  std::string slips;
  std::uint64_t seed = 1;
};

/// ".rawlog", also of "a.rawlog.gz".
std::string extensionOf(const std::string& path) {
  fs::path p(path);
  if (p.extension() == ".gz" || p.extension() == ".bz2") p = p.stem();
  return p.extension().string();
}

std::vector<double> numbers(
    const std::string& text, std::size_t n, const std::string& option, const std::string& what) {
  std::vector<double> values;
  std::istringstream words(text);
  for (std::string word; std::getline(words, word, ',');) {
    char* end = nullptr;
    const double value = std::strtod(word.c_str(), &end);
    if (word.empty() || *end != '\0' || !std::isfinite(value)) break;
    values.push_back(value);
  }
  if (values.size() != n || text.back() == ',') {
    throw ConfigError(option + " " + text + ": must be " + what);
  }
  return values;
}

/// Writes beside the final name and renames when `write` has returned.
void replaceFile(const std::string& path, const std::function<void(const std::string&)>& write) {
  const std::string partial = path + ".partial";
  try {
    write(partial);
  } catch (...) {
    std::error_code ignored;
    fs::remove(partial, ignored);
    throw;
  }
  std::error_code error;
  fs::rename(partial, path, error);
  if (error) throw ConfigError(path + ": cannot be written (" + error.message() + ")");
}

void writeText(const std::string& path, const std::string& text) {
  replaceFile(path, [&](const std::string& partial) {
    std::ofstream file(partial, std::ios::binary);
    file << text;
    file.close();
    if (!file) throw ConfigError(path + ": cannot be written; check the folder");
  });
}

std::size_t convertPcd(const ConvertArguments& args, const pipeline::Config& config) {
  Pose3 T_base_laser;
  if (!args.mount.empty()) {
    const auto v = numbers(args.mount, 6, "--mount", "x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg");
    T_base_laser = {v[0], v[1], v[2], degToRad(v[3]), degToRad(v[4]), degToRad(v[5])};
  }
  const LidarSweep sweep = io::readPcd(args.in, T_base_laser);
  const LaserScan scan = sliceSweep(sweep, config.slice);
  replaceFile(args.out, [&](const std::string& partial) {
    io::RawlogWriter writer(partial);
    writer.write(scan, "SLICE");
    writer.close();
  });
  return 1;
}

SlipParams slipsOf(const std::string& text) {
  const std::string what = "every_s,distance_m,turn_deg,lasts_s; 60,1,20,1 say, none negative";
  const auto v = numbers(text, 4, "--slips", what);
  if (v[0] <= 0.0 || v[1] < 0.0 || v[2] < 0.0 || v[3] < 0.0) {
    throw ConfigError("--slips " + text + ": must be " + what);
  }
  return {v[0], v[1], degToRad(v[2]), v[3]};
}

std::size_t convertRecording(const ConvertArguments& args, const pipeline::Config& config) {
  io::RecordingOptions options;
  options.rig = config.rig;
  options.csv_mapping = args.csv_mapping;
  options.csv_mapping_dir = shipped("config/csv");
  options.slice = config.slice;
  const auto reader = io::openRecording(args.in, options);
  std::optional<SlipMaker> slips;
  if (!args.slips.empty()) slips.emplace(slipsOf(args.slips), args.seed);
  std::size_t n = 0;
  replaceFile(args.out, [&](const std::string& partial) {
    io::RawlogWriter writer(partial);
    ProgressBar bar("convert");
    const auto progress = bar.callback();
    std::optional<Timestamp> first;
    while (auto record = reader->next()) {
      auto* odometry = std::get_if<WheelOdometry>(&record->measurement);
      if (slips && odometry != nullptr) slips->apply(*odometry);
      writer.write(record->measurement, record->source);
      ++n;
      const Timestamp stamp = stampOf(record->measurement);
      if (!first) first = stamp;
      progress(reader->progress(), toSeconds(stamp - *first));
    }
    writer.close();
  });
  for (const std::string& note : reader->notes()) std::printf("note: %s\n", note.c_str());
  if (slips) std::printf("%zu slips put into the odometry\n", slips->count());
  return n;
}

void convertMap(const ConvertArguments& args) {
  const grid::OccupancyMap map = io::loadMap(args.in);
  const auto georeference = io::loadGeoreference(args.in);
  const fs::path image = fs::path(args.out).replace_extension(".pgm");
  replaceFile(args.out, [&](const std::string& partial) {
    replaceFile(image.string(), [&](const std::string& image_file) {
      io::saveMapServer(map, partial, image_file, image.filename().string(), georeference);
    });
  });
}

std::size_t convertTrajectory(const ConvertArguments& args, const std::string& to) {
  const io::Trajectory trajectory = io::readTum(args.in);
  if (to == ".geojson") {
    if (args.datum.empty()) {
      throw ConfigError(
          "a .geojson needs --datum lat_deg,lon_deg,height_m, the map frame's origin");
    }
    const auto v = numbers(args.datum, 3, "--datum", "lat_deg,lon_deg,height_m");
    const geo::TangentPlane plane({v[0], v[1], v[2]});
    std::vector<Geodetic> positions;
    for (const auto& p : trajectory) positions.push_back(plane.toGeodetic({p.T.x, p.T.y, p.T.z}));
    writeText(args.out, io::toGeoJson(positions, fs::path(args.in).filename().string()));
  } else {
    std::string text;
    for (const auto& p : trajectory) {
      text += io::formatKittiLine(p.T);
    }
    writeText(args.out, text);
  }
  return trajectory.size();
}

constexpr const char* kKinds =
    "a recording or a sweep (.rawlog .log .clf .bag .csv .pcd) to .rawlog, a map (.yaml .yml "
    ".simplemap .gridmap) to .yaml, a trajectory (.tum) to .kitti or .geojson";

void convert(const ConvertArguments& args) {
  const pipeline::Config config = pipeline::loadConfig(args.config);
  const std::string from = extensionOf(args.in);
  const std::string to = extensionOf(args.out);
  std::error_code error;
  if (fs::equivalent(args.in, args.out, error)) {
    throw ConfigError(args.out + ": is the input; give the output another name");
  }
  const bool from_map =
      from == ".yaml" || from == ".yml" || from == ".simplemap" || from == ".gridmap";
  const bool recording = from != ".tum" && from != ".pcd" && !from_map && to == ".rawlog";
  if (!args.slips.empty() && !recording) {
    throw ConfigError("--slips " + args.slips + ": only a recording has odometry that can slip");
  }
  if (from == ".tum" && (to == ".kitti" || to == ".geojson")) {
    std::printf("%zu poses: %s\n", convertTrajectory(args, to), args.out.c_str());
  } else if (from_map && to == ".yaml") {
    convertMap(args);
    std::printf("map: %s\n", args.out.c_str());
  } else if (from == ".pcd" && to == ".rawlog") {
    std::printf("%zu scan: %s\n", convertPcd(args, config), args.out.c_str());
  } else if (recording) {
    std::printf("%zu records: %s\n", convertRecording(args, config), args.out.c_str());
  } else {
    throw ConfigError(
        "convert: no way from '" + args.in + "' to '" + args.out + "'; it converts " + kKinds);
  }
}

}  // namespace

void addConvert(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<ConvertArguments>();
  CLI::App* command = app.add_subcommand(
      "convert", "other formats of recordings, maps and trajectories; 3D sweeps to 2D scans");
  command->footer(std::string("Converts ") + kKinds + ".");
  command->add_option("IN", args->in, "file to read")->required();
  command->add_option("OUT", args->out, "file to write; its extension says what")->required();
  command->add_option("--config", args->config, "YAML as config/default.yaml (rig, slice)");
  command->add_option(
      "--csv-mapping", args->csv_mapping, "YAML with the columns of a CSV recording");
  command->add_option(
      "--mount",
      args->mount,
      "x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg of a .pcd's origin on the robot, z above the ground");
  command->add_option("--datum", args->datum, "lat_deg,lon_deg,height_m of the map frame's origin");
  command->add_option(
      "--slips",
      args->slips,
      "every_s,distance_m,turn_deg,lasts_s: put slips of the wheels into a recording, to try out "
      "what a map makes of them");
  command->add_option("--seed", args->seed, "of the slips' directions");
  command->callback([args, &exit_code] {
    convert(*args);
    exit_code = kDone;
  });
}

}  // namespace vestibule::app
