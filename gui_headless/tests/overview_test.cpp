#include "vestibule/gui_headless/overview.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "synthetic_run.hpp"
#include "vestibule/core/errors.hpp"
#include "vestibule/gui_headless/report.hpp"

namespace vestibule::gui_headless {
namespace {

cv::Mat decoded(const std::string& png) {
  const std::vector<uchar> bytes(png.begin(), png.end());
  return cv::imdecode(bytes, cv::IMREAD_COLOR);
}

/// Smallest distance (largest channel difference) of any pixel within `radius` to a colour, r g b.
int colourDistance(const cv::Mat& image, cv::Point2d at, int radius, cv::Vec3i rgb) {
  int best = 255;
  for (int y = static_cast<int>(at.y) - radius; y <= static_cast<int>(at.y) + radius; ++y) {
    for (int x = static_cast<int>(at.x) - radius; x <= static_cast<int>(at.x) + radius; ++x) {
      if (x < 0 || y < 0 || x >= image.cols || y >= image.rows) continue;
      const auto pixel = image.at<cv::Vec3b>(y, x);
      int worst = 0;
      for (int c = 0; c < 3; ++c) worst = std::max(worst, std::abs(pixel[2 - c] - rgb[c]));
      best = std::min(best, worst);
    }
  }
  return best;
}

const cv::Vec3i kBlue(0x00, 0x72, 0xb2);
const cv::Vec3i kOrange(0xe8, 0x92, 0x0c);
const cv::Vec3i kWallGrey(0x5a, 0x65, 0x72);
const cv::Vec3i kGroundGrey(0xf3, 0xf5, 0xf8);

/// 20 m eastwards along y = 0, outdoors for the first half, then indoors.
void driveEast(RunRecorder& run) {
  for (int i = 0; i <= 200; ++i) {
    PoseEvent event{timestampFromSeconds(i), PoseSource::kPublished, Mode::kOutdoor, {}};
    event.mode = i < 100 ? Mode::kOutdoor : Mode::kIndoor;
    event.T.mean = Pose2(0.1 * i, 0.0, 0.0);
    run.onPose(event);
  }
}

// One picture pixel per layout pixel: the map area is 1124 wide and starts at (1, 1).
OverviewStyle onePixelPerLayoutPixel() {
  OverviewStyle style;
  style.width_px = 1126;
  return style;
}

TEST(Overview, DrawsTheTrajectoryInTheColourOfItsModeWhereItBelongs) {
  RunRecorder run;
  driveEast(run);
  const cv::Mat image = decoded(renderOverview(run, {}, onePixelPerLayoutPixel()));
  ASSERT_EQ(image.cols, 1126);
  // 20 m plus 12 % of margin fill 1124 px; the view is centred on (10, 0).
  const double px_per_m = 1124.0 / 22.4;
  const cv::Point2d centre(1.0 + 562.0, 1.0 + 225.0);
  const cv::Point2d west = centre - cv::Point2d(5.0 * px_per_m, 0.0);
  const cv::Point2d east = centre + cv::Point2d(5.0 * px_per_m, 0.0);
  EXPECT_LT(colourDistance(image, west, 1, kBlue), 12);
  EXPECT_LT(colourDistance(image, east, 1, kOrange), 12);
  EXPECT_GT(colourDistance(image, west, 1, kOrange), 60);
  // Above the track there is only ground.
  EXPECT_LT(colourDistance(image, west - cv::Point2d(17.0, 33.0), 1, kGroundGrey), 4);
  EXPECT_GT(colourDistance(image, west - cv::Point2d(0.0, 30.0), 8, kBlue), 60);
}

TEST(Overview, PlacesAPriorMapInItsGeoreference) {
  // GIVEN a 10 x 6 m map with one occupied block around grid point (8, 1), turned by 90 degrees:
  // that point lies at (-1, 8) of the map frame
  std::vector<grid::Cell> cells(100 * 60, grid::Cell::kFree);
  for (int y = 5; y < 15; ++y) {
    for (int x = 75; x < 85; ++x)
      cells[static_cast<std::size_t>(y * 100 + x)] = grid::Cell::kOccupied;
  }
  const auto map = grid::OccupancyMap::fromCells(
      100, 60, 0.1, Point2(0, 0), cells, Pose2(0, 0, 90.0 * kRadPerDeg));
  Scene scene;
  scene.prior_maps = {&map};
  const cv::Mat image = decoded(renderOverview(RunRecorder{}, scene, onePixelPerLayoutPixel()));
  // THEN the block is there: the map spans x -6..0, y 0..10, its height decides the scale
  const double map_height = 0.72 * 1124.0;
  const double px_per_m = map_height / 11.2;
  const cv::Point2d centre(1.0 + 562.0, 1.0 + 0.5 * map_height);
  const auto at = [&](double x, double y) {
    return centre + cv::Point2d((x + 3.0) * px_per_m, -(y - 5.0) * px_per_m);
  };
  EXPECT_LT(colourDistance(image, at(-1.0, 8.0), 0, kWallGrey), 6);
  EXPECT_LT(colourDistance(image, at(-1.4, 8.4), 0, kWallGrey), 6);
  EXPECT_LT(colourDistance(image, at(-1.7, 8.0), 0, {255, 255, 255}), 6);
  EXPECT_LT(colourDistance(image, at(-5.0, 2.0), 0, {255, 255, 255}), 6);
  EXPECT_LT(colourDistance(image, at(-7.3, 3.3), 0, kGroundGrey), 4);
}

TEST(Overview, ThinWallsSurviveInALargeMap) {
  // One column of 5 cm cells in a map of 100 x 100 m: a tenth of a pixel's share.
  constexpr int kSize = 2000;
  std::vector<grid::Cell> cells(kSize * kSize, grid::Cell::kFree);
  for (int y = 0; y < kSize; ++y) {
    cells[static_cast<std::size_t>(y) * kSize + 500] = grid::Cell::kOccupied;
  }
  const auto map = grid::OccupancyMap::fromCells(kSize, kSize, 0.05, Point2(0, 0), cells);
  Scene scene;
  scene.prior_maps = {&map};
  OverviewStyle style;
  style.width_px = 500;
  const cv::Mat image = decoded(renderOverview(RunRecorder{}, scene, style));
  const double density = 500.0 / 1126.0;
  const double px_per_m = density * 0.72 * 1124.0 / 112.0;
  const cv::Point2d at(0.5 * 500.0 - 25.0 * px_per_m, 0.3 * 500.0);
  const int paper = colourDistance(image, at + cv::Point2d(20, 0), 0, {255, 255, 255});
  EXPECT_LT(paper, 4);
  EXPECT_LT(colourDistance(image, at, 3, kWallGrey), 110);
}

TEST(Overview, DrawsTheWholeSceneInTheRequestedSize) {
  SyntheticRun drive;
  RunRecorder run;
  drive.drive(run);
  OverviewStyle style;
  style.width_px = 900;
  style.title = "Rundgang f\u00fcr die F\u00fctterung";
  const std::string png = renderOverview(run, drive.scene(), style);
  const cv::Mat image = decoded(png);
  ASSERT_EQ(image.cols, 900);
  EXPECT_GT(image.rows, 300);
  EXPECT_LT(image.rows, 900);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(image, mean, deviation);
  EXPECT_GT(deviation[0], 10.0);
  EXPECT_EQ(png, renderOverview(run, drive.scene(), style)) << "same input, other bytes";
}

TEST(Overview, OneWildFixDoesNotShrinkTheRest) {
  RunRecorder run;
  driveEast(run);
  Scene scene;
  scene.gnss_fixes = {Point2(10, 0.2), Point2(9000, -40000)};
  const cv::Mat image = decoded(renderOverview(run, scene, onePixelPerLayoutPixel()));
  const double px_per_m = 1124.0 / 22.4;
  EXPECT_LT(colourDistance(image, {563.0 + 5.0 * px_per_m, 226.0}, 1, kOrange), 12);
}

TEST(Overview, SurvivesEmptyDegenerateAndHugeRuns) {
  EXPECT_FALSE(decoded(renderOverview(RunRecorder{}, {})).empty());
  for (const double extent : {0.0, 1e-9, 3000.0, 5e6, 1e30}) {
    RunRecorder run;
    for (int i = 0; i < 50; ++i) {
      PoseEvent event{timestampFromSeconds(i), PoseSource::kParticles, Mode::kLost, {}};
      event.T.mean = Pose2(extent * i / 50.0, -extent, 0.3);
      event.T.cov = Eigen::Matrix3d::Identity() * (i % 2 == 0 ? 1e12 : -1.0);
      run.onPose(event);
    }
    OverviewStyle style;
    style.width_px = 400;
    const cv::Mat image = decoded(renderOverview(run, {}, style));
    EXPECT_EQ(image.cols, 400) << "extent " << extent;
  }
}

TEST(Photo, ShowsTheScanAroundTheRobot) {
  PhotoView view;
  view.T_map_base = Pose2(100.0, -50.0, 90.0 * kRadPerDeg);
  view.size_px = 540;
  view.radius_m = 9.0;
  view.p_base_scan = {Point2(6.0, 0.0), Point2(0.0, 3.0)};
  view.waypoint = "feeding 1";
  view.stamp = timestampFromSeconds(12.5);
  const cv::Mat image = decoded(renderPhoto(view, {}));
  ASSERT_EQ(image.cols, 540);
  ASSERT_EQ(image.rows, 600);
  const cv::Vec3i red(0xb0, 0x10, 0x1f);
  // Facing north: ahead is up, left is west. 30 px per metre.
  EXPECT_LT(colourDistance(image, {270.0, 270.0 - 180.0}, 1, red), 30);
  EXPECT_LT(colourDistance(image, {270.0 - 90.0, 270.0}, 1, red), 30);
  EXPECT_GT(colourDistance(image, {270.0 + 90.0, 270.0}, 3, red), 60);
}

TEST(WriteFile, LeavesNothingHalfWritten) {
  const auto folder = std::filesystem::path(testing::TempDir()) / "gui_headless_write_test";
  std::filesystem::create_directories(folder);
  const std::string path = (folder / "a.png").string();
  writeFile(path, "abc");
  EXPECT_EQ(pictureFromFile(path, "three letters").png, "abc");
  EXPECT_FALSE(std::filesystem::exists(path + ".part"));
  std::filesystem::remove_all(folder);
  EXPECT_THROW(writeFile(path, "abc"), InputError);
  EXPECT_THROW((void)pictureFromFile(path, ""), InputError);
}

}  // namespace
}  // namespace vestibule::gui_headless
