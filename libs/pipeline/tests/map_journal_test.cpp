#include "map_journal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "test_files.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule::pipeline {
namespace {

mapping::Generation generation(std::size_t scan) {
  mapping::Generation g;
  g.scan = scan;
  g.report.used = true;
  g.report.effective_particles = 1.5 + static_cast<double>(scan);
  g.report.slipped = scan % 2 == 1;
  for (std::uint32_t i = 0; i < 3; ++i) {
    g.parents.push_back(2 - i);
    g.poses.push_back({0.1 * i, static_cast<double>(scan), -0.3});
    g.log_weights.push_back(-1.0 * i);
    g.scores.push_back(7.0);
  }
  return g;
}

void write(const std::string& path, std::size_t count) {
  MapJournal journal(path, 42, 3, false);
  for (std::size_t k = 0; k < count; ++k) journal.append(generation(k));
}

TEST(MapJournal, GivesBackWhatWasAppended) {
  const test::TempFolder folder;
  const std::string path = folder / "map.journal";
  write(path, 5);
  MapJournal journal(path, 42, 3, true);
  const auto recorded = journal.takeRecorded();
  ASSERT_EQ(recorded.size(), 5U);
  const mapping::Generation expected = generation(3);
  EXPECT_EQ(recorded[3].scan, 3U);
  EXPECT_EQ(recorded[3].parents, expected.parents);
  EXPECT_EQ(recorded[3].poses[2].x, expected.poses[2].x);
  EXPECT_EQ(recorded[3].log_weights, expected.log_weights);
  EXPECT_EQ(recorded[3].report.effective_particles, 4.5);
  EXPECT_TRUE(recorded[3].report.slipped);
}

TEST(MapJournal, CutOffAnywhereItKeepsTheWholeRecordsAndGoesOn) {
  const test::TempFolder folder;
  const std::string path = folder / "map.journal";
  write(path, 3);
  const std::string bytes = test::readFile(path);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    SCOPED_TRACE(size);
    test::writeFile(path, bytes.substr(0, size));
    std::size_t kept = 0;
    {
      MapJournal journal(path, 42, 3, true);
      const auto recorded = journal.takeRecorded();
      kept = recorded.size();
      for (std::size_t k = 0; k < kept; ++k) EXPECT_EQ(recorded[k].scan, k);
      for (std::size_t k = kept; k < 3; ++k) journal.append(generation(k));
    }
    EXPECT_LT(kept, 3U);
    EXPECT_EQ(test::readFile(path), bytes);
  }
}

TEST(MapJournal, ADamagedRecordEndsWhatIsBelieved) {
  const test::TempFolder folder;
  const std::string path = folder / "map.journal";
  write(path, 3);
  std::string bytes = test::readFile(path);
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  test::writeFile(path, bytes);
  MapJournal journal(path, 42, 3, true);
  EXPECT_EQ(journal.takeRecorded().size(), 1U);
}

TEST(MapJournal, OfAnotherRunIsRefused) {
  const test::TempFolder folder;
  const std::string path = folder / "map.journal";
  write(path, 2);
  EXPECT_THROW(MapJournal(path, 43, 3, true), ConfigError);
  // Without --resume it is simply replaced.
  MapJournal journal(path, 43, 3, false);
  EXPECT_TRUE(journal.takeRecorded().empty());
}

}  // namespace
}  // namespace vestibule::pipeline
