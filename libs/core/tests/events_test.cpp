#include "vestibule/core/events.hpp"

#include <gtest/gtest.h>

namespace vestibule {
namespace {

class Recorder : public Observer {
 public:
  Recorder(std::string name, std::vector<std::string>& log) : name_(std::move(name)), log_(log) {}
  void onMode(const ModeEvent& event) override { log_.push_back(name_ + ":" + event.reason); }
  void onPose(const PoseEvent& event) override {
    log_.push_back(name_ + ":" + std::string(toString(event.source)));
  }

 private:
  std::string name_;
  std::vector<std::string>& log_;
};

TEST(Events, ReachEveryObserverInOrderOfAttachment) {
  std::vector<std::string> log;
  Recorder first("first", log);
  Recorder second("second", log);
  Observers observers;
  observers.attach(first);
  observers.attach(second);
  ModeEvent mode;
  mode.reason = "roof";
  observers.emit(mode);
  observers.emit(PoseEvent{});
  EXPECT_EQ(
      log,
      (std::vector<std::string>{
          "first:roof", "second:roof", "first:published", "second:published"}));
}

}  // namespace
}  // namespace vestibule
