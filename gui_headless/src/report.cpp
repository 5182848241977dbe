#include "vestibule/gui_headless/report.hpp"

#include <string_view>

#include "palette.hpp"
#include "text.hpp"

namespace vestibule::gui_headless {
namespace {

constexpr std::string_view kStyle = R"css(
:root { --ink: #1c2733; --muted: #5f6b78; --line: #dfe4ea; --ground: #f3f5f8; --accent: #0072b2;
  --good: #0b7a53; --good-bg: #e4f4ed; --bad: #b0101f; --bad-bg: #fbe8ea; }
* { box-sizing: border-box; }
html { scroll-behavior: smooth; }
body { margin: 0; background: var(--ground); color: var(--ink);
  font: 15px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", "Noto Sans",
  "DejaVu Sans", Arial, sans-serif; -webkit-font-smoothing: antialiased; }
main { max-width: 1180px; margin: 0 auto; padding: 40px 24px 56px; }
header { margin-bottom: 24px; }
h1 { font-size: 30px; line-height: 1.2; font-weight: 650; letter-spacing: -0.015em; margin: 0 0 6px; }
h2 { font-size: 20px; font-weight: 650; letter-spacing: -0.01em; margin: 0 0 14px; }
h3 { font-size: 14px; font-weight: 600; margin: 0; }
.subtitle { color: var(--muted); font-size: 16px; margin: 0; }
.command { display: block; margin: 16px 0 0; padding: 9px 14px; background: #fff;
  border: 1px solid var(--line); border-radius: 8px; overflow-x: auto; white-space: pre;
  font: 13px/1.5 ui-monospace, SFMono-Regular, Menlo, Consolas, "DejaVu Sans Mono", monospace; }
.command::before { content: "$ "; color: var(--muted); }
nav { display: flex; flex-wrap: wrap; gap: 8px; margin: 18px 0 0; }
nav a { color: var(--accent); background: #fff; border: 1px solid var(--line); border-radius: 999px;
  padding: 4px 14px; text-decoration: none; font-size: 14px; }
nav a:hover { border-color: var(--accent); }
section { background: #fff; border: 1px solid var(--line); border-radius: 12px; padding: 24px 26px;
  margin: 0 0 22px; box-shadow: 0 1px 2px rgba(28, 39, 51, 0.04); }
section > :last-child { margin-bottom: 0; }
section p { margin: 0 0 12px; max-width: 78ch; color: #33414f; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(142px, 1fr)); gap: 12px;
  margin: 4px 0 20px; }
.tile { background: var(--ground); border-radius: 10px; padding: 12px 14px; }
.tile .label { color: var(--muted); font-size: 13px; }
.tile .value { font-size: 24px; font-weight: 600; letter-spacing: -0.015em; line-height: 1.3;
  font-variant-numeric: tabular-nums; white-space: nowrap; }
.tile .unit { font-size: 15px; font-weight: 500; color: var(--muted); letter-spacing: 0; }
.tile .note { color: var(--muted); font-size: 12.5px; line-height: 1.35; }
.tile.good .value { color: var(--good); } .tile.bad .value { color: var(--bad); }
.scroll { overflow-x: auto; margin: 0 0 18px; }
table { border-collapse: collapse; width: 100%; font-size: 14px; }
th { text-align: left; color: var(--muted); font-weight: 500; font-size: 13px;
  border-bottom: 1px solid var(--line); padding: 6px 14px 6px 0; white-space: nowrap; }
td { border-bottom: 1px solid #edf0f4; padding: 7px 14px 7px 0; vertical-align: top;
  font-variant-numeric: tabular-nums; }
tr:last-child td { border-bottom: 0; }
td.value { font-weight: 600; white-space: nowrap; } td.value span { font-weight: 400; color: var(--muted); }
td.bar { color: var(--muted); white-space: nowrap; } td.note { color: var(--muted); }
.chip { display: inline-block; border-radius: 999px; padding: 0 10px; font-size: 13px; font-weight: 600;
  white-space: nowrap; }
.chip.good { color: var(--good); background: var(--good-bg); }
.chip.bad { color: var(--bad); background: var(--bad-bg); }
.mode { display: inline-block; width: 10px; height: 10px; border-radius: 3px; margin-right: 7px; }
figure { margin: 4px 0 20px; }
figure img { display: block; max-width: 100%; height: auto; border-radius: 8px; }
.gallery { display: grid; grid-template-columns: repeat(auto-fit, minmax(320px, 1fr)); gap: 0 18px; }
figcaption { color: var(--muted); font-size: 13.5px; margin-top: 6px; }
.chart { display: block; width: 100%; height: auto; margin: 4px 0 16px; font-family: inherit; }
.chart text { font-variant-numeric: tabular-nums; }
details { border-top: 1px solid var(--line); padding: 10px 0 0; margin: 0 0 10px; }
summary { cursor: pointer; margin-bottom: 8px; } summary h3 { display: inline; }
summary .count { color: var(--muted); font-size: 13px; margin-left: 6px; }
footer { color: var(--muted); font-size: 13px; padding: 0 4px; }
@media print { body { background: #fff; } section { break-inside: avoid-page; box-shadow: none; } }
)css";

std::string_view cssClass(Figure::Verdict verdict) {
  switch (verdict) {
    case Figure::Verdict::kGood:
      return "good";
    case Figure::Verdict::kBad:
      return "bad";
    case Figure::Verdict::kNone:
      break;
  }
  return "";
}

// The verdict is said in words and a sign, not by colour alone.
std::string chip(Figure::Verdict verdict) {
  switch (verdict) {
    case Figure::Verdict::kGood:
      return "<span class=\"chip good\">\u2713 met</span>";
    case Figure::Verdict::kBad:
      return "<span class=\"chip bad\">\u2717 missed</span>";
    case Figure::Verdict::kNone:
      break;
  }
  return "";
}

std::string cell(std::string_view tag, std::string_view css_class, const std::string& html) {
  const std::string name(tag);
  const std::string with_class =
      css_class.empty() ? "" : " class=\"" + std::string(css_class) + "\"";
  return "<" + name + with_class + ">" + html + "</" + name + ">";
}

/// "<= 0.16" as people write it.
std::string barText(const Figure& figure) {
  std::string text = figure.bar;
  if (text.rfind("<=", 0) == 0) text.replace(0, 2, "\u2264");
  if (text.rfind(">=", 0) == 0) text.replace(0, 2, "\u2265");
  if (!text.empty() && !figure.unit.empty()) text += " " + figure.unit;
  return text;
}

std::string figureTable(const std::vector<Figure>& figures) {
  bool has_bar = false;
  bool has_verdict = false;
  bool has_note = false;
  for (const Figure& f : figures) {
    has_bar = has_bar || !f.bar.empty();
    has_verdict = has_verdict || f.verdict != Figure::Verdict::kNone;
    has_note = has_note || !f.note.empty();
  }
  std::string out =
      "<div class=\"scroll\"><table>\n<tr>" + cell("th", "", "figure") + cell("th", "", "measured");
  if (has_bar) out += cell("th", "", "bar");
  if (has_verdict) out += cell("th", "", "verdict");
  if (has_note) out += cell("th", "", "remark");
  out += "</tr>\n";
  for (const Figure& f : figures) {
    out += "<tr>" + cell("td", "", escape(f.label)) +
           cell("td", "value", escape(f.value) + " <span>" + escape(f.unit) + "</span>");
    if (has_bar) out += cell("td", "bar", escape(barText(f)));
    if (has_verdict) out += cell("td", "", chip(f.verdict));
    if (has_note) out += cell("td", "note", escape(f.note));
    out += "</tr>\n";
  }
  return out + "</table></div>\n";
}

std::string tiles(const std::vector<Figure>& figures) {
  std::string out = "<div class=\"tiles\">\n";
  for (const Figure& f : figures) {
    const std::string verdict(cssClass(f.verdict));
    out += "<div class=\"tile" + (verdict.empty() ? "" : " " + verdict) + "\">" +
           cell("div", "label", escape(f.label)) +
           cell(
               "div",
               "value",
               escape(f.value) + " <span class=\"unit\">" + escape(f.unit) + "</span>");
    const std::string small = f.note.empty() && !f.bar.empty() ? "bar: " + barText(f) : f.note;
    if (!small.empty()) out += cell("div", "note", escape(small));
    out += "</div>\n";
  }
  return out + "</div>\n";
}

std::string pictureHtml(const Picture& picture) {
  return "<figure><img alt=\"" + escape(picture.caption) + "\" src=\"data:image/png;base64," +
         base64(picture.png) + "\"/>" + cell("figcaption", "", escape(picture.caption)) +
         "</figure>\n";
}

std::string tableHtml(const Table& table) {
  constexpr std::size_t kOpenUpTo = 12;
  std::string out =
      "<details" + std::string(table.rows.size() <= kOpenUpTo ? " open=\"open\"" : "") +
      "><summary><h3>" + escape(table.title) + "</h3><span class=\"count\">" +
      grouped(table.rows.size()) + "</span></summary>\n<div class=\"scroll\"><table>\n<tr>";
  for (const std::string& name : table.header) out += cell("th", "", escape(name));
  out += "</tr>\n";
  for (const auto& row : table.rows) {
    out += "<tr>";
    for (const std::string& value : row) out += cell("td", "", escape(value));
    out += "</tr>\n";
  }
  return out + "</table></div></details>\n";
}

std::string paragraphs(const std::string& text) {
  std::string out;
  std::size_t from = 0;
  while (from < text.size()) {
    std::size_t to = text.find("\n\n", from);
    if (to == std::string::npos) to = text.size();
    if (to > from) out += cell("p", "", escape(text.substr(from, to - from))) + "\n";
    from = to + 2;
  }
  return out;
}

std::string anchor(std::size_t index) { return "s" + std::to_string(index + 1); }

std::string sectionHtml(const ReportSection& section, std::size_t index) {
  std::string out = "<section id=\"" + anchor(index) + "\">\n" +
                    cell("h2", "", escape(section.title)) + "\n" + paragraphs(section.text);
  if (!section.highlights.empty()) out += tiles(section.highlights);
  if (!section.figures.empty()) out += figureTable(section.figures);
  // The first picture is the overview and gets the whole width; further ones stand side by side.
  if (!section.pictures.empty()) out += pictureHtml(section.pictures.front());
  if (section.pictures.size() > 1) {
    out += "<div class=\"gallery\">\n";
    for (std::size_t i = 1; i < section.pictures.size(); ++i) {
      out += pictureHtml(section.pictures[i]);
    }
    out += "</div>\n";
  }
  for (const std::string& chart : section.charts) out += chart;
  for (const Table& table : section.tables) out += tableHtml(table);
  return out + "</section>\n";
}

std::string summaryHtml(const std::vector<Figure>& summary) {
  std::size_t good = 0;
  std::size_t judged = 0;
  for (const Figure& f : summary) {
    if (f.verdict == Figure::Verdict::kNone) continue;
    ++judged;
    if (f.verdict == Figure::Verdict::kGood) ++good;
  }
  std::string out = "<section id=\"summary\">\n<h2>Summary</h2>\n";
  if (judged > 0) {
    const auto all = good == judged ? Figure::Verdict::kGood : Figure::Verdict::kBad;
    out += "<p><span class=\"chip " + std::string(cssClass(all)) + "\">" + std::to_string(good) +
           " of " + std::to_string(judged) + " bars met</span></p>\n";
  }
  return out + figureTable(summary) + "</section>\n";
}

}  // namespace

std::string renderReport(const Report& report) {
  std::string out =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\"/>\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>\n" +
      cell("title", "", escape(report.title)) + "\n<style>" + std::string(kStyle) +
      "</style>\n</head>\n<body>\n<main>\n<header>\n" + cell("h1", "", escape(report.title)) + "\n";
  if (!report.subtitle.empty()) out += cell("p", "subtitle", escape(report.subtitle)) + "\n";
  if (!report.command_line.empty()) {
    out += cell("code", "command", escape(report.command_line)) + "\n";
  }
  if (report.sections.size() > 1) {
    out += "<nav>";
    for (std::size_t i = 0; i < report.sections.size(); ++i) {
      out += "<a href=\"#" + anchor(i) + "\">" + escape(report.sections[i].title) + "</a>";
    }
    out += "</nav>\n";
  }
  out += "</header>\n";
  if (!report.summary.empty()) out += summaryHtml(report.summary);
  for (std::size_t i = 0; i < report.sections.size(); ++i) {
    out += sectionHtml(report.sections[i], i);
  }
  if (!report.footer.empty()) out += cell("footer", "", escape(report.footer)) + "\n";
  return out + "</main>\n</body>\n</html>\n";
}

}  // namespace vestibule::gui_headless
