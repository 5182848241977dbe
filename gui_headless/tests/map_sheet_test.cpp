#include "vestibule/gui_headless/map_sheet.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

namespace vestibule::gui_headless {
namespace {

grid::OccupancyMap room(int width, int height) {
  std::vector<grid::Cell> cells(
      static_cast<std::size_t>(width) * static_cast<std::size_t>(height), grid::Cell::kFree);
  for (int x = 0; x < width; ++x) cells[static_cast<std::size_t>(x)] = grid::Cell::kOccupied;
  return grid::OccupancyMap::fromCells(width, height, 0.1, {0.0, 0.0}, cells);
}

cv::Mat decoded(const std::string& png) {
  return cv::imdecode(std::vector<unsigned char>(png.begin(), png.end()), cv::IMREAD_GRAYSCALE);
}

TEST(MapSheet, PutsMapsInRowsOfOneScale) {
  const grid::OccupancyMap large = room(60, 40);
  const grid::OccupancyMap small = room(30, 20);
  const cv::Mat one = decoded(renderMapSheet({{&large, {"a"}}}, 3));
  const cv::Mat row = decoded(renderMapSheet({{&large, {"a"}}, {&small, {"b"}}}, 3));
  const cv::Mat column = decoded(renderMapSheet({{&large, {"a"}}, {&small, {"b"}}}, 1));
  ASSERT_FALSE(one.empty() || row.empty() || column.empty());
  EXPECT_GT(row.cols, 1.8 * one.cols);
  EXPECT_EQ(row.rows, one.rows);
  EXPECT_EQ(column.cols, one.cols);
  EXPECT_GT(column.rows, 1.8 * one.rows);
  // The wall of the large map is twice as long: dark pixels in the halves of the row.
  const auto dark = [&row](int from, int to) {
    return cv::countNonZero(row(cv::Rect(from, row.rows / 2, to - from, row.rows / 3)) < 120);
  };
  EXPECT_GT(dark(0, row.cols / 2), dark(row.cols / 2, row.cols));
  EXPECT_TRUE(renderMapSheet({}, 3).empty());
}

TEST(MapSheet, DrawsMarksWhereTheyHappened) {
  const grid::OccupancyMap map = room(60, 40);
  const MapPanel plain{&map, {}};
  MapPanel marked = plain;
  marked.marks = {{{1.0, 2.0}, MapMark::Look::kGood}, {{5.0, 3.0}, MapMark::Look::kBad}};
  constexpr double kWidth = 400.0;
  const cv::Mat without = decoded(renderMapSheet({plain}, 1, kWidth));
  const cv::Mat with = decoded(renderMapSheet({marked}, 1, kWidth));
  ASSERT_EQ(with.size(), without.size());
  EXPECT_GT(with.cols, 500) << "1.5 pixels per unit of the page";
  cv::Mat changed;
  cv::absdiff(with, without, changed);
  const auto in = [&changed](int from, int to) {
    return cv::countNonZero(changed(cv::Rect(from, 0, to - from, changed.rows)) > 30);
  };
  // One mark in each half, the bad one larger, and nothing between them.
  EXPECT_GT(in(0, with.cols / 3), 10);
  EXPECT_EQ(in(with.cols / 3, 2 * with.cols / 3), 0);
  EXPECT_GT(in(2 * with.cols / 3, with.cols), in(0, with.cols / 3));
}

}  // namespace
}  // namespace vestibule::gui_headless
