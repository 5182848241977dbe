// Whatever is thrown at the filter, its estimate stays finite and its covariance a covariance.
// VESTIBULE_FUZZ_SEQUENCES=10000000 ekf_test --gtest_filter='Fuzz*' for the long run.

#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "sequence_target.hpp"
#include "vestibule/core/random.hpp"

namespace vestibule::ekf {
namespace {

/// Chance, by the index of a sequence.
class Dice {
 public:
  explicit Dice(std::uint64_t index) : random_(1, "fuzz", index) {}
  std::uint64_t below(std::uint64_t n) { return random_() % n; }
  double number(double mean, double sigma) { return random_.normal(mean, sigma); }

 private:
  RandomStream random_;
};

TEST(Fuzz, NothingBreaksTheFilter) {
  const char* wanted = std::getenv("VESTIBULE_FUZZ_SEQUENCES");
  const std::uint64_t sequences = wanted != nullptr ? std::strtoull(wanted, nullptr, 10) : 3000;
  const char* first = std::getenv("VESTIBULE_FUZZ_FIRST");
  const std::uint64_t begin = first != nullptr ? std::strtoull(first, nullptr, 10) : 0;
  Dropped dropped;
  std::size_t ready = 0;
  for (std::uint64_t index = begin; index < begin + sequences; ++index) {
    FilterParams params;
    params.plane = index % 2 == 0;
    params.init.trust_heading = index % 3 == 0;
    MapFilter filter(params, SensorRig());
    fuzz::Thrower<Dice> thrower{Dice(index)};
    const int length = 1 + static_cast<int>(index % 40);
    for (int i = 0; i < length; ++i) thrower.throwAt(filter);
    ASSERT_EQ(fuzz::faultOf(filter), "") << "sequence " << index;
    if (filter.ready()) ++ready;
    for (const auto& [reason, count] : filter.dropped()) dropped[reason] += count;
  }
  EXPECT_GT(ready, sequences / 10);
  for (const char* reason : {"not finite", "impossible", "stale", "duplicate"}) {
    std::printf("refused as %s: %zu\n", reason, dropped[reason]);
  }
  EXPECT_GT(dropped["not finite"], sequences / 10);
  EXPECT_GT(dropped["impossible"], sequences / 100);
}

TEST(Fuzz, AFixThatClaimsAThinEllipseAcrossTheAxesMayStartTheFilter) {
  FilterParams params;
  params.plane = false;
  params.init.trust_heading = true;
  MapFilter filter(params, SensorRig());
  const Timestamp stamp{1'000'000'000};
  (void)filter.process(Heading{stamp, 0.3, 0.02, {}});
  MapFix fix;
  fix.stamp = stamp;
  fix.type = GnssFixType::kDifferential;
  fix.cov = Eigen::Matrix3d();
  *fix.cov << 36.0, 35.0, 0.0, 35.0, 36.0, 0.0, 0.0, 0.0, 36.0;
  (void)filter.process(fix);
  ASSERT_TRUE(filter.ready());
  EXPECT_EQ(fuzz::faultOf(filter), "");
}

TEST(Fuzz, BytesOfAnyKindAreASequence) {
  // What the libFuzzer target does, without its guidance.
  for (std::uint64_t index = 0; index < 300; ++index) {
    RandomStream random(2, "fuzz bytes", index);
    std::vector<std::uint8_t> bytes(random() % 1500);
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    ASSERT_EQ(fuzz::feedSequence(bytes.data(), bytes.size()), "") << "sequence " << index;
  }
}

}  // namespace
}  // namespace vestibule::ekf
