#include "vestibule/ekf/params.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vestibule/core/errors.hpp"

namespace vestibule::ekf {
namespace {

TEST(FilterParams, WrittenAndReadBackAreTheSame) {
  FilterParams params;
  params.gate_probability = 0.99;
  params.heading.offset_walk_rad_sqrt_s = degToRad(0.7);
  params.gnss.sigma_single_m = 3.3;
  params.recovery.min_fixes = 9;
  params.init.trust_heading = true;
  const std::string text = dumpParams(params);
  EXPECT_EQ(dumpParams(parseParams<FilterParams>(text, "ekf.yaml")), text);
  EXPECT_THAT(text, testing::HasSubstr("3.3"));
}

TEST(FilterParams, RefuseAGateThatIsTighterThanTheSoftOne) {
  EXPECT_THROW((void)parseParams<FilterParams>("gate_probability: 0.9\n", "x"), ConfigError);
  EXPECT_THROW((void)parseParams<FilterParams>("gate_probability: 1.0\n", "x"), ConfigError);
}

}  // namespace
}  // namespace vestibule::ekf
