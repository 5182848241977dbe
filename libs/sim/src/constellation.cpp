#include "vestibule/sim/constellation.hpp"

#include <cmath>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::sim {
namespace {

constexpr double kEarthGravity = 3.986004418e14;  // m^3/s^2
constexpr double kEarthRate_radps = 7.2921151e-5;
constexpr double kEarthRadius_m = 6371.0e3;  // a sphere does for directions
constexpr double kGeostationary_m = 42164.0e3;

struct Walker {
  int satellites;
  int planes;
  double inclination_deg;
  double radius_m;
};
constexpr Walker kWalkers[] = {
    {30, 6, 55.0, 26560.0e3}, {24, 3, 64.8, 25510.0e3}, {24, 3, 56.0, 29600.0e3}};

}  // namespace

Constellation::Constellation(const Geodetic& datum, std::uint64_t seed)
    : lat_rad_(degToRad(datum.lat_deg)), lon_rad_(degToRad(datum.lon_deg)) {
  RandomStream random(seed, "constellation");
  for (const Walker& walker : kWalkers) {
    const double node_rad = random.uniform(0.0, 2.0 * kPi);
    const double phase_rad = random.uniform(0.0, 2.0 * kPi);
    const int per_plane = walker.satellites / walker.planes;
    for (int plane = 0; plane < walker.planes; ++plane) {
      for (int slot = 0; slot < per_plane; ++slot) {
        orbits_.push_back(
            {walker.radius_m,
             degToRad(walker.inclination_deg),
             node_rad + 2.0 * kPi * plane / walker.planes,
             phase_rad + 2.0 * kPi * slot / per_plane + 2.0 * kPi * plane / walker.satellites});
      }
    }
  }
}

std::vector<SkyPosition> Constellation::at(Timestamp stamp) const {
  // Seconds of a fixed era keep the angles small enough for full precision.
  const double t_s = toSeconds(stamp - Timestamp{1'600'000'000'000'000'000});
  const double east_x = -std::sin(lon_rad_);
  const double east_y = std::cos(lon_rad_);
  const double up_x = std::cos(lat_rad_) * std::cos(lon_rad_);
  const double up_y = std::cos(lat_rad_) * std::sin(lon_rad_);
  const double up_z = std::sin(lat_rad_);
  const auto look = [&](double x, double y, double z) {
    const double dx = x - kEarthRadius_m * up_x;
    const double dy = y - kEarthRadius_m * up_y;
    const double dz = z - kEarthRadius_m * up_z;
    const double east = dx * east_x + dy * east_y;
    const double north =
        -dx * up_z * std::cos(lon_rad_) - dy * up_z * std::sin(lon_rad_) + dz * std::cos(lat_rad_);
    const double up = dx * up_x + dy * up_y + dz * up_z;
    return SkyPosition{std::atan2(north, east), std::atan2(up, std::hypot(east, north)), false};
  };
  std::vector<SkyPosition> sky;
  sky.reserve(size());
  for (const Orbit& orbit : orbits_) {
    const double rate = std::sqrt(kEarthGravity / std::pow(orbit.radius_m, 3.0));
    const double u = orbit.phase_rad + rate * t_s;
    const double node = orbit.node_rad - kEarthRate_radps * t_s;  // Earth-fixed
    const double in_plane_x = orbit.radius_m * std::cos(u);
    const double in_plane_y = orbit.radius_m * std::sin(u) * std::cos(orbit.inclination_rad);
    sky.push_back(look(
        in_plane_x * std::cos(node) - in_plane_y * std::sin(node),
        in_plane_x * std::sin(node) + in_plane_y * std::cos(node),
        orbit.radius_m * std::sin(u) * std::sin(orbit.inclination_rad)));
  }
  SkyPosition fixed =
      look(kGeostationary_m * std::cos(lon_rad_), kGeostationary_m * std::sin(lon_rad_), 0.0);
  fixed.geostationary = true;
  sky.push_back(fixed);
  return sky;
}

}  // namespace vestibule::sim
