#include "vestibule/pipeline/map.hpp"

#include "vestibule/core/errors.hpp"

namespace vestibule::pipeline {

MapResult mapFromKnownPoses(
    const std::string& recording_path,
    const io::RecordingOptions& recording_options,
    const Config& config,
    const Observers& observers,
    const Progress& progress) {
  const auto reader = io::openRecording(recording_path, recording_options);
  mapping::KnownPosesMapper mapper(config.mapping.known_poses);
  metrics::Trajectory trajectory;
  double distance_m = 0.0;
  while (const auto record = reader->next()) {
    const auto* scan = std::get_if<LaserScan>(&record->measurement);
    if (scan == nullptr) continue;
    if (!scan->T_log_base) {
      throw InputError(
          recording_path + ": record " + std::to_string(record->number) +
          ": the scan carries no robot pose; --known-poses needs a log of corrected poses (CARMEN "
          "FLASER or ROBOTLASER1)");
    }
    mapper.add(*scan->T_log_base, *scan);
    if (!trajectory.empty()) distance_m += distance(trajectory.back().pose, *scan->T_log_base);
    trajectory.push_back({scan->stamp, *scan->T_log_base});
    PoseEvent event;
    event.stamp = scan->stamp;
    event.source = PoseSource::kPublished;
    event.mode = Mode::kIndoor;
    event.T.mean = *scan->T_log_base;
    observers.emit(event);
    progress(reader->progress(), toSeconds(scan->stamp - trajectory.front().stamp));
  }
  if (trajectory.empty()) {
    throw InputError(recording_path + ": no laser scan in it, nothing to map (see vestibule info)");
  }
  return {mapper.build(), std::move(trajectory), distance_m, reader->notes()};
}

}  // namespace vestibule::pipeline
