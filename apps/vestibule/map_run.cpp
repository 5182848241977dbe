#include <algorithm>

#include "commands.hpp"
#include "runs.hpp"
#include "terminal.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/core/memory.hpp"
#include "vestibule/core/params.hpp"
#include "vestibule/gui_headless/charts.hpp"
#include "vestibule/io/map_io.hpp"
#include "vestibule/io/simple_map.hpp"

namespace vestibule::app {
namespace {

constexpr int kPreviewWidth_px = 900;

void emitTrajectory(const metrics::Trajectory& trajectory, const Observers& observers) {
  for (const metrics::TimedPose& p : trajectory) {
    PoseEvent event;
    event.stamp = p.stamp;
    event.source = PoseSource::kPublished;
    event.mode = Mode::kIndoor;
    event.T.mean = p.pose;
    observers.emit(event);
  }
}

std::string previewOf(const grid::OccupancyMap& map, const metrics::Trajectory& trajectory) {
  gui_headless::RunRecorder recorder;
  Observers observers;
  observers.attach(recorder);
  emitTrajectory(trajectory, observers);
  gui_headless::Scene scene;
  scene.prior_maps = {&map};
  gui_headless::OverviewStyle style;
  style.width_px = kPreviewWidth_px;
  return gui_headless::renderOverview(recorder, scene, style);
}

std::string effectiveParticlesChart(
    const std::vector<pipeline::MapUpdate>& updates, int particles) {
  gui_headless::LineChart chart;
  chart.title = "Effective particles before resampling";
  chart.y_label = "Neff";
  gui_headless::Series series;
  series.name = "Neff of " + std::to_string(particles);
  // Stamps may run backwards; the chart follows the drive.
  double latest_s = 0.0;
  for (const pipeline::MapUpdate& u : updates) {
    latest_s = std::max(latest_s, toSeconds(u.stamp - updates.front().stamp));
    series.points.emplace_back(latest_s, u.report.effective_particles);
  }
  chart.series.push_back(std::move(series));
  return gui_headless::lineChart(chart);
}

void summarise(const pipeline::MapDriveResult& r, const pipeline::Config& config, Json& s) {
  std::size_t resampled = 0;
  std::size_t slips = 0;
  double neff = 0.0;
  for (const pipeline::MapUpdate& u : r.updates) {
    resampled += u.report.resampled ? 1U : 0U;
    slips += u.report.slipped ? 1U : 0U;
    neff += u.report.effective_particles;
  }
  s["scans"] = r.trajectory.size();
  s["scans_used"] = r.updates.size();
  s["data_s"] = rounded(r.data_s, 6);
  s["distance_m"] = rounded(r.distance_m, 4);
  s["particles"] = config.mapping.filter.particles;
  s["effective_particles_mean"] =
      rounded(neff / static_cast<double>(std::max<std::size_t>(r.updates.size(), 1)), 3);
  s["resamplings"] = resampled;
  s["odometry_contradicted"] = slips;
  s["patches_mb"] = rounded(static_cast<double>(r.patch_bytes) * 1e-6, 3);
  s["entropy_bit"] = rounded(r.quality.entropy_bit, 6);
  s["wall_thickness_m"] = rounded(r.quality.wall_thickness_m, 6);
  s["held_out"]["scans"] = r.quality.held_out_scans;
  s["held_out"]["log_likelihood_per_beam"] = rounded(r.quality.held_out_log_likelihood, 6);
  s["held_out"]["matched_share"] = rounded(r.quality.held_out_matched_share, 6);
  s["sessions"] = sessionsJson(r.sessions, r.frames);
  if (r.georeference) {
    s["georeference"] = georeferenceJson(*r.georeference);
    s["georeference"]["rms_m"] = rounded(r.georeference_rms_m, 4);
  }
  if (r.finished) {
    const mapping::FinishResult& f = *r.finished;
    Json& j = s["finish"];
    j["key_scans"] = f.keys.size();
    j["submaps"] = f.submaps;
    for (const auto verdict : mapping::kClosureVerdicts) {
      j["closures"][std::string(mapping::toString(verdict))] = f.count(verdict);
    }
    j["pairs"] = f.pairs;
    j["surface_rms_before_m"] = rounded(f.surface_rms_before_m, 6);
    j["surface_rms_after_m"] = rounded(f.surface_rms_after_m, 6);
    j["largest_correction_m"] = rounded(f.largest_correction_m, 4);
  }
  s["notes"] = r.notes;
}

void addFinish(const mapping::FinishResult& finished, gui_headless::ReportSection& section) {
  using mapping::ClosureVerdict;
  const std::size_t accepted = finished.count(ClosureVerdict::kAccepted);
  section.figures.push_back(figure("places recognised again", std::to_string(accepted)));
  section.figures.push_back(
      figure("... and refused", std::to_string(finished.closures.size() - accepted)));
  section.figures.push_back(figure(
      "distance of shared surfaces, RMS", fixed(1000.0 * finished.surface_rms_after_m, 1), "mm"));
  section.figures.push_back(
      figure("largest correction", fixed(finished.largest_correction_m, 2), "m"));
}

double contradictedShare(const mapping::SessionShare& s) {
  return static_cast<double>(s.walls_contradicted) /
         static_cast<double>(std::max<std::size_t>(s.walls_shared, 1));
}

}  // namespace

Json sessionsJson(const mapping::SessionCells& sessions, const std::vector<io::MapFrame>& frames) {
  Json list = Json::array();
  for (const mapping::SessionShare& share : sessions.shares) {
    Json j;
    j["session"] = share.session;
    j["scans"] = std::count_if(frames.begin(), frames.end(), [&](const io::MapFrame& f) {
      return f.session == share.session;
    });
    j["cells_seen"] = share.cells_seen;
    j["cells_alone"] = share.cells_alone;
    j["walls"] = share.walls;
    j["walls_shared"] = share.walls_shared;
    j["contradicted_share"] = rounded(contradictedShare(share), 6);
    list.push_back(std::move(j));
  }
  return list;
}

void saveSessions(
    const mapping::SessionCells& sessions, const grid::OccupancyMap& map, RunOutput& output) {
  io::saveLayer(
      output.stage("sessions.pgm"), map.width(), map.height(), sessions.wide(), [&](int iy) {
        return sessions.seenBy(map, iy);
      });
}

void addSessions(const mapping::SessionCells& sessions, gui_headless::ReportSection& section) {
  if (sessions.shares.size() < 2) return;
  for (const mapping::SessionShare& share : sessions.shares) {
    section.figures.push_back(figure(
        "session " + std::to_string(share.session) + ", walls that others contradict",
        fixed(100.0 * contradictedShare(share), 1),
        "%"));
  }
}

pipeline::Config mapConfig(const MapArguments& args) {
  pipeline::Config config = pipeline::loadConfig(args.config);
  if (!args.gmapping_params.empty()) {
    const auto names = loadParams<mapping::GmappingNames>(args.gmapping_params);
    config.mapping.gmapping = names;
    names.applyTo(config.mapping.filter);
  }
  if (args.seed) config.seed = *args.seed;
  if (args.particles) {
    config.mapping.filter.particles = *args.particles;
    if (config.mapping.gmapping.particles) config.mapping.gmapping.particles = *args.particles;
  }
  return config;
}

std::vector<io::MapFrame> earlierFrames(const MapArguments& args) {
  if (args.extend.empty()) return {};
  std::vector<io::MapFrame> frames = io::readSimpleMap(args.extend + "/map.simplemap");
  if (!args.cut) return frames;
  const auto kept = std::remove_if(
      frames.begin(), frames.end(), [&](const io::MapFrame& f) { return f.session == *args.cut; });
  if (kept == frames.end() || kept == frames.begin()) {
    throw ConfigError(
        "--cut " + std::to_string(*args.cut) + ": " +
        (kept == frames.end() ? "no such session in " : "the only session in ") + args.extend +
        " (its summary.json lists them)");
  }
  frames.erase(kept, frames.end());
  return frames;
}

std::pair<pipeline::MapDriveResult, gui_headless::ReportSection> runMap(
    const MapArguments& args, const pipeline::Config& config, RunOutput& output) {
  io::RecordingOptions recording;
  recording.rig = config.rig;
  recording.csv_mapping_dir = shipped("config/csv");
  const std::string particles = std::to_string(config.mapping.filter.particles);

  pipeline::MapDriveOptions options;
  options.journal = output.pathOf(kJournal);
  options.resume = args.resume;
  options.before = earlierFrames(args);
  options.T_map_base_init = args.init;
  options.georeference = args.georeference;
  options.finish = args.finish;
  options.preview_scans = static_cast<std::size_t>(args.preview_scans);
  options.preview = [&](const grid::OccupancyMap& map, const metrics::Trajectory& trajectory) {
    gui_headless::writeFile(output.pathOf("preview.png"), previewOf(map, trajectory));
  };
  double wall_s = 0.0;
  pipeline::MapDriveResult result = [&] {
    ProgressBar bar("map, " + particles + " particles");
    options.status = [&](double effective) {
      bar.setLabel("map, " + particles + " particles, Neff " + fixed(effective, 1));
    };
    options.finishing = [&] { bar.setLabel("finishing"); };
    auto r = pipeline::mapDrive(
        args.log, recording, options, config, output.observers(), bar.callback());
    wall_s = bar.wallSeconds();
    return r;
  }();
  for (const std::string& name : config.mapping.gmapping.withoutEffect()) {
    result.notes.push_back("gmapping: " + name + " has no counterpart here and no effect");
  }
  emitTrajectory(result.trajectory, output.observers());
  output.timing(wall_s, result.data_s);
  output.trajectory(result.trajectory);
  output.text("graph.g2o", result.graph_g2o);
  io::saveMapServer(
      result.map,
      output.stage("map.yaml"),
      output.stage("map.pgm"),
      "map.pgm",
      result.georeference);
  io::saveSimpleMap(output.stage("map.simplemap"), result.frames);
  saveSessions(result.sessions, result.map, output);
  Json& s = output.summary();
  s["input"] = args.log;
  summarise(result, config, s);
  result.frames = {};  // the pictures need the memory
  result.sessions.maps.clear();
  giveBackFreedMemory();

  gui_headless::Scene scene;
  scene.prior_maps = {&result.map};
  if (result.finished) {
    for (const mapping::Closure& c : result.finished->closures) {
      scene.closures.push_back(
          {{c.T_map_from.x, c.T_map_from.y},
           {c.T_map_to.x, c.T_map_to.y},
           c.verdict == mapping::ClosureVerdict::kAccepted});
    }
  }
  auto section = gui_headless::sectionFromRun(output.recorder(), scene, "Map by a particle filter");
  section.figures = {
      figure("scans", std::to_string(result.trajectory.size())),
      figure("scans used", std::to_string(result.updates.size())),
      figure("particles", particles),
      figure("path", fixed(result.distance_m, 1), "m"),
      figure("recording", fixed(result.data_s, 1), "s"),
      figure("speed", fixed(result.data_s / std::max(wall_s, 1e-3), 0), "x real time"),
      figure("entropy of a cell, mean", fixed(result.quality.entropy_bit, 4), "bit"),
      figure("walls, thickness", fixed(100.0 * result.quality.wall_thickness_m, 1), "cm"),
      figure(
          "held-out scans, log-likelihood per beam",
          fixed(result.quality.held_out_log_likelihood, 3)),
      figure(
          "held-out scans, beams on walls",
          fixed(100.0 * result.quality.held_out_matched_share, 1),
          "%"),
      figure(
          "scans that contradict the odometry", std::to_string(int{s["odometry_contradicted"]}))};
  if (result.georeference) {
    section.figures.push_back(
        figure("georeference, RMS of the fixes", fixed(result.georeference_rms_m, 2), "m"));
  }
  if (result.finished) addFinish(*result.finished, section);
  addSessions(result.sessions, section);
  section.charts.push_back(
      effectiveParticlesChart(result.updates, config.mapping.filter.particles));
  if (!section.pictures.empty()) output.picture("map.png", section.pictures.front().png);
  return {std::move(result), std::move(section)};
}

}  // namespace vestibule::app
