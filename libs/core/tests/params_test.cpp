#include "vestibule/core/params.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "vestibule/core/angles.hpp"
#include "vestibule/core/errors.hpp"

namespace vestibule {
namespace {

using ::testing::HasSubstr;

enum class Engine { kMrpt, kFixed };

struct Gnss {
  double gate = 0.999;
  int min_satellites = 4;
  double yaw_rad = degToRad(10.0);
};
void describe(ParamIo& io, Gnss& p) {
  io.optional("gate", p.gate, inside(0.0, 1.0));
  io.optional("min_satellites", p.min_satellites, nonNegative());
  io.optionalDegrees("yaw_deg", p.yaw_rad, within(-180, 180));
}

struct Waypoint {
  std::vector<double> lla;
  double x = 0.0;
};
void describe(ParamIo& io, Waypoint& w) {
  if (io.isSequence()) {
    io.elements(w.lla, 4, 4);
  } else {
    io.optional("x", w.x);
  }
}

struct Config {
  std::string name;
  Gnss gnss;
  Engine engine = Engine::kMrpt;
  std::vector<Gnss> receivers;
  std::vector<std::pair<std::string, Waypoint>> waypoints;
  std::vector<double> origin;
  std::optional<double> limit;
  bool on = false;
};
void describe(ParamIo& io, Config& c) {
  io.required("name", c.name);
  io.section("gnss", c.gnss);
  io.optional("engine", c.engine, {{"mrpt", Engine::kMrpt}, {"fixed", Engine::kFixed}});
  io.list("receivers", c.receivers);
  io.table("waypoints", c.waypoints);
  io.optional("origin", c.origin, 3, 3);
  io.optional("limit", c.limit, positive());
  io.optional("on", c.on);
}

std::string problemsOf(const std::string& yaml) {
  try {
    (void)parseParams<Config>(yaml, "c.yaml");
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "";
}

TEST(Params, ReadsEveryKindOfField) {
  const auto c = parseParams<Config>(
      "name: demo\ngnss: {gate: 0.99, min_satellites: 6, yaw_deg: -90}\nengine: fixed\non: true\n"
      "receivers: [{gate: 0.5}, {gate: 0.6}]\norigin: [1, 2, 3.5]\nlimit: 4\n"
      "waypoints: {door: [1, 2, 3, 4], bed: {x: 7}}\n",
      "c.yaml");
  EXPECT_EQ(c.name, "demo");
  EXPECT_DOUBLE_EQ(c.gnss.gate, 0.99);
  EXPECT_EQ(c.gnss.min_satellites, 6);
  EXPECT_DOUBLE_EQ(c.gnss.yaw_rad, -kPi / 2.0);
  EXPECT_EQ(c.engine, Engine::kFixed);
  ASSERT_EQ(c.receivers.size(), 2U);
  EXPECT_DOUBLE_EQ(c.receivers[1].gate, 0.6);
  ASSERT_EQ(c.waypoints.size(), 2U);
  EXPECT_EQ(c.waypoints[0].first, "door");
  EXPECT_EQ(c.waypoints[0].second.lla, (std::vector<double>{1, 2, 3, 4}));
  EXPECT_DOUBLE_EQ(c.waypoints[1].second.x, 7.0);
  EXPECT_EQ(c.origin, (std::vector<double>{1, 2, 3.5}));
  EXPECT_TRUE(c.on);
}

TEST(Params, ListsAllProblemsAtOnceWithFileAndLine) {
  const std::string text = problemsOf(
      "gnss:\n"
      "  gate: 1.5\n"
      "  gaet: 3\n"
      "  min_satelites: 5\n"
      "engine: eigen\n"
      "origin: [1, 2]\n"
      "limit: abc\n"
      "on: perhaps\n");
  EXPECT_THAT(text, HasSubstr("c.yaml:1: name: missing (required)"));
  EXPECT_THAT(text, HasSubstr("c.yaml:2: gnss.gate = 1.5: must be in (0, 1)"));
  EXPECT_THAT(text, HasSubstr("c.yaml:3: gnss.gaet: unknown key (did you mean gate?)"));
  EXPECT_THAT(
      text, HasSubstr("c.yaml:4: gnss.min_satelites: unknown key (did you mean min_satellites?)"));
  EXPECT_THAT(text, HasSubstr("c.yaml:5: engine: must be one of mrpt, fixed, is 'eigen'"));
  EXPECT_THAT(text, HasSubstr("c.yaml:6: origin: must have 3 numbers, has 2"));
  EXPECT_THAT(text, HasSubstr("c.yaml:7: limit: must be a number, is 'abc'"));
  EXPECT_THAT(text, HasSubstr("c.yaml:8: on: must be true or false"));
}

TEST(Params, RefusesNanDuplicatesAndWrongShapes) {
  EXPECT_THAT(problemsOf("name: a\nlimit: nan\n"), HasSubstr("must be > 0"));
  EXPECT_THAT(problemsOf("name: a\nname: b\n"), HasSubstr("c.yaml:2: name: given twice"));
  EXPECT_THAT(problemsOf("name: a\ngnss: 3\n"), HasSubstr("gnss: must be a mapping, is '3'"));
  EXPECT_THAT(problemsOf("name: a\ngnss: [3]\n"), HasSubstr("gnss: must be a mapping, is a list"));
  EXPECT_THAT(problemsOf("name: a\nreceivers: {x: 1}\n"), HasSubstr("must be a list"));
  EXPECT_THAT(problemsOf("name: a\ngnss: {min_satellites: 1.5}\n"), HasSubstr("whole number"));
  EXPECT_THAT(problemsOf("name: [unclosed\n"), HasSubstr("not valid YAML"));
  EXPECT_THAT(problemsOf("- a\n- b\n"), HasSubstr("must be a mapping"));
}

TEST(Params, WhatIsWrittenReadsBack) {
  Config c;
  c.name = "has \"quotes\": and #";
  c.gnss.gate = 0.1 + 0.2;
  c.receivers.resize(2);
  c.origin = {0.1, -2e-9, 3};
  c.engine = Engine::kFixed;
  const std::string yaml = dumpParams(c);
  const auto back = parseParams<Config>(yaml, "dump");
  EXPECT_EQ(back.name, c.name);
  EXPECT_EQ(back.gnss.gate, c.gnss.gate);
  EXPECT_EQ(back.origin, c.origin);
  EXPECT_EQ(back.engine, c.engine);
  EXPECT_EQ(dumpParams(back), yaml);
}

TEST(Params, AMissingFileIsNamed) {
  EXPECT_THROW((void)loadParams<Config>("/nonexistent/x.yaml"), ConfigError);
}

}  // namespace
}  // namespace vestibule
