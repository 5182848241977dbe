#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "reference.hpp"
#include "text.hpp"
#include "vestibule/core/angles.hpp"
#include "vestibule/gui_headless/charts.hpp"
#include "vestibule/gui_headless/filmstrip.hpp"
#include "vestibule/gui_headless/report.hpp"

namespace vestibule::gui_headless {
namespace {

// 95 % of a planar Gaussian lies within this many standard deviations (chi-square, 2 dof: 5.991).
constexpr double kSigmas95 = 2.4477;

/// Everything over the time since the start of the run.
struct Errors {
  std::vector<std::pair<double, double>> position_m;
  std::vector<std::pair<double, double>> yaw_deg;
};

struct Spread {
  double rmse = 0.0;
  double worst = 0.0;
};
Spread spreadOf(const std::vector<std::pair<double, double>>& points) {
  Spread spread;
  for (const auto& p : points) {
    spread.rmse += p.second * p.second;
    spread.worst = std::max(spread.worst, std::abs(p.second));
  }
  if (!points.empty()) spread.rmse = std::sqrt(spread.rmse / static_cast<double>(points.size()));
  return spread;
}

class SectionBuilder {
 public:
  SectionBuilder(const RunRecorder& run, const Scene& scene)
      : run_(run), poses_(run.primaryPoses()) {
    if (run.span()) {
      start_ = run.span()->first;
      duration_s_ = toSeconds(run.span()->second - start_);
    }
    for (const ModeSpan& span : modeSpans(run)) {
      bands_.push_back({since(span.from), since(span.to), span.mode, span.reason});
    }
    const StampedPoses reference = referenceOf(run, scene);
    for (const PoseSample& sample : poses_) {
      const auto truth = referenceAt(reference, sample.stamp);
      if (!truth) continue;
      const double t = since(sample.stamp);
      errors_.position_m.emplace_back(t, distance(sample.T.mean, *truth));
      errors_.yaw_deg.emplace_back(t, radToDeg(angleDiff(sample.T.mean.phi, truth->phi)));
    }
    if (scene.site != nullptr) {
      for (const DoorCrossing& crossing : doorCrossings(poses_, *scene.site)) {
        doors_.push_back({since(crossing.stamp), crossing.door});
      }
    }
  }

  [[nodiscard]] std::vector<Figure> highlights() const {
    std::vector<Figure> tiles;
    tiles.push_back(durationTile());
    tiles.push_back(plain("Distance", fixed(run_.distanceTravelled(), 1), "m"));
    if (!errors_.position_m.empty()) {
      const Spread position = spreadOf(errors_.position_m);
      const Spread yaw = spreadOf(errors_.yaw_deg);
      Figure rmse = plain("Position RMSE", fixed(position.rmse, 3), "m");
      rmse.note = "max " + fixed(position.worst, 3) + " m";
      Figure turn = plain("Yaw RMSE", fixed(yaw.rmse, 2), "\u00b0");
      turn.note = "max " + fixed(yaw.worst, 2) + "\u00b0";
      tiles.push_back(rmse);
      tiles.push_back(turn);
    }
    std::size_t accepted = 0;
    std::size_t offered = 0;
    for (const auto& [name, sensor] : run_.updates()) {
      accepted += sensor.count(Decision::kAccepted) + sensor.count(Decision::kDownWeighted);
      offered += sensor.total();
    }
    if (offered > 0) {
      Figure updates = plain("Updates used", grouped(accepted), "");
      updates.note = "of " + grouped(offered) + " offered";
      tiles.push_back(updates);
    }
    if (!run_.modeEvents().empty() || !doors_.empty()) {
      std::size_t switches = 0;
      for (const ModeEvent& e : run_.modeEvents()) switches += e.from != e.to ? 1U : 0U;
      Figure changes = plain("Mode changes", grouped(switches), "");
      if (!doors_.empty()) changes.note = grouped(doors_.size()) + " door crossings";
      tiles.push_back(changes);
    }
    if (!run_.warnings().empty()) {
      std::size_t count = 0;
      for (const WarningSummary& warning : run_.warnings()) count += warning.count;
      Figure warnings = plain("Warnings", grouped(count), "");
      warnings.note = grouped(run_.warnings().size()) + " different";
      tiles.push_back(warnings);
    }
    return tiles;
  }

  [[nodiscard]] std::vector<std::string> charts() const {
    std::vector<std::string> charts;
    if (run_.span()) charts.push_back(timelineChart());
    if (!errors_.position_m.empty()) {
      charts.push_back(positionErrorChart());
      charts.push_back(yawErrorChart());
    } else if (auto bound = claimedBound(); !bound.empty()) {
      LineChart chart = timeChart("Claimed position uncertainty", "95 % radius [m]");
      chart.series.push_back({"95 % of position, long axis", SeriesLook::kBound, std::move(bound)});
      charts.push_back(lineChart(chart));
    }
    if (!run_.particleSamples().empty()) {
      charts.push_back(particleTrustChart());
      charts.push_back(particleSpreadChart());
      charts.push_back(particleCountChart());
    }
    for (const auto& [name, sensor] : run_.updates()) {
      if (auto chart = nisChart(name, sensor)) charts.push_back(*chart);
    }
    return charts;
  }

  [[nodiscard]] std::vector<Table> tables() const {
    std::vector<Table> tables;
    if (!run_.updates().empty()) tables.push_back(updateTable());
    if (!run_.modeEvents().empty()) tables.push_back(modeTable());
    if (!run_.mapEvents().empty()) tables.push_back(mapTable());
    if (!run_.missionEvents().empty()) tables.push_back(missionTable());
    if (!run_.warnings().empty()) tables.push_back(warningTable());
    return tables;
  }

 private:
  [[nodiscard]] double since(Timestamp stamp) const { return toSeconds(stamp - start_); }

  static Figure plain(const std::string& label, const std::string& value, const std::string& unit) {
    return {label, value, unit, "", Figure::Verdict::kNone, ""};
  }

  template <class Value>
  [[nodiscard]] std::vector<std::pair<double, double>> overTime(const Value& value) const {
    std::vector<std::pair<double, double>> points;
    for (const ParticleSample& sample : run_.particleSamples()) {
      points.emplace_back(since(sample.stamp), value(sample));
    }
    return points;
  }
  [[nodiscard]] std::string particleTrustChart() const {
    LineChart chart = timeChart("Trust in the particles", "share");
    chart.share = true;
    chart.series.push_back(
        {"beams on mapped obstacles", SeriesLook::kEstimate, overTime([](const ParticleSample& s) {
           return s.inlier_share;
         })});
    chart.series.push_back(
        {"probability of being lost", SeriesLook::kSecond, overTime([](const ParticleSample& s) {
           return s.lost_probability;
         })});
    return lineChart(chart);
  }
  [[nodiscard]] std::string particleSpreadChart() const {
    LineChart chart = timeChart("Spread of the particles", "one sigma [m]");
    chart.series.push_back(
        {"position", SeriesLook::kEstimate, overTime([](const ParticleSample& s) {
           return s.spread_m;
         })});
    return lineChart(chart);
  }
  [[nodiscard]] std::string particleCountChart() const {
    LineChart chart = timeChart("Number of particles", "particles");
    chart.series.push_back(
        {"particles", SeriesLook::kEstimate, overTime([](const ParticleSample& s) {
           return static_cast<double>(s.count);
         })});
    return lineChart(chart);
  }

  [[nodiscard]] Figure durationTile() const {
    if (duration_s_ < 120.0) return plain("Duration", fixed(duration_s_, 1), "s");
    const auto whole = static_cast<long long>(std::llround(duration_s_));
    const bool hours = whole >= 3600;
    const auto big = hours ? whole / 3600 : whole / 60;
    const auto small = hours ? whole / 60 % 60 : whole % 60;
    const std::string digits = (small < 10 ? "0" : "") + std::to_string(small);
    return plain("Duration", std::to_string(big) + ":" + digits, hours ? "h" : "min");
  }

  [[nodiscard]] LineChart timeChart(const std::string& title, const std::string& y_label) const {
    LineChart chart;
    chart.title = title;
    chart.y_label = y_label;
    chart.bands = bands_;
    chart.markers = doors_;
    return chart;
  }

  /// Long half axis of the claimed 95 % ellipse; empty when the run carries no covariances.
  [[nodiscard]] std::vector<std::pair<double, double>> claimedBound() const {
    std::vector<std::pair<double, double>> bound;
    bool any = false;
    for (const PoseSample& sample : poses_) {
      const Eigen::Matrix2d cov = sample.T.cov.topLeftCorner<2, 2>();
      double radius = std::numeric_limits<double>::quiet_NaN();
      if (cov.allFinite()) {
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(cov, Eigen::EigenvaluesOnly);
        radius = kSigmas95 * std::sqrt(std::max(0.0, eigen.eigenvalues()(1)));
      }
      any = any || radius > 0.0;
      bound.emplace_back(since(sample.stamp), radius);
    }
    if (!any) bound.clear();
    return bound;
  }

  [[nodiscard]] std::string timelineChart() const {
    ModeTimeline timeline;
    timeline.title = "Mode over time";
    timeline.to = duration_s_;
    timeline.bands = bands_;
    timeline.ticks = doors_;
    for (const MissionEvent& event : run_.missionEvents()) {
      if (event.kind == MissionEvent::Kind::kWaypointReached) {
        timeline.ticks.push_back({since(event.stamp), event.waypoint});
      }
    }
    std::stable_sort(
        timeline.ticks.begin(), timeline.ticks.end(), [](const auto& a, const auto& b) {
          return a.x < b.x;
        });
    return modeTimeline(timeline);
  }

  [[nodiscard]] std::string positionErrorChart() const {
    LineChart chart = timeChart("Position error", "error [m]");
    chart.series.push_back({"error", SeriesLook::kEstimate, errors_.position_m});
    auto bound = claimedBound();
    if (!bound.empty()) {
      // A filter that is very unsure for a moment must not flatten the error it is compared with.
      const double top = 4.0 * std::max(0.05, spreadOf(errors_.position_m).worst);
      for (auto& p : bound) p.second = std::min(p.second, top);
      chart.series.push_back({"claimed 95 %", SeriesLook::kBound, std::move(bound)});
    }
    return lineChart(chart);
  }

  [[nodiscard]] std::string yawErrorChart() const {
    LineChart chart = timeChart("Yaw error", "error [deg]");
    chart.series.push_back({"error", SeriesLook::kEstimate, errors_.yaw_deg});
    return lineChart(chart);
  }

  [[nodiscard]] static std::optional<std::string> nisChart(
      const std::string& name, const SensorUpdates& sensor) {
    const auto& samples = sensor.samples.kept;
    if (samples.empty()) return std::nullopt;
    Histogram chart;
    chart.title = "Normalised innovation squared: " + name;
    chart.x_label = "NIS (the last bar holds all larger values)";
    chart.dof = samples.front().dof;
    for (const NisSample& sample : samples) {
      chart.values.push_back(sample.nis);
      if (sample.dof != samples.front().dof) chart.dof.reset();
    }
    return histogram(chart);
  }

  [[nodiscard]] Table updateTable() const {
    Table table{
        "Updates per sensor",
        {"sensor",
         "offered",
         "accepted",
         "down-weighted",
         "gated",
         "rejected",
         "mean NIS / dof",
         "reasons"},
        {}};
    for (const auto& [name, sensor] : run_.updates()) {
      double ratio = 0.0;
      for (const NisSample& sample : sensor.samples.kept) ratio += sample.nis / sample.dof;
      const std::size_t n = sensor.samples.kept.size();
      std::string reasons;
      for (const auto& [reason, count] : sensor.refusals) {
        if (!reasons.empty()) reasons += ", ";
        reasons += (reason.empty() ? "unnamed" : reason) + " " + grouped(count);
      }
      table.rows.push_back(
          {name,
           grouped(sensor.total()),
           grouped(sensor.count(Decision::kAccepted)),
           grouped(sensor.count(Decision::kDownWeighted)),
           grouped(sensor.count(Decision::kGated)),
           grouped(sensor.count(Decision::kRejected)),
           n > 0 ? fixed(ratio / static_cast<double>(n), 2) : "-",
           reasons});
    }
    return table;
  }

  [[nodiscard]] Table modeTable() const {
    Table table{"Mode changes", {"t [s]", "from", "to", "reason", "numbers"}, {}};
    for (const ModeEvent& event : run_.modeEvents()) {
      std::string numbers;
      for (const auto& [name, value] : event.values) {
        if (!numbers.empty()) numbers += ", ";
        numbers += name + " " + compact(value, 3);
      }
      table.rows.push_back(
          {fixed(since(event.stamp), 1),
           modeName(event.from),
           modeName(event.to),
           event.reason,
           numbers});
    }
    return table;
  }

  [[nodiscard]] Table mapTable() const {
    Table table{"Indoor maps", {"t [s]", "event", "map", "distance [m]"}, {}};
    for (const MapEvent& event : run_.mapEvents()) {
      table.rows.push_back(
          {fixed(since(event.stamp), 1),
           std::string(toString(event.kind)),
           event.map,
           fixed(event.distance_m, 1)});
    }
    return table;
  }

  [[nodiscard]] Table missionTable() const {
    Table table{"Mission", {"t [s]", "event", "path", "waypoint", "detail"}, {}};
    for (const MissionEvent& event : run_.missionEvents()) {
      std::string kind(toString(event.kind));
      std::replace(kind.begin(), kind.end(), '_', ' ');
      table.rows.push_back(
          {fixed(since(event.stamp), 1), kind, event.path, event.waypoint, event.text});
    }
    return table;
  }

  [[nodiscard]] Table warningTable() const {
    Table table{
        "Warnings", {"first [s]", "last [s]", "times", "component", "text", "value", "limit"}, {}};
    for (const WarningSummary& warning : run_.warnings()) {
      table.rows.push_back(
          {fixed(since(warning.first), 1),
           fixed(since(warning.last), 1),
           grouped(warning.count),
           warning.component,
           warning.text,
           compact(warning.value, 3),
           compact(warning.limit, 3)});
    }
    return table;
  }

  const RunRecorder& run_;
  std::vector<PoseSample> poses_;
  Timestamp start_;
  double duration_s_ = 0.0;
  std::vector<ModeBand> bands_;
  std::vector<ChartMarker> doors_;
  Errors errors_;
};

}  // namespace

ReportSection sectionFromRun(
    const RunRecorder& run,
    const Scene& scene,
    const std::string& title,
    const OverviewStyle& style) {
  const SectionBuilder builder(run, scene);
  ReportSection section;
  section.title = title;
  section.highlights = builder.highlights();
  section.pictures.push_back(
      {"Overview: estimate coloured by mode, north is up.", renderOverview(run, scene, style)});
  if (std::string strip = renderFilmstrip(run, scene); !strip.empty()) {
    section.pictures.push_back(
        {"Particles over time; red: beams that ended on things which are not in the map.",
         std::move(strip)});
  }
  section.charts = builder.charts();
  section.tables = builder.tables();
  if (run.eventsNotKept() > 0) {
    section.text = "The tables below leave out " + grouped(run.eventsNotKept()) +
                   " further events of a run that had very many.";
  }
  return section;
}

}  // namespace vestibule::gui_headless
