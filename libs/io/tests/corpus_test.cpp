#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string_view>

#include "targets.hpp"
#include "temp_files.hpp"
#include "vestibule/core/random.hpp"

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
/// Bytes changed, doubled, left out and lines swapped, as broken disks and careless editing do it.
TEST(Corpus, CarmenWithAnyDamageIsSurvived) {
  const std::filesystem::path folder =
      std::filesystem::path(VESTIBULE_SOURCE_DIR) / "libs/io/fuzz/corpus/carmen";
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  ASSERT_GE(files.size(), 5U);
  constexpr std::string_view kNasty[] = {
      "nan", "-1e308", "99999999999999999999", "-", "\t", "\r\n", "FLASER", "1e-400", "0x10"};
  RandomStream random(1, "damage");
  for (const std::string& file : files) {
    const std::string good = readFile(file);
    for (int round = 0; round < 200; ++round) {
      std::string bytes = good;
      for (std::uint32_t k = 1 + random() % 4; k > 0 && !bytes.empty(); --k) {
        const std::size_t at = random() % bytes.size();
        const std::size_t n = random() % 40;
        switch (random() % 5) {
          case 0:
            bytes[at] = static_cast<char>(random() % 256);
            break;
          case 1:
            bytes.erase(at, n);
            break;
          case 2:
            bytes.insert(at, bytes.substr(random() % bytes.size(), n));
            break;
          case 3:
            bytes.insert(at, kNasty[random() % std::size(kNasty)]);
            break;
          default:
            bytes.resize(at);
            break;
        }
      }
      EXPECT_NO_THROW(fuzz::readCarmen(bytes)) << file << " round " << round;
    }
  }
}

TEST(Corpus, WhatComesBeforeTheDamageIsRead) {
  std::string line = "FLASER 3 1 2 3 0 0 0 0 0 0 ";
  std::string log;
  for (int i = 0; i < 20; ++i) log += line + std::to_string(i) + ".5 host 0.5\n";
  const auto path = writeFile(testFolder() / "a.log", log + line.substr(0, 12));
  const auto reader = openRecording(path, {});
  int scans = 0;
  std::string complaint;
  try {
    while (const auto record = reader->next()) {
      scans += std::holds_alternative<LaserScan>(record->measurement) ? 1 : 0;
    }
  } catch (const InputError& e) {
    complaint = e.what();
  }
  EXPECT_EQ(scans, 20);
  EXPECT_NE(complaint.find("a.log:21: FLASER line has"), std::string::npos) << complaint;
}

TEST(Corpus, Csv) { feed("csv", fuzz::readCsv); }
TEST(Corpus, Cdr) { feed("cdr", fuzz::readCdr); }
TEST(Corpus, Pgm) { feed("pgm", fuzz::readPgm); }
TEST(Corpus, WeanMap) { feed("wean_map", fuzz::readWeanMapBytes); }
TEST(Corpus, MapYaml) { feed("map_yaml", fuzz::readMapYaml); }

}  // namespace
}  // namespace vestibule::io
