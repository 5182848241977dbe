#pragma once

#include <functional>
#include <string>
#include <vector>

#include "vestibule/tuning/scoring.hpp"
#include "vestibule/tuning/search_space.hpp"
#include "vestibule/tuning/subject.hpp"

namespace vestibule::tuning {

/// One run to be done somewhere: a candidate on one drive with one seed.
struct Task {
  std::vector<double> values;  ///< of the tuned parameters
  Role role = Role::kTraining;
  Case run;
};

/// Does a task. Never throws: what goes wrong is in the outcome.
class TaskRunner {
 public:
  /// All outlive the runner.
  TaskRunner(const Session& session, const SearchSpace& space, const Subject& subject)
      : session_(session), space_(space), subject_(subject) {}
  [[nodiscard]] Outcome run(const Task& task) const;

 private:
  const Session& session_;
  const SearchSpace& space_;
  const Subject& subject_;
};

/// Told now and then while tasks are being done; may throw to end the run.
using Heartbeat = std::function<void()>;

/// Where tasks are done. The outcomes do not depend on it.
class Workers {
 public:
  Workers() = default;
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;
  virtual ~Workers() = default;

  /// One outcome per task, in their order.
  [[nodiscard]] virtual std::vector<Outcome> run(
      const std::vector<Task>& tasks, const Heartbeat& heartbeat) = 0;
  /// "2 threads".
  [[nodiscard]] virtual std::string text() const = 0;
};

/// Threads of this process.
class ThreadWorkers : public Workers {
 public:
  ThreadWorkers(const TaskRunner& runner, std::size_t threads);
  [[nodiscard]] std::vector<Outcome> run(
      const std::vector<Task>& tasks, const Heartbeat& heartbeat) override;
  [[nodiscard]] std::string text() const override;

 private:
  const TaskRunner& runner_;
  std::size_t threads_;
};

}  // namespace vestibule::tuning
