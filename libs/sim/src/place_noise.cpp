#include "vestibule/sim/place_noise.hpp"

#include <cmath>

#include "vestibule/core/random.hpp"

namespace vestibule::sim {
namespace {

std::uint64_t latticeHash(std::uint64_t seed, int component, std::int64_t ix, std::int64_t iy) {
  const auto words = philox4x32(
      {static_cast<std::uint32_t>(ix),
       static_cast<std::uint32_t>(iy),
       static_cast<std::uint32_t>(component),
       0x706C6163U},
      {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U)});
  return (static_cast<std::uint64_t>(words[1]) << 32U) | words[0];
}

double latticeNormal(std::uint64_t seed, int component, std::int64_t ix, std::int64_t iy) {
  return RandomStream(latticeHash(seed, component, ix, iy), "place").normal();
}

}  // namespace

double placeNoise(std::uint64_t seed, int component, const Point2& p_map, double length_m) {
  const double fx = std::floor(p_map.x / length_m);
  const double fy = std::floor(p_map.y / length_m);
  const auto ix = static_cast<std::int64_t>(fx);
  const auto iy = static_cast<std::int64_t>(fy);
  const auto smooth = [](double s) { return s * s * (3.0 - 2.0 * s); };
  const double sx = smooth(p_map.x / length_m - fx);
  const double sy = smooth(p_map.y / length_m - fy);
  double sum = 0.0;
  double weight2 = 0.0;
  for (const int jx : {0, 1}) {
    for (const int jy : {0, 1}) {
      const double weight = (jx == 0 ? 1.0 - sx : sx) * (jy == 0 ? 1.0 - sy : sy);
      sum += weight * latticeNormal(seed, component, ix + jx, iy + jy);
      weight2 += weight * weight;
    }
  }
  return sum / std::sqrt(weight2);  // the blend alone would be weaker between lattice points
}

double placeUniform(std::uint64_t seed, int component, const Point2& p_map, double length_m) {
  const auto ix = static_cast<std::int64_t>(std::floor(p_map.x / length_m));
  const auto iy = static_cast<std::int64_t>(std::floor(p_map.y / length_m));
  return RandomStream(latticeHash(seed, component, ix, iy), "place").uniform();
}

}  // namespace vestibule::sim
