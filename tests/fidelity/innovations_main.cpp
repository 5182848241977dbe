// The picture and the table of docs/results.md that hold simulated recordings against real ones:
//   VESTIBULE_DATA=FOLDER innovations docs/images/innovations.png
// Without VESTIBULE_DATA only the recordings that Debian and the repository ship are compared.

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "real_and_simulated.hpp"

namespace {

/// The span of the single drives' medians, where there are several.
std::string mediansOf(const vestibule::test::Sample& sample) {
  if (sample.medians.size() < 2) return {};
  const auto [least, most] = std::minmax_element(sample.medians.begin(), sample.medians.end());
  char text[40];
  std::snprintf(text, sizeof text, " (%.2f to %.2f)", *least, *most);
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace vestibule::test;
  if (argc != 2) {
    std::fprintf(stderr, "usage: [VESTIBULE_DATA=FOLDER] innovations OUT.png\n");
    return 2;
  }
  try {
    std::optional<std::string> data;
    const char* folder = std::getenv("VESTIBULE_DATA");
    if (folder != nullptr && *folder != '\0') data = folder;
    const std::vector<Panel> panels = comparisons(data);
    std::printf(
        "| what | recording | values | 10 %% | median (of single drives) | 90 %% | 99 %% |\n");
    std::printf("| --- | --- | --- | --- | --- | --- | --- |\n");
    for (const Panel& panel : panels) {
      for (const Sample* sample : {&panel.real, &panel.simulated}) {
        std::printf(
            "| %s | %s | %zu | %.2f | %.2f%s | %.2f | %.2f |\n",
            panel.title.c_str(),
            sample->name.c_str(),
            sample->values.size(),
            quantile(sample->values, 0.1),
            quantile(sample->values, 0.5),
            mediansOf(*sample).c_str(),
            quantile(sample->values, 0.9),
            quantile(sample->values, 0.99));
      }
    }
    drawPanels(panels, argv[1]);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
  return 0;
}
