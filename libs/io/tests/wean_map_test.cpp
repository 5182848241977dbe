#include <gmock/gmock.h>

#include "temp_files.hpp"
#include "vestibule/io/map_io.hpp"

namespace vestibule::io {
namespace {

using testing::HasSubstr;

const std::string kGood =
    "robot_specifications->resolution 10\n\nglobal_map[0]: 3 2\n-1.0 0.9\n0.1 0.95\n0.55 0.0\n";

std::string complaint(const std::string& text) {
  try {
    (void)loadMap(writeFile(testFolder() / "m.dat", text));
  } catch (const InputError& e) {
    return e.what();
  }
  return {};
}

TEST(WeanMap, LinesAreColumnsFromBelow) {
  const auto map = loadMap(writeFile(testFolder() / "m.dat", kGood));
  EXPECT_EQ(map.width(), 3);
  EXPECT_EQ(map.height(), 2);
  EXPECT_NEAR(map.resolution(), 0.1, 1e-6);
  EXPECT_EQ(map.cell(0, 0), grid::Cell::kUnknown);
  EXPECT_EQ(map.cell(0, 1), grid::Cell::kFree);
  EXPECT_EQ(map.cell(1, 0), grid::Cell::kOccupied);
  EXPECT_EQ(map.cell(2, 0), grid::Cell::kUnknown) << "seen both ways";
  EXPECT_EQ(map.cell(2, 1), grid::Cell::kOccupied);
  EXPECT_EQ(map.at({0.25, 0.15}), grid::Cell::kOccupied);
}

TEST(WeanMap, BadInputNamesTheLine) {
  const auto with = [](const std::string& from, const std::string& to) {
    std::string text = kGood;
    return text.replace(text.find(from), from.size(), to);
  };
  EXPECT_THAT(complaint(kGood.substr(0, kGood.size() - 9)), HasSubstr("ends after 2 of 3"));
  EXPECT_THAT(complaint(with("0.1 0.95", "0.1")), HasSubstr("m.dat:5: 1 numbers instead of 2"));
  EXPECT_THAT(complaint(with("0.95", "x")), HasSubstr("m.dat:5: 'x' is not a number"));
  EXPECT_THAT(complaint(with("0.95", "nan")), HasSubstr("'nan' is not a number"));
  EXPECT_THAT(complaint(with("3 2", "0 2")), HasSubstr("m.dat:3: '0' is not"));
  EXPECT_THAT(complaint(with("3 2", "1e9 2")), HasSubstr("'1e9' is not"));
  EXPECT_THAT(complaint(with("resolution 10", "resolution -1")), HasSubstr("m.dat:1: '-1' is not"));
  EXPECT_THAT(complaint(with("robot", "x")), HasSubstr("no 'robot_specifications->resolution'"));
  EXPECT_THAT(complaint("nothing of it\n"), HasSubstr("no 'global_map[0]:"));
}

TEST(WeanMap, IsKnownByItsFirstWord) {
  EXPECT_TRUE(isMap(writeFile(testFolder() / "m.dat", kGood)));
  EXPECT_FALSE(isMap(writeFile(testFolder() / "log.dat", "ODOM 0 0 0 0 0 0 1 host 1\n")));
  EXPECT_FALSE(isMap(writeFile(testFolder() / "empty.dat", "")));
  EXPECT_FALSE(isMap((testFolder() / "missing.dat").string()));
  EXPECT_TRUE(isMap("any.yaml"));
  EXPECT_FALSE(isMap("any.log"));
}

}  // namespace
}  // namespace vestibule::io
