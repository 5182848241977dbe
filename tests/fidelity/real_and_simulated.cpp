#include "real_and_simulated.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <sstream>

#include "scenario_log.hpp"
#include "test_files.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/geo/tangent_plane.hpp"
#include "vestibule/grid/distance_field.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/pipeline/fuse.hpp"
#include "vestibule/pipeline/localize.hpp"
#include "vestibule/pipeline/map.hpp"

namespace vestibule::test {
namespace {

using MapPtr = std::shared_ptr<const grid::OccupancyMap>;

const std::string kMrptDatasets = "/usr/share/mrpt/datasets/";
constexpr std::uint64_t kSeed = 1;
constexpr std::uint64_t kSeeds = 10;     // of short drives
constexpr std::uint64_t kLongSeeds = 2;  // of an hour and a half each

void noProgress(double /*share*/, double /*data_s*/) {}

class InnovationLog : public Observer {
 public:
  void onUpdate(const UpdateEvent& event) override {
    if (event.sensor == "gnss" && event.dof == 2) lengths.push_back(std::sqrt(event.nis));
  }
  std::vector<double> lengths;
};

class ScanLog : public Observer {
 public:
  void onParticles(const ParticlesEvent& event) override {
    outlier_shares.push_back(1.0 - event.inlier_share);
  }
  std::vector<double> outlier_shares;
};

ScanFit scanFit(const std::string& recording, const MapPtr& map, const Pose2& start) {
  ScanLog log;
  Observers observers;
  observers.attach(log);
  const auto result = pipeline::localize(recording, {}, map, start, {}, observers, noProgress);
  ScanFit fit;
  fit.outlier_shares = log.outlier_shares;
  const grid::DistanceField field(*map);
  const auto reader = io::openRecording(recording, {});
  std::size_t index = 0;
  while (const auto record = reader->next()) {
    const auto* scan = std::get_if<LaserScan>(&record->measurement);
    if (scan == nullptr) continue;
    const Pose2& T_map_base = result.trajectory.at(index++).pose;
    if (index % 5 != 0) continue;  // neighbouring scans say the same
    for (const Point2& p_base : endPointsInBase(*scan)) {
      const Point2 p_map = transform(T_map_base, p_base);
      if (map->at(p_map) == grid::Cell::kUnknown) continue;
      // The mean over a cell's size about the point: finer than the cells themselves.
      const double half_m = 0.5 * map->resolution();
      double residual_m = 0.0;
      for (const double dx : {-half_m, half_m}) {
        for (const double dy : {-half_m, half_m}) {
          residual_m += 0.25 * field.at({p_map.x + dx, p_map.y + dy}, 0.0);
        }
      }
      fit.residuals_m.push_back(residual_m);
    }
  }
  return fit;
}

/// How wrong the rows of one second are.
struct RowErrors {
  std::vector<double> fix_m;
  std::vector<double> fix_change_m;  ///< from one row to the next
  std::vector<double> heading_deg;   ///< from the drive's mean, which is mounting and declination
  std::vector<double> heading_change_deg;  ///< within ten seconds
};

/// Differences to their mean direction, and how much they change within ten rows.
void addHeadingErrors(RowErrors& errors, const std::vector<double>& differences_rad) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const double d : differences_rad) sum += Eigen::Vector2d(std::cos(d), std::sin(d));
  const double mean_rad = std::atan2(sum.y(), sum.x());
  constexpr std::size_t kRows = 10;
  for (std::size_t i = 0; i < differences_rad.size(); ++i) {
    errors.heading_deg.push_back(radToDeg(std::abs(angleDiff(differences_rad[i], mean_rad))));
    if (i < kRows) continue;
    const double change_rad = angleDiff(differences_rad[i], differences_rad[i - kRows]);
    errors.heading_change_deg.push_back(radToDeg(std::abs(change_rad)));
  }
}

void addRowErrors(RowErrors& errors, const std::string& csv_path) {
  std::ifstream in(csv_path);
  std::string line;
  const auto cells = [&line] {
    std::vector<std::string> words;
    std::stringstream row(line);
    for (std::string word; std::getline(row, word, ',');) words.push_back(word);
    return words;
  };
  std::getline(in, line);
  const std::vector<std::string> header = cells();
  const auto column = [&header](const char* name) {
    return static_cast<std::size_t>(std::find(header.begin(), header.end(), name) - header.begin());
  };
  const std::size_t fix_x = column("gps_new_x");
  const std::size_t fix_y = column("gps_new_y");
  const std::size_t true_x = column("gt_x_north_m");
  const std::size_t true_y = column("gt_y_east_m");
  const std::size_t true_yaw = column("gt_yaw_rad");
  const std::size_t heading = column("imu_prev_heading_rad");
  const auto nothing = Eigen::Vector2d::Constant(std::nan(""));
  Eigen::Vector2d truth_before = nothing;  // fixes are one second old
  Eigen::Vector2d error_before = nothing;
  double yaw_before_rad = std::nan("");
  std::vector<double> heading_differences_rad;
  while (std::getline(in, line)) {
    const std::vector<std::string> row = cells();
    const auto at = [&row](std::size_t x, std::size_t y) {
      return Eigen::Vector2d(std::stod(row.at(x)), std::stod(row.at(y)));
    };
    const Eigen::Vector2d error = at(fix_x, fix_y) - truth_before;
    const Eigen::Vector2d change = error - error_before;
    if (error.allFinite()) errors.fix_m.push_back(error.norm());
    if (change.allFinite()) errors.fix_change_m.push_back(change.norm());
    const double difference_rad = std::stod(row.at(heading)) - yaw_before_rad;
    if (std::isfinite(difference_rad)) heading_differences_rad.push_back(difference_rad);
    error_before = error;
    truth_before = at(true_x, true_y);
    yaw_before_rad = std::stod(row.at(true_yaw));
  }
  addHeadingErrors(errors, heading_differences_rad);
}

void addDrive(Sample& sample, const std::vector<double>& drive) {
  sample.values.insert(sample.values.end(), drive.begin(), drive.end());
  sample.medians.push_back(quantile(drive, 0.5));
}

/// A drive as rows of one second, as the NCLT logs are shipped: fixes and headings one second old,
/// mean wheel speeds; x north, y east, yaw clockwise from north.
void writeRows(const sim::Scenario& scenario, std::uint64_t seed, const std::string& csv_path) {
  struct Row {
    double north = std::nan("");
    double east = std::nan("");
    double heading_rad = 0.0;
    double way_m = 0.0;
    double turn_rad = 0.0;
  };
  std::vector<Row> rows(2);
  const geo::TangentPlane plane(scenario.world.datum);
  const metrics::Trajectory truth = driveScenario(scenario, seed, [&](const Measurement& m) {
    const auto second =
        static_cast<std::size_t>(std::ceil(toSeconds(stampOf(m) - sim::kStartOfTime) - 1e-6));
    if (rows.size() < second + 2) rows.resize(second + 2);
    if (const auto* wheels = std::get_if<WheelOdometry>(&m)) {
      const Eigen::Vector3d moved = logSe2(wheels->T_previous_now);
      rows[second].way_m += moved.x();
      rows[second].turn_rad += moved.z();
    } else if (const auto* heading = std::get_if<Heading>(&m)) {
      rows[second + 1].heading_rad = wrapToPi(0.5 * kPi - heading->yaw_rad);
    } else if (const auto* fix = std::get_if<GnssFix>(&m)) {
      if (fix->type == GnssFixType::kNone) return;
      const Eigen::Vector3d enu = plane.toEnu(std::get<Geodetic>(fix->position));
      rows[second + 1].north = enu.y();
      rows[second + 1].east = enu.x();
    }
  });
  std::ofstream out(csv_path);
  out.precision(10);
  out << "k_s,gps_new_x,gps_new_y,wheel_left_new_mps,wheel_right_new_mps,imu_prev_heading_rad,"
         "gt_x_north_m,gt_y_east_m,gt_yaw_rad\n";
  const double half_track_m = 0.5 * scenario.sim.robot.nominal_track_m;
  for (std::size_t k = 1; k + 1 < rows.size(); ++k) {
    const Row& row = rows[k];
    out << k << ',' << row.north << ',' << row.east << ','
        << row.way_m - half_track_m * row.turn_rad << ',' << row.way_m + half_track_m * row.turn_rad
        << ',' << row.heading_rad;
    const Pose2& T = truth.at(std::min(50 * k, truth.size() - 1)).pose;  // 50 poses a second
    out << ',' << T.y << ',' << T.x << ',' << wrapToPi(0.5 * kPi - T.phi) << '\n';
  }
}

constexpr const char* kInnovationUnit = "innovation of a fix / its sigma, sqrt(n' S^-1 n)";

Panel husky(const TempFolder& folder) {
  Panel panel{
      "GNSS filter, SBAS at 2.5 Hz",
      kInnovationUnit,
      4.0,
      32,
      {"Husky", gnssInnovations(shipped("datasets/husky_gnss/test1.bag"))},
      {"campus_sbas_round", {}}};
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const std::string simulated = folder / "husky.rawlog";
    recordScenario(shippedScenario("campus_sbas_round"), seed, simulated);
    addDrive(panel.simulated, gnssInnovations(simulated));
  }
  return panel;
}

std::vector<Panel> nclt(const TempFolder& folder, const std::string& data) {
  const std::string mapping = shipped("config/csv/nclt_1hz.yaml");
  Sample real{"NCLT", {}};
  Sample simulated{"campus_hours", {}};
  RowErrors real_errors;
  RowErrors simulated_errors;
  for (const char* log : {"nclt_2013-01-10_1hz.csv", "nclt_2012-11-04_1hz.csv"}) {
    addDrive(real, gnssInnovations(data + "/nclt_1hz/" + log, mapping));
    addRowErrors(real_errors, data + "/nclt_1hz/" + log);
  }
  for (std::uint64_t seed = 1; seed <= kLongSeeds; ++seed) {
    const std::string rows = folder / "nclt.csv";
    writeRows(shippedScenario("campus_hours"), seed, rows);
    addDrive(simulated, gnssInnovations(rows, mapping));
    addRowErrors(simulated_errors, rows);
  }
  const std::string what = "Consumer receiver and compass at 1 Hz: ";
  std::vector<Panel> panels{{what + "filter", kInnovationUnit, 4.0, 32, real, simulated}};
  const auto add = [&](const char* name, const char* unit, double most, auto errors) {
    panels.push_back(
        {what + name,
         unit,
         most,
         32,
         {real.name, real_errors.*errors},
         {simulated.name, simulated_errors.*errors}});
  };
  add("fixes", "error of a fix [m]", 40.0, &RowErrors::fix_m);
  add("change of fixes", "change of that error within a second [m]", 4.0, &RowErrors::fix_change_m);
  add("headings", "error of a heading, mean removed [deg]", 32.0, &RowErrors::heading_deg);
  add("change of headings",
      "change of that error within 10 s [deg]",
      32.0,
      &RowErrors::heading_change_deg);
  return panels;
}

void addScanPanels(
    std::vector<Panel>& panels,
    const std::string& what,
    const std::string& real_name,
    ScanFit real,
    const std::string& simulated_name,
    ScanFit simulated) {
  panels.push_back(
      {"Localization, " + what + ": beams",
       "from the end of a beam to the nearest mapped obstacle [m]",
       0.25,
       25,
       {real_name, std::move(real.residuals_m)},
       {simulated_name, std::move(simulated.residuals_m)}});
  panels.push_back(
      {"Localization, " + what + ": scans",
       "share of a scan's beams off the mapped obstacles",
       0.3,
       30,
       {real_name, std::move(real.outlier_shares)},
       {simulated_name, std::move(simulated.outlier_shares)}});
}

ScanFit simulatedFit(const TempFolder& folder, const std::string& name) {
  const sim::Scenario scenario = shippedScenario(name);
  const std::string log = folder / (name + ".rawlog");
  recordScenario(scenario, kSeed, log);
  const geo::Site site = geo::loadSite(*scenario.site_path);
  const geo::IndoorMap& told = site.indoor_maps.front();
  const auto map = std::make_shared<const grid::OccupancyMap>(io::loadMap(told.yaml_path));
  return scanFit(log, map, between(told.T_map_grid, scenario.T_map_base_start));
}

/// The raw log of MIT CSAIL in the map of its corrected log; the scans of both have equal ranges.
ScanFit csailFit(const std::string& data) {
  const std::string raw = data + "/radish/mit-csail.clf.bz2";
  const std::string corrected = data + "/radish_corrected/csail-corrected.log.gz";
  const auto map = pipeline::mapFromKnownPoses(corrected, {}, {}, {}, noProgress);
  // Where the first corrected scan was taken in the raw log, and the odometry back to the start.
  std::vector<std::pair<std::vector<float>, Pose2>> known;
  const auto corrected_reader = io::openRecording(corrected, {});
  while (const auto record = corrected_reader->next()) {
    const auto* scan = std::get_if<LaserScan>(&record->measurement);
    if (scan != nullptr) known.emplace_back(scan->ranges_m, scan->T_log_base.value());
  }
  std::optional<Pose2> first;
  const auto raw_reader = io::openRecording(raw, {});
  while (const auto record = raw_reader->next()) {
    const auto* scan = std::get_if<LaserScan>(&record->measurement);
    if (scan == nullptr) continue;
    if (!first) first = scan->T_log_base.value();
    for (const auto& [ranges_m, T_map_base] : known) {
      if (ranges_m != scan->ranges_m) continue;
      const Pose2 start = compose(T_map_base, between(scan->T_log_base.value(), *first));
      return scanFit(raw, std::make_shared<const grid::OccupancyMap>(map.map), start);
    }
  }
  throw std::runtime_error(raw + ": shares no scan with " + corrected);
}

}  // namespace

std::vector<double> gnssInnovations(const std::string& recording, const std::string& csv_mapping) {
  InnovationLog log;
  Observers observers;
  observers.attach(log);
  io::RecordingOptions options;
  if (!csv_mapping.empty()) options.csv_mapping = csv_mapping;
  (void)pipeline::fuse(recording, options, {}, {}, observers, noProgress);
  return log.lengths;
}

std::vector<Panel> comparisons(const std::optional<std::string>& data_folder) {
  const TempFolder folder;
  std::vector<Panel> panels;
  panels.push_back(husky(folder));
  if (data_folder) {
    for (Panel& panel : nclt(folder, *data_folder)) panels.push_back(std::move(panel));
  }
  const auto uwb_map = std::make_shared<const grid::OccupancyMap>(
      io::loadMap(kMrptDatasets + "uwb_ro-localization_demo_map.gridmap.gz"));
  const ScanFit office = simulatedFit(folder, "office_sick");
  addScanPanels(
      panels,
      "UWB demo",
      "UWB demo",
      scanFit(kMrptDatasets + "uwb_ro-localization_demo.rawlog", uwb_map, {}),
      "office_sick",
      office);
  if (data_folder) {
    addScanPanels(panels, "CSAIL", "CSAIL", csailFit(*data_folder), "office_sick", office);
  }
  return panels;
}

}  // namespace vestibule::test
