#pragma once

#include <string>
#include <vector>

#include "vestibule/gui_headless/overview.hpp"
#include "vestibule/gui_headless/run_recorder.hpp"
#include "vestibule/gui_headless/scene.hpp"

namespace vestibule::gui_headless {

/// One measured number and what it is held against. All text is plain and gets escaped.
struct Figure {
  enum class Verdict { kNone, kGood, kBad };
  std::string label;
  std::string value;
  std::string unit;
  std::string bar;  ///< e.g. "<= 0.16", without the unit
  Verdict verdict = Verdict::kNone;
  std::string note;
};

struct Picture {
  std::string caption;
  std::string png;  ///< bytes
};
/// Throws InputError when the file cannot be read.
[[nodiscard]] Picture pictureFromFile(const std::string& path, const std::string& caption);

struct Table {
  std::string title;
  std::vector<std::string> header;
  std::vector<std::vector<std::string>> rows;
};

/// Shown in this order.
struct ReportSection {
  std::string title;
  std::string text;                ///< paragraphs separated by an empty line
  std::vector<Figure> highlights;  ///< a row of large numbers; the note becomes the small print
  std::vector<Figure> figures;     ///< a table with bars and verdicts
  std::vector<Picture> pictures;
  std::vector<std::string> charts;  ///< SVG from charts.hpp, inserted as it is
  std::vector<Table> tables;
};

struct Report {
  std::string title;
  std::string subtitle;
  std::string command_line;     ///< what to type to get this report again
  std::vector<Figure> summary;  ///< table on top; empty = none
  std::vector<ReportSection> sections;
  std::string footer;
};

/// One HTML page without any outside resource: styles, charts and pictures are inside.
/// Same report, same bytes.
[[nodiscard]] std::string renderReport(const Report& report);

/// The standard section of a run: headline numbers, overview picture, mode timeline, position and
/// yaw error over time where there is a reference, NIS per sensor, updates per sensor, mode
/// changes with their reasons, mission log and warnings. `figures` is left for the caller.
[[nodiscard]] ReportSection sectionFromRun(
    const RunRecorder& run,
    const Scene& scene,
    const std::string& title,
    const OverviewStyle& style = {});

}  // namespace vestibule::gui_headless
