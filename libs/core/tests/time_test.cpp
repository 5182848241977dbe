#include "vestibule/core/time.hpp"

#include <gtest/gtest.h>

namespace vestibule {
namespace {

TEST(Time, ParsesUnixStampsToTheNanosecond) {
  EXPECT_EQ(parseSeconds("976052857.337284")->ns, 976052857337284000);
  EXPECT_EQ(parseSeconds("1134863807.658747123")->ns, 1134863807658747123);
  EXPECT_EQ(parseSeconds("-0.25")->ns, -250000000);
  EXPECT_EQ(parseSeconds("12")->ns, 12000000000);
  EXPECT_EQ(parseSeconds("1.5e3")->ns, 1500000000000);
  EXPECT_EQ(parseSeconds("0.0000000005")->ns, 1);
}

TEST(Time, RefusesWhatIsNotAPlainNumber) {
  for (const char* text : {"", "-", ".", "nan", "inf", "1.2.3", "1e400", "99999999999", "1x"}) {
    EXPECT_FALSE(parseSeconds(text)) << text;
  }
}

TEST(Time, FormattingAndParsingRoundTrip) {
  for (const std::int64_t ns :
       {INT64_C(0), INT64_C(1), INT64_C(-1), INT64_C(976052857337284001), INT64_C(-999999999)}) {
    EXPECT_EQ(parseSeconds(formatSeconds({ns}))->ns, ns) << formatSeconds({ns});
  }
}

TEST(Time, SecondsKeepMicrosecondsOfUnixTimes) {
  const Timestamp t = timestampFromSeconds(976052857.337284);
  EXPECT_NEAR(static_cast<double>(t.ns - 976052857337284000), 0.0, 200.0);
  EXPECT_EQ(durationFromSeconds(-0.1).count(), -100000000);
  EXPECT_EQ(timestampFromSeconds(-0.1).ns, -100000000);
}

}  // namespace
}  // namespace vestibule
