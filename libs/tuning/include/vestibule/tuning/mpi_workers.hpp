#pragma once

#include <memory>
#include <string>
#include <vector>

#include "vestibule/tuning/workers.hpp"

namespace vestibule::tuning {

/// The processes `mpirun` started. Make one per process, before anything else, and only there: see
/// launchedByMpi().
class MpiWorld {
 public:
  MpiWorld();
  MpiWorld(const MpiWorld&) = delete;
  MpiWorld& operator=(const MpiWorld&) = delete;
  /// Ends MPI; where a rank was lost this cannot be done in order, and is left out.
  ~MpiWorld();

  [[nodiscard]] int rank() const { return rank_; }
  [[nodiscard]] int size() const { return size_; }
  void loseRank() { complete_ = false; }
  [[nodiscard]] bool complete() const { return complete_; }

 private:
  int rank_ = 0;
  int size_ = 1;
  bool complete_ = true;
};

/// Whether this process was started by an mpirun (Open MPI, MPICH or Slurm's srun with PMIx).
[[nodiscard]] bool launchedByMpi();

/// Rank 0 hands out tasks one at a time and does some itself. A rank that died (on this machine),
/// or does not answer for much longer than any other took, is given up and its task handed out
/// again.
class MpiWorkers : public Workers {
 public:
  MpiWorkers(const TaskRunner& runner, MpiWorld& world);
  /// Tells the other ranks to end.
  ~MpiWorkers() override;
  std::vector<Outcome> run(
      const std::vector<Task>& tasks, const Heartbeat& heartbeat, const Done& done) override;
  [[nodiscard]] std::string text() const override;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// What the other ranks do until rank 0 ends.
void serveTasks(const TaskRunner& runner, const MpiWorld& world);

}  // namespace vestibule::tuning
