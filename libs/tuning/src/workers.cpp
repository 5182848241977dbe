#include "vestibule/tuning/workers.hpp"

#include <time.h>

#include <exception>

#include "vestibule/core/parallel.hpp"

namespace vestibule::tuning {
namespace {

/// Of this thread.
double cpuSeconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace

Outcome TaskRunner::run(const Task& task) const {
  Outcome outcome;
  const double before_s = cpuSeconds();
  double data_s = 0.0;
  try {
    const pipeline::Config config = withValues(session_.base, space_.named(task.values));
    outcome = subject_.run(config, task.role, task.run.drive, task.run.seed);
    data_s = subject_.seconds(task.role, task.run.drive);
  } catch (const std::exception& e) {
    outcome.failure = e.what();
    return outcome;
  }
  const double limit = session_.limits.cpu_ms_per_data_s;
  const double used = 1e3 * (cpuSeconds() - before_s) / std::max(data_s, 1e-3);
  if (outcome.failure.empty() && limit > 0.0 && used > limit) {
    outcome.failure = "needs " + shortNumber(used) +
                      " ms of CPU per second of data, the limit is " + shortNumber(limit);
  }
  return outcome;
}

ThreadWorkers::ThreadWorkers(const TaskRunner& runner, std::size_t threads)
    : runner_(runner), threads_(threads) {}

std::vector<Outcome> ThreadWorkers::run(
    const std::vector<Task>& tasks, const Heartbeat& heartbeat) {
  std::vector<Outcome> outcomes(tasks.size());
  // In portions, so that the heart beats between them.
  const std::size_t portion = threads_ * 4;
  for (std::size_t from = 0; from < tasks.size(); from += portion) {
    const std::size_t n = std::min(portion, tasks.size() - from);
    parallelFor(
        n, threads_, [&](std::size_t i) { outcomes[from + i] = runner_.run(tasks[from + i]); });
    heartbeat();
  }
  return outcomes;
}

std::string ThreadWorkers::text() const {
  return std::to_string(threads_) + (threads_ == 1 ? " thread" : " threads");
}

}  // namespace vestibule::tuning
