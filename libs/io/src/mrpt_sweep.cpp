#include "mrpt_sweep.hpp"

#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/obs/CObservationPointCloud.h>
#include <mrpt/obs/CObservationVelodyneScan.h>

#include "mrpt_time.hpp"

namespace vestibule::io {
namespace {

void addPoints(
    const std::vector<float>& xs,
    const std::vector<float>& ys,
    const std::vector<float>& zs,
    LidarSweep& sweep) {
  sweep.points.reserve(xs.size());
  for (std::size_t i = 0; i < xs.size(); ++i) {
    LidarSweep::Point point;
    point.p_laser = {xs[i], ys[i], zs[i]};
    sweep.points.push_back(point);
  }
}

LidarSweep sweepOf(const mrpt::obs::CObservationVelodyneScan& scan) {
  // Points are made from the raw packets, in a copy: generatePointCloud() fills the object.
  mrpt::obs::CObservationVelodyneScan copy = scan;
  if (copy.point_cloud.x.empty()) copy.generatePointCloud();
  LidarSweep sweep;
  addPoints(copy.point_cloud.x, copy.point_cloud.y, copy.point_cloud.z, sweep);
  sweep.T_base_laser = scan.sensorPose.asTPose();
  return sweep;
}

LidarSweep sweepOf(const mrpt::obs::CObservationPointCloud& cloud) {
  LidarSweep sweep;
  sweep.T_base_laser = cloud.sensorPose.asTPose();
  if (!cloud.pointcloud) return sweep;
  const mrpt::maps::CPointsMap& points = *cloud.pointcloud;
  sweep.points.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    LidarSweep::Point point;
    points.getPoint(i, point.p_laser.x(), point.p_laser.y(), point.p_laser.z());
    sweep.points.push_back(point);
  }
  return sweep;
}

}  // namespace

std::optional<LidarSweep> sweepOf(const mrpt::obs::CObservation& observation) {
  std::optional<LidarSweep> sweep;
  if (const auto* scan = dynamic_cast<const mrpt::obs::CObservationVelodyneScan*>(&observation)) {
    sweep = sweepOf(*scan);
  } else if (
      const auto* cloud = dynamic_cast<const mrpt::obs::CObservationPointCloud*>(&observation)) {
    sweep = sweepOf(*cloud);
  }
  if (sweep) sweep->stamp = fromMrpt(observation.timestamp);
  return sweep;
}

mrpt::obs::CObservationPointCloud cloudOf(const LidarSweep& sweep) {
  mrpt::obs::CObservationPointCloud cloud;
  cloud.sensorPose = mrpt::poses::CPose3D(sweep.T_base_laser);
  auto points = mrpt::maps::CSimplePointsMap::Create();
  points->reserve(sweep.points.size());
  for (const LidarSweep::Point& p : sweep.points) {
    points->insertPoint(p.p_laser.x(), p.p_laser.y(), p.p_laser.z());
  }
  cloud.pointcloud = points;
  return cloud;
}

}  // namespace vestibule::io
