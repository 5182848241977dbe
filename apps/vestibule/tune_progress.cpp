#include "tune_progress.hpp"

#include <unistd.h>

#include <cstdio>
#include <utility>

#include "terminal.hpp"

namespace vestibule::app {

TuneProgress::TuneProgress(std::string journal)
    : journal_(std::move(journal)), on_terminal_(isatty(STDERR_FILENO) != 0) {}

TuneProgress::~TuneProgress() {
  if (drawn_) std::fputs("\r\033[K", stderr);
}

tuning::Callbacks TuneProgress::callbacks() {
  tuning::Callbacks c;
  c.status = [this](const tuning::Status& status) { draw(status); };
  c.stop = [this] { return stopping_; };
  c.heartbeat = [this] {
    if (!takeInterrupt()) return;
    if (stopping_) {
      throw Interrupted(
          "interrupted; what was tried is in " + journal_ +
          ": the same command goes on from there");
    }
    stopping_ = true;
  };
  return c;
}

void TuneProgress::draw(const tuning::Status& status) {
  const auto now = std::chrono::steady_clock::now();
  if (status.stage != stage_) {
    stage_ = status.stage;
    stage_began_ = now;
  }
  if (!on_terminal_ || now - last_drawn_ < std::chrono::milliseconds(200)) return;
  last_drawn_ = now;
  drawn_ = true;
  const double s = std::chrono::duration<double>(now - stage_began_).count();
  const double rate = s > 0.0 ? static_cast<double>(status.done) / s : 0.0;
  std::string left;
  if (rate > 0.0 && status.planned > status.done) {
    const int rest_s = static_cast<int>(static_cast<double>(status.planned - status.done) / rate);
    left = ", " + std::to_string(rest_s / 60) + ":" + (rest_s % 60 < 10 ? "0" : "") +
           std::to_string(rest_s % 60) + " left";
  }
  const std::string best =
      status.best < 1.0 ? ", best " + fixed(status.best, 4) + " of the defaults' cost" : "";
  std::fprintf(
      stderr,
      "\r\033[K%s %zu/%zu%s, %.1f/s%s%s",
      stage_.c_str(),
      status.done,
      status.planned,
      best.c_str(),
      rate,
      left.c_str(),
      stopping_ ? " (stopping)" : "");
  std::fflush(stderr);
}

}  // namespace vestibule::app
