#include "vestibule/io/simple_map.hpp"

#include <mrpt/maps/CSimpleMap.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>

#include <cstdlib>

#include "mrpt_object.hpp"
#include "mrpt_scan.hpp"
#include "mrpt_time.hpp"

namespace vestibule::io {
namespace {

const std::string kLabel = "session ";

int sessionOf(const std::string& label) {
  if (label.compare(0, kLabel.size(), kLabel) != 0) return 1;
  const long number = std::strtol(label.c_str() + kLabel.size(), nullptr, 10);
  return number >= 1 && number <= 1000000 ? static_cast<int>(number) : 1;
}

}  // namespace

void saveSimpleMap(const std::string& path, const std::vector<MapFrame>& frames) {
  mrpt::maps::CSimpleMap map;
  for (const MapFrame& frame : frames) {
    auto observation = mrpt::obs::CObservation2DRangeScan::Create(toMrpt(frame.scan));
    observation->timestamp = toMrpt(frame.scan.stamp);
    observation->sensorLabel = kLabel + std::to_string(frame.session);
    auto sensory_frame = mrpt::obs::CSensoryFrame::Create();
    sensory_frame->insert(observation);
    auto pose = mrpt::poses::CPose3DPDFGaussian::Create();
    pose->mean = mrpt::poses::CPose3D(toPose3(frame.T_map_base));
    map.insert(pose, sensory_frame);
  }
  if (!map.saveToFile(path)) {
    throw InputError(path + ": cannot be written; check the folder and the disk");
  }
}

std::vector<MapFrame> readSimpleMap(const std::string& path) {
  mrpt::maps::CSimpleMap map;
  readMrptObject(path, map, "MRPT simple map");
  std::vector<MapFrame> frames;
  for (std::size_t i = 0; i < map.size(); ++i) {
    mrpt::poses::CPose3DPDF::Ptr pose;
    mrpt::obs::CSensoryFrame::Ptr sensory_frame;
    map.get(i, pose, sensory_frame);
    if (!pose || !sensory_frame) continue;
    const mrpt::poses::CPose3D mean = pose->getMeanVal();
    for (const auto& observation : *sensory_frame) {
      const auto* laser =
          dynamic_cast<const mrpt::obs::CObservation2DRangeScan*>(observation.get());
      if (laser == nullptr) continue;
      auto scan = fromMrpt(*laser);
      if (!scan) continue;
      frames.push_back(
          {{mean.x(), mean.y(), mean.yaw()}, std::move(*scan), sessionOf(laser->sensorLabel)});
    }
  }
  if (frames.empty()) {
    throw InputError(path + ": no laser scan in this map; give the map.simplemap of a map run");
  }
  return frames;
}

}  // namespace vestibule::io
