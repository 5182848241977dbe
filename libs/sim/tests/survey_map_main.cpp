// Makes the prior map of a world from its `given_maps` section:
//   survey_map config/worlds/farm.yaml maps/farm/stable
// writes maps/farm/stable.pgm and maps/farm/stable.yaml.

#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "map_picture.hpp"
#include "vestibule/sim/given_map.hpp"

int main(int argc, char** argv) {
  if (argc != 3 && argc != 4) {
    std::fprintf(stderr, "usage: survey_map WORLD.yaml OUT_WITHOUT_EXTENSION [GIVEN_MAP]\n");
    return 2;
  }
  try {
    const auto world = vestibule::sim::loadWorld(argv[1]);
    const auto& given = vestibule::sim::givenMapOf(world, argc == 4 ? argv[3] : "");
    const auto map = vestibule::sim::surveyMap(world, given);
    const std::filesystem::path out = argv[2];
    cv::imwrite(out.string() + ".pgm", vestibule::sim::mapPicture(map));
    const auto origin = vestibule::sim::mapOrigin(map, given.T_map_grid);
    char line[100];
    std::snprintf(line, sizeof line, "origin: [%.3f, %.3f, 0.0]\n", origin.x, origin.y);
    std::ofstream(out.string() + ".yaml")
        << "# Prior map " << given.name << ", made by libs/sim/tests/survey_map_main.cpp from "
        << std::filesystem::path(argv[1]).filename().string() << ".\n"
        << "image: " << out.filename().string() << ".pgm\n"
        << "mode: trinary\n"
        << "resolution: " << map.resolution() << "\n"
        << line << "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
  return 0;
}
