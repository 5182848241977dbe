#include <gtest/gtest.h>

#include <filesystem>

#include "targets.hpp"
#include "temp_files.hpp"

namespace vestibule::io {
namespace {

/// Every file of a corpus goes through its parser; anything but success or a complaint of our own
/// types fails the test.
void feed(const std::string& name, void (*parser)(const std::string&)) {
  const std::filesystem::path folder =
      std::filesystem::path(VESTIBULE_SOURCE_DIR) / "libs/io/fuzz/corpus" / name;
  int n = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string bytes = readFile(entry.path());
    EXPECT_NO_THROW(parser(bytes)) << entry.path();
    // A file may also end anywhere.
    for (std::size_t size = 0; size < bytes.size(); size += 1 + bytes.size() / 40) {
      EXPECT_NO_THROW(parser(bytes.substr(0, size))) << entry.path() << " cut at " << size;
    }
    ++n;
  }
  EXPECT_GE(n, 5) << "corpus missing: " << folder;
}

TEST(Corpus, Carmen) { feed("carmen", fuzz::readCarmen); }
TEST(Corpus, Csv) { feed("csv", fuzz::readCsv); }
TEST(Corpus, Cdr) { feed("cdr", fuzz::readCdr); }
TEST(Corpus, WeanMap) { feed("wean_map", fuzz::readWeanMapBytes); }
TEST(Corpus, MapYaml) { feed("map_yaml", fuzz::readMapYaml); }

}  // namespace
}  // namespace vestibule::io
