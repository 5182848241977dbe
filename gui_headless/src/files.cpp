#include <cstdio>
#include <filesystem>
#include <fstream>

#include "vestibule/core/errors.hpp"
#include "vestibule/gui_headless/overview.hpp"
#include "vestibule/gui_headless/report.hpp"

namespace vestibule::gui_headless {

void writeFile(const std::string& path, const std::string& bytes) {
  const std::string unfinished = path + ".part";
  {
    std::ofstream out(unfinished, std::ios::binary | std::ios::trunc);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    out.flush();
    if (!out) {
      std::remove(unfinished.c_str());
      throw InputError(path + ": cannot be written; check the folder, its rights and free space");
    }
  }
  std::error_code error;
  std::filesystem::rename(unfinished, path, error);
  if (error) {
    std::remove(unfinished.c_str());
    throw InputError(path + ": cannot be written: " + error.message());
  }
}

Picture pictureFromFile(const std::string& path, const std::string& caption) {
  std::ifstream in(path, std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  if (!in || bytes.empty()) {
    throw InputError(path + ": picture cannot be read; it should be a PNG file");
  }
  return {caption, std::move(bytes)};
}

}  // namespace vestibule::gui_headless
