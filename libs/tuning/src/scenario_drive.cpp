#include "scenario_drive.hpp"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <utility>

#include "vestibule/core/errors.hpp"
#include "vestibule/io/rawlog_writer.hpp"

namespace vestibule::tuning {
namespace {

constexpr Duration kTick = std::chrono::milliseconds(100);

}  // namespace

ScenarioDrive driveScenario(const sim::Scenario& scenario, std::uint64_t seed) {
  ScenarioDrive drive;
  sim::ScenarioRun run(scenario, seed);
  while (!run.finished()) {
    for (sim::Delivered& d : run.step(kTick))
      drive.measurements.push_back(std::move(d.measurement));
    drive.truth.push_back({run.simulator().time(), run.simulator().truth()});
    (void)run.simulator().takeSweeps();
  }
  return drive;
}

TemporaryRecording::TemporaryRecording(const std::vector<Measurement>& measurements) {
  std::error_code ec;
  path_ = (std::filesystem::temp_directory_path(ec) / "vestibule-XXXXXX.rawlog").string();
  const int file = mkstemps(path_.data(), 7);
  if (file < 0) {
    throw InputError(path_ + ": no temporary file can be made (set TMPDIR to a folder with room)");
  }
  close(file);
  io::RawlogWriter writer(path_);
  for (const Measurement& m : measurements) writer.write(m, io::labelOf(m));
  writer.close();
}

TemporaryRecording::~TemporaryRecording() {
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

}  // namespace vestibule::tuning
