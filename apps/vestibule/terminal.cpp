#include "terminal.hpp"

#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>

namespace vestibule::app {
namespace {

volatile std::sig_atomic_t interrupt_requested = 0;

std::string command_line;  // for the reports

/// As a shell takes it for one word.
std::string quotedForShell(const std::string& word) {
  const auto plain = [](unsigned char c) {
    return std::isalnum(c) != 0 || std::strchr("_./,:=+-@%", c) != nullptr;
  };
  if (!word.empty() && std::all_of(word.begin(), word.end(), plain)) return word;
  std::string quoted = "'";
  for (const char c : word) {
    if (c == '\'') {
      quoted += "'\\''";
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

void onSignal(int /*signal*/) { interrupt_requested = 1; }

/// Columns a text takes on a terminal: UTF-8 continuation bytes take none.
std::size_t displayWidth(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xC0U) != 0x80U;
  }));
}

}  // namespace

void installSignalHandlers() {
  struct sigaction action = {};
  action.sa_handler = onSignal;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

void checkInterrupted() {
  if (interrupt_requested != 0) throw Interrupted();
}

bool takeInterrupt() {
  const bool requested = interrupt_requested != 0;
  interrupt_requested = 0;
  return requested;
}

void noteCommandLine(int argc, char** argv) {
  command_line = "vestibule";
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--out") ++i;
    if (word == "--out" || word.rfind("--out=", 0) == 0 || word == "--resume") continue;
    command_line += " " + quotedForShell(word);
  }
}

std::string commandLine() { return command_line; }

ProgressBar::ProgressBar(std::string label)
    : label_(std::move(label)),
      start_(std::chrono::steady_clock::now()),
      last_drawn_(start_),
      on_terminal_(isatty(STDERR_FILENO) != 0) {}

ProgressBar::~ProgressBar() {
  if (drawn_) std::fputs("\r\033[K", stderr);
}

pipeline::Progress ProgressBar::callback() {
  return [this](double share, double data_s) {
    checkInterrupted();
    if (on_terminal_) draw(share, data_s);
  };
}

double ProgressBar::wallSeconds() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

void ProgressBar::draw(double share, double data_s) {
  const auto now = std::chrono::steady_clock::now();
  if (now - last_drawn_ < std::chrono::milliseconds(200)) return;
  last_drawn_ = now;
  const double wall_s = wallSeconds();
  constexpr int kWidth = 28;
  const int filled = static_cast<int>(std::lround(std::clamp(share, 0.0, 1.0) * kWidth));
  const std::string bar = std::string(static_cast<std::size_t>(filled), '#') +
                          std::string(static_cast<std::size_t>(kWidth - filled), '.');
  std::string left = "";
  if (share > 0.02) {
    const int s = static_cast<int>(wall_s * (1.0 - share) / share);
    left = ", " + std::to_string(s / 60) + ":" + (s % 60 < 10 ? "0" : "") + std::to_string(s % 60) +
           " left";
  }
  std::fprintf(
      stderr,
      "\r\033[K%s [%s] %3.0f %%  data %.0f s, %.0fx real time%s",
      label_.c_str(),
      bar.c_str(),
      100.0 * std::clamp(share, 0.0, 1.0),
      data_s,
      wall_s > 0.0 ? data_s / wall_s : 0.0,
      left.c_str());
  std::fflush(stderr);
  drawn_ = true;
}

std::string fixed(double value, int decimals) {
  char buffer[64];
  std::snprintf(buffer, sizeof buffer, "%.*f", decimals, value);
  return buffer;
}

std::string textTable(const std::vector<std::vector<std::string>>& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t i = 0; i < row.size(); ++i) {
      widths[i] = std::max(widths[i], displayWidth(row[i]));
    }
  }
  std::string out;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (std::size_t i = 0; i < rows[r].size(); ++i) {
      out += rows[r][i];
      if (i + 1 < rows[r].size()) {
        out += std::string(widths[i] - displayWidth(rows[r][i]) + 2, ' ');
      }
    }
    out += '\n';
    if (r == 0) {
      std::size_t total = 0;
      for (const std::size_t w : widths) total += w + 2;
      out += std::string(total - 2, '-') + '\n';
    }
  }
  return out;
}

}  // namespace vestibule::app
