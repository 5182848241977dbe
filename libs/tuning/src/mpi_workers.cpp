#include "vestibule/tuning/mpi_workers.hpp"

// Of Open MPI only its C interface.
#define OMPI_SKIP_MPICXX 1
#include <mpi.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <deque>
#include <future>
#include <optional>
#include <thread>

#include "outcome_json.hpp"

namespace vestibule::tuning {
namespace {

constexpr int kHello = 1;   // rank -> 0: process id and host, once
constexpr int kTask = 2;    // 0 -> rank
constexpr int kResult = 3;  // rank -> 0
constexpr int kEnd = 4;     // 0 -> rank

/// A rank on another machine is given up when it takes so many times as long as the slowest so far.
constexpr double kPatience = 20.0;
constexpr double kLeastPatience_s = 120.0;
/// Between two looks for a message: of a rank that has nothing else to do, and of rank 0, which
/// works meanwhile.
constexpr auto kPollIdle = std::chrono::microseconds(200);
constexpr auto kPollAtWork = std::chrono::milliseconds(1);

using Clock = std::chrono::steady_clock;
using Host = std::array<char, 64>;

Host thisHost() {
  Host host{};
  gethostname(host.data(), host.size() - 1);
  return host;
}

struct Hello {
  pid_t pid = 0;
  Host host{};
};

void send(int rank, int tag, const std::string& bytes) {
  MPI_Send(bytes.data(), static_cast<int>(bytes.size()), MPI_CHAR, rank, tag, MPI_COMM_WORLD);
}

std::string receive(const MPI_Status& probed) {
  int size = 0;
  MPI_Get_count(&probed, MPI_CHAR, &size);
  std::string bytes(static_cast<std::size_t>(size), '\0');
  MPI_Recv(
      bytes.data(),
      size,
      MPI_CHAR,
      probed.MPI_SOURCE,
      probed.MPI_TAG,
      MPI_COMM_WORLD,
      MPI_STATUS_IGNORE);
  return bytes;
}

/// Number of the task among those handed out at all, and the task.
std::string packed(std::uint64_t number, const Task& task) {
  nlohmann::ordered_json json;
  json["number"] = number;
  json["values"] = task.values;
  json["role"] = static_cast<int>(task.role);
  json["drive"] = task.run.drive;
  json["seed"] = task.run.seed;
  json["folder"] = task.folder;
  return json.dump();
}

}  // namespace

bool launchedByMpi() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK"}) {
    if (std::getenv(name) != nullptr) return true;
  }
  return false;
}

MpiWorld::MpiWorld() {
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);
  MPI_Comm_set_errhandler(MPI_COMM_WORLD, MPI_ERRORS_RETURN);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
}

MpiWorld::~MpiWorld() {
  // Finalizing waits for every rank, also for one that is gone.
  if (complete_) MPI_Finalize();
}

/// A rank, as rank 0 sees it.
struct Other {
  int rank = 0;
  bool lost = false;
  std::optional<Hello> hello;
  std::optional<std::size_t> task;  ///< index in the present list
  std::uint64_t number = 0;
  Clock::time_point since;
};

struct MpiWorkers::Impl {
  Impl(const TaskRunner& r, MpiWorld& w) : runner(r), world(w) {
    for (int rank = 1; rank < world.size(); ++rank) others.push_back({rank, false, {}, {}, 0, {}});
  }

  const TaskRunner& runner;
  MpiWorld& world;
  std::vector<Other> others;
  std::uint64_t next_number = 0;
  double slowest_s = 0.0;

  void giveUp(Other& other, std::deque<std::size_t>& waiting) {
    other.lost = true;
    world.loseRank();
    if (other.task) waiting.push_front(*other.task);
    other.task.reset();
  }

  [[nodiscard]] bool gone(const Other& other) const {
    if (other.hello && other.hello->host == thisHost() && kill(other.hello->pid, 0) != 0) {
      return true;
    }
    if (!other.task) return false;
    const double waited_s = std::chrono::duration<double>(Clock::now() - other.since).count();
    return waited_s > std::max(kLeastPatience_s, kPatience * slowest_s);
  }

  /// Takes what has come; outcomes of ranks that were given up are dropped.
  bool collect(std::vector<std::optional<Outcome>>& outcomes) {
    int there = 0;
    MPI_Status status;
    MPI_Iprobe(MPI_ANY_SOURCE, MPI_ANY_TAG, MPI_COMM_WORLD, &there, &status);
    if (there == 0) return false;
    const std::string bytes = receive(status);
    Other& other = others[static_cast<std::size_t>(status.MPI_SOURCE - 1)];
    if (status.MPI_TAG == kHello && bytes.size() == sizeof(Hello)) {
      other.hello.emplace();
      std::copy(bytes.begin(), bytes.end(), reinterpret_cast<char*>(&*other.hello));
      return true;
    }
    const auto json = nlohmann::ordered_json::parse(bytes);
    if (other.lost || !other.task || json.at("number") != other.number) return true;
    slowest_s =
        std::max(slowest_s, std::chrono::duration<double>(Clock::now() - other.since).count());
    outcomes[*other.task] = outcomeFrom(json);
    other.task.reset();
    return true;
  }
};

MpiWorkers::MpiWorkers(const TaskRunner& runner, MpiWorld& world)
    : impl_(std::make_unique<Impl>(runner, world)) {}

MpiWorkers::~MpiWorkers() {
  for (const Other& other : impl_->others) {
    if (!other.lost) send(other.rank, kEnd, "");
  }
}

std::vector<Outcome> MpiWorkers::run(
    const std::vector<Task>& tasks, const Heartbeat& heartbeat, const Done& done) {
  std::deque<std::size_t> waiting;
  for (std::size_t i = 0; i < tasks.size(); ++i) waiting.push_back(i);
  std::vector<std::optional<Outcome>> outcomes(tasks.size());
  // Rank 0 works as well, in a thread that knows nothing of MPI.
  std::future<Outcome> own;
  std::size_t own_task = 0;
  std::size_t told = 0;
  auto beat = Clock::now() - kHeartbeatEvery;
  while (told < tasks.size()) {
    while (impl_->collect(outcomes)) {
    }
    for (Other& other : impl_->others) {
      if (!other.lost && impl_->gone(other)) impl_->giveUp(other, waiting);
      // Until it has said hello it is still reading its recordings.
      if (other.lost || other.task || !other.hello || waiting.empty()) continue;
      other.task = waiting.front();
      waiting.pop_front();
      other.number = impl_->next_number++;
      other.since = Clock::now();
      send(other.rank, kTask, packed(other.number, tasks[*other.task]));
    }
    if (own.valid() && own.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
      outcomes[own_task] = own.get();
    }
    if (!own.valid() && !waiting.empty()) {
      own_task = waiting.front();
      waiting.pop_front();
      own = std::async(
          std::launch::async, [this, &task = tasks[own_task]] { return impl_->runner.run(task); });
    }
    for (; told < tasks.size() && outcomes[told]; ++told) done(told, *outcomes[told]);
    if (Clock::now() - beat >= kHeartbeatEvery) {
      beat = Clock::now();
      heartbeat();
    }
    if (own.valid()) {
      own.wait_for(kPollAtWork);
    } else if (told < tasks.size()) {
      std::this_thread::sleep_for(kPollIdle);
    }
  }
  std::vector<Outcome> result;
  for (auto& outcome : outcomes) result.push_back(std::move(*outcome));
  return result;
}

std::string MpiWorkers::text() const {
  const auto lost = std::count_if(
      impl_->others.begin(), impl_->others.end(), [](const Other& o) { return o.lost; });
  return std::to_string(impl_->world.size()) + " MPI ranks" +
         (lost > 0 ? " (" + std::to_string(lost) + " lost on the way)" : "");
}

void serveTasks(const TaskRunner& runner, const MpiWorld& world) {
  if (world.rank() == 0) return;
  const Hello hello{getpid(), thisHost()};
  send(0, kHello, {reinterpret_cast<const char*>(&hello), sizeof hello});
  for (;;) {
    MPI_Status status;
    int there = 0;
    // Blocking receives of Open MPI spin; a core is worth more than a millisecond.
    while (MPI_Iprobe(0, MPI_ANY_TAG, MPI_COMM_WORLD, &there, &status) == MPI_SUCCESS &&
           there == 0) {
      std::this_thread::sleep_for(kPollIdle);
    }
    if (there == 0) return;
    const std::string bytes = receive(status);
    if (status.MPI_TAG == kEnd) return;
    const auto json = nlohmann::ordered_json::parse(bytes);
    Task task;
    task.values = json.at("values").get<std::vector<double>>();
    task.role = static_cast<Role>(json.at("role").get<int>());
    task.run = {json.at("drive").get<std::size_t>(), json.at("seed").get<std::uint64_t>()};
    task.folder = json.at("folder").get<std::string>();
    const Outcome outcome = runner.run(task);
    auto answer = toJson(outcome);
    answer["cpu_s"] = outcome.cpu_s;
    answer["number"] = json.at("number");
    send(0, kResult, answer.dump());
  }
}

}  // namespace vestibule::tuning
