#include "vestibule/metrics/relations.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "vestibule/core/errors.hpp"

namespace vestibule::metrics {
namespace {

TEST(Relations, MeasureRelativePosesOnly) {
  std::istringstream text(
      "# comment\n"
      "976052857.337284 976052859.0 2.0 0.0 0.0 0 0 1.5707963267948966\n"
      "\n"
      "976052857.337284 976052861.0 1.0 0.0 0.0 0 0 0\n"
      "976052857.337284 976059999.0 1.0 0.0 0.0 0 0 0\n");
  const auto relations = parseRelations(text, "x.relations");
  ASSERT_EQ(relations.size(), 3u);
  EXPECT_EQ(relations[0].first.ns, 976052857337284000);
  // The robot starts anywhere, drives 2.3 m ahead, turns left by a right angle less 0.1 rad.
  const Pose2 start(7, -3, 2);
  const Trajectory estimate{
      {relations[0].first, start},
      {relations[0].second, compose(start, Pose2(2.3, 0, 1.5707963267948966 - 0.1))},
      {relations[1].second, compose(start, Pose2(1.0, 0.4, 0))}};
  const RelationErrors errors = relationErrors(estimate, relations);
  EXPECT_EQ(errors.relations, 3u);
  EXPECT_EQ(errors.matched, 2u);
  EXPECT_NEAR(errors.translation_m.mean, 0.35, 1e-9);
  EXPECT_NEAR(errors.translation_m.stddev, 0.05, 1e-9);
  EXPECT_NEAR(errors.yaw_rad.mean, 0.05, 1e-9);
}

TEST(Relations, NameFileAndLineOfBadInput) {
  const auto message = [](const std::string& text) {
    std::istringstream in(text);
    try {
      (void)parseRelations(in, "x.relations");
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(
      message("1 2 0 0 0 0 0 0\n1 2 3\n"), testing::HasSubstr("x.relations:2: a relation has 8"));
  EXPECT_THAT(message("1 2 0 nan 0 0 0 0\n"), testing::HasSubstr("x.relations:1: 'nan'"));
  EXPECT_THAT(message("1 later 0 0 0 0 0 0\n"), testing::HasSubstr("'later' is not a time"));
}

}  // namespace
}  // namespace vestibule::metrics
