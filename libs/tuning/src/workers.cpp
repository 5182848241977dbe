#include "vestibule/tuning/workers.hpp"

#include <time.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>

namespace vestibule::tuning {
namespace {

/// Of this thread.
double cpuSeconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// Threads that take one task after the other. No new one is begun once this goes.
class Crew {
 public:
  Crew(const TaskRunner& runner, const std::vector<Task>& tasks, std::size_t threads)
      : runner_(runner), tasks_(tasks), outcomes_(tasks.size()) {
    for (std::size_t t = 0; t < std::min(threads, tasks.size()); ++t) {
      threads_.emplace_back([this] { work(); });
    }
  }
  Crew(const Crew&) = delete;
  Crew& operator=(const Crew&) = delete;
  ~Crew() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      next_ = tasks_.size();
    }
    for (std::thread& thread : threads_) thread.join();
  }

  /// Waits for an outcome, but not for long.
  [[nodiscard]] std::optional<Outcome> await(std::size_t i) {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait_for(lock, kHeartbeatEvery, [&] { return outcomes_[i].has_value(); });
    return outcomes_[i];
  }

 private:
  void work() {
    std::unique_lock<std::mutex> lock(mutex_);
    while (next_ < tasks_.size()) {
      const std::size_t i = next_++;
      lock.unlock();
      Outcome outcome = runner_.run(tasks_[i]);
      lock.lock();
      outcomes_[i] = std::move(outcome);
      changed_.notify_one();
    }
  }

  const TaskRunner& runner_;
  const std::vector<Task>& tasks_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<std::optional<Outcome>> outcomes_;
  std::size_t next_ = 0;
  std::vector<std::thread> threads_;
};

}  // namespace

ConfigOf configOfCandidate(const Session& session, const SearchSpace& space) {
  return [&session, &space](const std::vector<double>& values) {
    return withValues(session.base, space.named(values));
  };
}

Outcome TaskRunner::run(const Task& task) const {
  Outcome outcome;
  const double before_s = cpuSeconds();
  double data_s = 0.0;
  try {
    outcome = subject_.run(
        config_of_(task.values), task.role, task.run.drive, task.run.seed, task.folder);
    data_s = subject_.seconds(task.role, task.run.drive);
  } catch (const std::exception& e) {
    outcome.failure = e.what();
    return outcome;
  }
  outcome.cpu_s = cpuSeconds() - before_s;
  const double used = 1e3 * outcome.cpu_s / std::max(data_s, 1e-3);
  if (outcome.failure.empty() && limits_.cpu_ms_per_data_s > 0.0 &&
      used > limits_.cpu_ms_per_data_s) {
    outcome.failure = "needs " + shortNumber(used) +
                      " ms of CPU per second of data, the limit is " +
                      shortNumber(limits_.cpu_ms_per_data_s);
  }
  return outcome;
}

ThreadWorkers::ThreadWorkers(const TaskRunner& runner, std::size_t threads)
    : runner_(runner), threads_(threads) {}

std::vector<Outcome> ThreadWorkers::run(
    const std::vector<Task>& tasks, const Heartbeat& heartbeat, const Done& done) {
  std::vector<Outcome> outcomes;
  Crew crew(runner_, tasks, threads_);
  while (outcomes.size() < tasks.size()) {
    auto outcome = crew.await(outcomes.size());
    heartbeat();
    if (!outcome) continue;
    outcomes.push_back(std::move(*outcome));
    done(outcomes.size() - 1, outcomes.back());
  }
  return outcomes;
}

std::string ThreadWorkers::text() const {
  return std::to_string(threads_) + (threads_ == 1 ? " thread" : " threads");
}

}  // namespace vestibule::tuning
