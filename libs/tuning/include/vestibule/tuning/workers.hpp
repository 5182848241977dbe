#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "vestibule/tuning/scoring.hpp"
#include "vestibule/tuning/search_space.hpp"
#include "vestibule/tuning/subject.hpp"

namespace vestibule::tuning {

/// One run to be done somewhere: a candidate on one drive with one seed.
struct Task {
  std::vector<double> values;  ///< what makes the configuration, see ConfigOf
  Role role = Role::kTraining;
  Case run;
  std::string folder;  ///< where the run leaves its trajectory and map; empty = nowhere
};

/// The configuration of a task's values. May throw.
using ConfigOf = std::function<pipeline::Config(const std::vector<double>&)>;

/// Does a task. Never throws: what goes wrong is in the outcome.
class TaskRunner {
 public:
  /// \param subject  outlives the runner
  TaskRunner(ConfigOf config_of, const Subject& subject, const Limits& limits = {})
      : config_of_(std::move(config_of)), subject_(subject), limits_(limits) {}
  [[nodiscard]] Outcome run(const Task& task) const;

 private:
  ConfigOf config_of_;
  const Subject& subject_;
  Limits limits_;
};

/// Of the candidates of a session. \pre both outlive it
[[nodiscard]] ConfigOf configOfCandidate(const Session& session, const SearchSpace& space);

/// Told now and then while tasks are being done; may throw to end the run.
using Heartbeat = std::function<void()>;
/// It is told so often while nothing gets done.
inline constexpr auto kHeartbeatEvery = std::chrono::milliseconds(100);
/// Told of every outcome in the order of the tasks, as soon as all before it are known.
using Done = std::function<void(std::size_t, const Outcome&)>;

/// Where tasks are done. The outcomes do not depend on it.
class Workers {
 public:
  Workers() = default;
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;
  virtual ~Workers() = default;

  /// One outcome per task, in their order. Both functions are called in the caller's thread.
  virtual std::vector<Outcome> run(
      const std::vector<Task>& tasks, const Heartbeat& heartbeat, const Done& done) = 0;
  /// "2 threads".
  [[nodiscard]] virtual std::string text() const = 0;
};

/// Threads of this process.
class ThreadWorkers : public Workers {
 public:
  ThreadWorkers(const TaskRunner& runner, std::size_t threads);
  std::vector<Outcome> run(
      const std::vector<Task>& tasks, const Heartbeat& heartbeat, const Done& done) override;
  [[nodiscard]] std::string text() const override;

 private:
  const TaskRunner& runner_;
  std::size_t threads_;
};

}  // namespace vestibule::tuning
