#include "vestibule/core/memory.hpp"

#include <gtest/gtest.h>

#include <fstream>
#include <string>

namespace vestibule {
namespace {

/// Resident pages of files [kB]; -1 where the system does not say.
long residentFilePages_kb() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("RssFile:", 0) == 0) return std::stol(line.substr(8));
  }
  return -1;
}

TEST(Memory, LibraryPagesAreGivenBackAndComeBack) {
  const long before_kb = residentFilePages_kb();
  ASSERT_GT(before_kb, 0) << "no RssFile in /proc/self/status";
  giveBackLibraryPages();
  const long after_kb = residentFilePages_kb();
  EXPECT_LT(after_kb, before_kb);
  // Code and constants of libraries still work.
  EXPECT_EQ(std::to_string(std::stod("0.5")), "0.500000");
  EXPECT_THROW(static_cast<void>(std::stoi("x")), std::invalid_argument);
}

}  // namespace
}  // namespace vestibule
