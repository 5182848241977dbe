#include "vestibule/gui_headless/report.hpp"

#include <gtest/gtest.h>

#include "markup.hpp"
#include "synthetic_run.hpp"

namespace vestibule::gui_headless {
namespace {

OverviewStyle smallPicture() {
  OverviewStyle style;
  style.width_px = 400;
  return style;
}

Report sampleReport() {
  SyntheticRun drive;
  RunRecorder run;
  drive.drive(run);
  Report report;
  report.title = "Feeding <round> & \"more\"";
  report.subtitle = "seed 7";
  report.command_line = "vestibule mission m.yaml --out 'a & b'";
  report.summary = {
      {"position RMSE", "0.05", "m", "<= 0.30", Figure::Verdict::kGood, ""},
      {"step", "0.07", "m", "<= 0.05", Figure::Verdict::kBad, "at the <east> door"}};
  report.sections.push_back(sectionFromRun(run, drive.scene(), "Mission <1>", smallPicture()));
  report.sections.push_back(sectionFromRun(RunRecorder{}, {}, "Nothing happened", smallPicture()));
  report.sections.back().text = "First <paragraph>.\n\nSecond.";
  return report;
}

TEST(Report, IsWellFormedEscapedAndSelfContained) {
  const std::string html = renderReport(sampleReport());
  EXPECT_EQ(markupProblem(html), "");
  EXPECT_EQ(html.find("http://"), std::string::npos);
  EXPECT_EQ(html.find("https://"), std::string::npos);
  EXPECT_EQ(html.find("url("), std::string::npos);
  EXPECT_EQ(countOf(html, "src=\""), countOf(html, "src=\"data:image/png;base64,"));
  EXPECT_EQ(html.find("<round>"), std::string::npos);
  EXPECT_NE(html.find("Feeding &lt;round&gt; &amp; &quot;more&quot;"), std::string::npos);
  EXPECT_NE(html.find("multipath &lt;near the wall&gt; &amp; &quot;roof&quot;"), std::string::npos);
  EXPECT_EQ(countOf(html, "<p>First"), 1u);
  EXPECT_EQ(countOf(html, "<p>Second"), 1u);
}

TEST(Report, SaysVerdictsInWords) {
  const std::string html = renderReport(sampleReport());
  EXPECT_NE(html.find("1 of 2 bars met"), std::string::npos);
  EXPECT_EQ(countOf(html, "\u2713 met"), 1u);
  EXPECT_EQ(countOf(html, "\u2717 missed"), 1u);
}

TEST(Report, SameRunSameBytes) {
  EXPECT_EQ(renderReport(sampleReport()), renderReport(sampleReport()));
}

TEST(Report, EmptyReportIsAPage) { EXPECT_EQ(markupProblem(renderReport({})), ""); }

TEST(Section, OfADriveWithReferenceHasErrorsEventsAndDoors) {
  SyntheticRun drive;
  RunRecorder run;
  drive.drive(run);
  const ReportSection section = sectionFromRun(run, drive.scene(), "drive", smallPicture());
  ASSERT_EQ(section.pictures.size(), 2u) << "overview and particles over time";
  // timeline, position, yaw, NIS, and of the particles their number, trust and spread
  ASSERT_EQ(section.charts.size(), 7u);
  EXPECT_NE(section.charts[1].find("Position error"), std::string::npos);
  EXPECT_NE(section.charts[1].find(">west</text>"), std::string::npos) << "door marker missing";
  EXPECT_NE(section.charts[0].find("feeding 1"), std::string::npos) << "waypoint tick missing";
  std::vector<std::string> titles;
  for (const Table& table : section.tables) titles.push_back(table.title);
  EXPECT_EQ(
      titles,
      (std::vector<std::string>{
          "Updates per sensor", "Mode changes", "Indoor maps", "Mission", "Warnings"}));
  EXPECT_EQ(section.tables[1].rows[0][3], "GNSS fades at the door");
  for (const Table& table : section.tables) {
    for (const auto& row : table.rows) EXPECT_EQ(row.size(), table.header.size()) << table.title;
  }
}

TEST(Section, ErrorIsTheDistanceToTheInterpolatedReference) {
  // GIVEN a reference at whole seconds along x and an estimate half a second later, 0.3 m beside
  RunRecorder run;
  Scene scene;
  for (int i = 0; i < 20; ++i) {
    scene.reference.emplace_back(timestampFromSeconds(i), Pose2(1.0 * i, 0.0, 0.0));
    PoseEvent event{timestampFromSeconds(i + 0.5), PoseSource::kParticles, Mode::kIndoor, {}};
    event.T.mean = Pose2(i + 0.5, 0.3, 2.0 * kRadPerDeg);
    run.onPose(event);
  }
  const ReportSection section = sectionFromRun(run, scene, "offset", smallPicture());
  std::string position;
  std::string yaw;
  for (const Figure& tile : section.highlights) {
    if (tile.label == "Position RMSE") position = tile.value;
    if (tile.label == "Yaw RMSE") yaw = tile.value;
  }
  EXPECT_EQ(position, "0.300");
  EXPECT_EQ(yaw, "2.00");
}

TEST(Section, RecordedTruthStandsInForAReference) {
  RunRecorder run;
  for (int i = 0; i < 10; ++i) {
    PoseEvent event{timestampFromSeconds(i), PoseSource::kPublished, Mode::kOutdoor, {}};
    event.T.mean = Pose2(i, 0.1, 0.0);
    run.onPose(event);
    event.source = PoseSource::kTruth;
    event.T.mean = Pose2(i, 0.0, 0.0);
    run.onPose(event);
  }
  const ReportSection section = sectionFromRun(run, {}, "truth", smallPicture());
  ASSERT_GE(section.highlights.size(), 3u);
  EXPECT_EQ(section.highlights[2].label, "Position RMSE");
  EXPECT_EQ(section.highlights[2].value, "0.100");
}

}  // namespace
}  // namespace vestibule::gui_headless
