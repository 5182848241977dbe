#include "vestibule/gui_headless/charts.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "../src/text.hpp"
#include "markup.hpp"

namespace vestibule::gui_headless {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(Text, EscapesEverythingThatMarkupReserves) {
  EXPECT_EQ(escape("a<b> & \"c\" 'd'\x01"), "a&lt;b&gt; &amp; &quot;c&quot; &#39;d&#39; ");
}

TEST(Text, Base64FollowsTheStandard) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("\xff\xfe\xfd"), "//79");
}

TEST(Text, NumbersHaveNoNegativeZeroAndNoNan) {
  EXPECT_EQ(fixed(-0.0001, 2), "0.00");
  EXPECT_EQ(fixed(kNan, 2), "-");
  EXPECT_EQ(compact(2.500, 3), "2.5");
  EXPECT_EQ(compact(200.0, 0), "200");
  EXPECT_EQ(asciiText("F\u00fctterung \u2192"), "Futterung ?");
}

TEST(Text, TicksAreRoundAndInside) {
  for (const auto& [low, high] : std::vector<std::pair<double, double>>{
           {0.0, 1.0}, {-3.2, 7.9}, {0.0, 0.0031}, {1e5, 1e5 + 3.0}, {-1e6, 2e6}}) {
    const Ticks ticks = niceTicks(low, high, 5);
    ASSERT_GE(ticks.values.size(), 2u) << low << " to " << high;
    EXPECT_LE(ticks.values.size(), 11u) << low << " to " << high;
    EXPECT_GE(ticks.values.front(), low - 1e-9);
    EXPECT_LE(ticks.values.back(), high + 1e-6);
  }
  EXPECT_EQ(fixed(niceTicks(0.0, 1.0, 5).values[1], niceTicks(0.0, 1.0, 5).decimals), "0.2");
  EXPECT_TRUE(niceTicks(1.0, 1.0, 5).values.empty());
}

LineChart spikyChart() {
  LineChart chart;
  chart.title = "error <of> \"A & B\"";
  chart.y_label = "error [m]";
  Series series{"estimate & co", SeriesLook::kEstimate, {}};
  for (int i = 0; i < 100000; ++i) {
    series.points.emplace_back(0.01 * i, i == 54321 ? 9.0 : 0.1 + 0.05 * std::sin(0.1 * i));
  }
  chart.series.push_back(series);
  chart.bands = {
      {0.0, 400.0, Mode::kOutdoor, ""}, {400.0, 1000.0, Mode::kIndoor, "scan <matches> map"}};
  chart.markers = {{400.0, "door <west>"}};
  return chart;
}

TEST(LineChart, ManyPointsStaySmallAndTheSpikeSurvives) {
  const std::string svg = lineChart(spikyChart());
  EXPECT_EQ(markupProblem(svg), "");
  EXPECT_LT(svg.size(), 120000u);
  EXPECT_NE(svg.find("door &lt;west&gt;"), std::string::npos);
  EXPECT_NE(svg.find("scan &lt;matches&gt; map"), std::string::npos);
  EXPECT_EQ(svg.find("<of>"), std::string::npos);
  // y runs from 0 to 10 over 198 px below y = 46: 9.0 is at 244 - 0.9 * 198.
  EXPECT_NE(svg.find(" 65.8"), std::string::npos) << "the spike at 9 m is not in the path";
}

TEST(LineChart, HolesAndBadNumbersBreakTheLine) {
  LineChart chart;
  chart.series.push_back(
      {"e", SeriesLook::kEstimate, {{0, 1}, {10, 2}, {20, kNan}, {30, 1}, {40, 2}}});
  const std::string svg = lineChart(chart);
  EXPECT_EQ(markupProblem(svg), "");
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  const std::size_t path = svg.find("<path d=\"");
  ASSERT_NE(path, std::string::npos);
  EXPECT_EQ(countOf(svg.substr(path, svg.find('"', path + 9) - path), "M"), 2u);
}

TEST(LineChart, SaysSoWithoutData) {
  LineChart chart;
  chart.title = "nothing";
  EXPECT_NE(lineChart(chart).find("no data"), std::string::npos);
  chart.series.push_back({"e", SeriesLook::kEstimate, {{0.0, kNan}}});
  EXPECT_NE(lineChart(chart).find("no data"), std::string::npos);
  EXPECT_EQ(markupProblem(lineChart(chart)), "");
}

TEST(LineChart, OnePointAndConstantValuesAreFine) {
  LineChart chart;
  chart.series.push_back({"e", SeriesLook::kEstimate, {{5.0, 0.0}}});
  EXPECT_EQ(markupProblem(lineChart(chart)), "");
  EXPECT_EQ(lineChart(chart).find("nan"), std::string::npos);
  chart.include_zero = false;
  chart.series[0].points = {{0.0, -3.0}, {1.0, -3.0}};
  EXPECT_EQ(lineChart(chart).find("nan"), std::string::npos);
}

TEST(ModeTimeline, ShowsEveryModeEvenAShortOne) {
  ModeTimeline timeline;
  timeline.to = 1000.0;
  timeline.bands = {
      {0.0, 500.0, Mode::kOutdoor, ""},
      {500.0, 500.01, Mode::kLost, "a & b"},
      {500.01, 1000.0, Mode::kIndoor, "map"}};
  timeline.ticks = {{100.0, "gate"}, {2000.0, "outside of the axis"}};
  const std::string svg = modeTimeline(timeline);
  EXPECT_EQ(markupProblem(svg), "");
  EXPECT_NE(svg.find("width=\"1.5\" height=\"30\" fill=\"#b0101f\""), std::string::npos);
  EXPECT_NE(svg.find("lost, 500.0 to 500.0 s: a &amp; b"), std::string::npos);
  EXPECT_EQ(svg.find("outside of the axis"), std::string::npos);
  EXPECT_NE(modeTimeline({}).find("no data"), std::string::npos);
}

TEST(Histogram, SharesSumToOneAndOutliersStayInTheLastBin) {
  Histogram chart;
  chart.title = "NIS";
  chart.dof = 2;
  for (int i = 0; i < 99; ++i) chart.values.push_back(0.5 + 0.01 * i);
  chart.values.push_back(1e300);
  chart.values.push_back(kNan);
  const std::string svg = histogram(chart);
  EXPECT_EQ(markupProblem(svg), "");
  EXPECT_NE(svg.find("and more: 1.00 %"), std::string::npos);
  EXPECT_NE(svg.find("2 dof"), std::string::npos);
  EXPECT_NE(histogram({}).find("no data"), std::string::npos);
  chart.values.assign(10, 0.0);
  chart.dof.reset();
  EXPECT_EQ(histogram(chart).find("nan"), std::string::npos);
}

}  // namespace
}  // namespace vestibule::gui_headless
