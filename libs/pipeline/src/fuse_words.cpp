#include "fuse_words.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "vestibule/core/angles.hpp"
#include "vestibule/pipeline/gnss_input.hpp"

namespace vestibule::pipeline {
namespace {

constexpr double kGap_s = 5.0;        ///< shorter silence of the receiver is not worth a word
constexpr std::size_t kFewFixes = 3;  ///< fewer refused in a row are counted together
constexpr double kMove_m = 5.0;       ///< a smaller step of the estimate is not worth a word
constexpr double kScaleNews = 0.03;   ///< [-] wheel scale, [rad] heading offset: from here on
constexpr double kOffsetNews_rad = degToRad(4.0);

template <class... Args>
std::string format(const char* pattern, Args... args) {
  char text[200];
  std::snprintf(text, sizeof text, pattern, args...);
  return text;
}

}  // namespace

std::string FuseWords::span(Timestamp from, Timestamp to) const {
  return format("%.0f-%.0f s", toSeconds(from - start_), toSeconds(to - start_));
}

void FuseWords::fix(
    Timestamp stamp,
    const Eigen::Vector2d& p_map_antenna,
    const ekf::UpdateReport& report,
    double moved_m) {
  if (last_fix_ && toSeconds(stamp - *last_fix_) > kGap_s) {
    closeRefusals();
    text_.push_back(
        "GNSS " + span(*last_fix_, stamp) +
        format(" silent; the fix after it moved the estimate by %.1f m", moved_m));
  }
  last_fix_ = stamp;
  if (report.reason == "not ready") return;
  if (wasUsed(report)) {
    closeRefusals();
    if (report.reason == "reset" || moved_m > kMove_m) {
      text_.push_back(format(
          "at %.0f s the estimate moved by %.1f m%s",
          toSeconds(stamp - start_),
          moved_m,
          report.reason == "reset" ? " to a new cluster of fixes" : ""));
    }
    last_used_ = stamp;
    last_used_at_ = p_map_antenna;
    return;
  }
  if (!refusals_) {
    refusals_ = Refusals{stamp, stamp, 0, 0.0, 0.0, report.reason};
    if (last_used_ && stamp > *last_used_) {
      refusals_->implied_mps =
          (p_map_antenna - last_used_at_).norm() / toSeconds(stamp - *last_used_);
    }
  }
  refusals_->last = stamp;
  ++refusals_->count;
  if (report.gate > 0.0) {
    refusals_->worst_ratio = std::max(refusals_->worst_ratio, report.nis / report.gate);
  }
}

void FuseWords::closeRefusals() {
  if (!refusals_) return;
  const Refusals r = *refusals_;
  refusals_.reset();
  if (r.count < kFewFixes && r.implied_mps < 10.0) {
    short_refusals_ += r.count;
    return;
  }
  text_.push_back(
      "GNSS " + span(r.first, r.last) +
      format(
          " refused (%s): %zu fixes, the first implied %.0f m/s, the farthest %.0f times the gate",
          r.reason.c_str(),
          r.count,
          r.implied_mps,
          r.worst_ratio));
}

void FuseWords::heading(Timestamp /*stamp*/, const ekf::UpdateReport& report) {
  if (report.reason == "relearn") ++heading_relearned_;
}

std::vector<std::string> FuseWords::text() const {
  FuseWords closed = *this;
  closed.closeRefusals();
  if (closed.short_refusals_ > 0) {
    closed.text_.push_back(
        format("%zu more fixes were refused alone or in pairs", closed.short_refusals_));
  }
  if (heading_relearned_ > 0) {
    closed.text_.push_back(format(
        "the heading sensor jumped %zu times; its offset was learnt anew each time",
        heading_relearned_));
  }
  return closed.text_;
}

std::vector<std::string> aboutSensors(const ekf::State& x, const ekf::StateMatrix& P) {
  std::vector<std::string> text;
  const auto sigma = [&P](int i) { return std::sqrt(std::max(0.0, P(i, i))); };
  const double scale_sigma = sigma(ekf::kWheelScale);
  if (std::abs(x.wheel_scale) > kScaleNews && std::abs(x.wheel_scale) > 3.0 * scale_sigma) {
    text.push_back(format(
        "the wheels %s by %.1f +- %.1f %% (radius, slip)",
        x.wheel_scale < 0.0 ? "over-count" : "under-count",
        100.0 * std::abs(std::expm1(-x.wheel_scale)),
        100.0 * scale_sigma));
  }
  const double offset_sigma = sigma(ekf::kHeadingOffset);
  if (std::abs(x.heading_offset) > kOffsetNews_rad &&
      std::abs(x.heading_offset) > 3.0 * offset_sigma) {
    text.push_back(format(
        "the heading sensor disagrees with the course by %.1f +- %.1f deg (mounting, declination "
        "or sign)",
        radToDeg(x.heading_offset),
        radToDeg(offset_sigma)));
  }
  return text;
}

}  // namespace vestibule::pipeline
