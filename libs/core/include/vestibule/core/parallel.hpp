#pragma once

#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

namespace vestibule {

/// Threads to use where a parameter says 0: one per core.
[[nodiscard]] inline std::size_t threadCount(int wanted) {
  if (wanted > 0) return static_cast<std::size_t>(wanted);
  const unsigned cores = std::thread::hardware_concurrency();
  return cores > 0 ? cores : 1;
}

/// Calls body(i) once for each i in [0, n) on up to `threads` threads (the caller's among them), in
/// no particular order: the result must not depend on it. Returns when all are done.
/// \pre body does not throw
template <class Body>
void parallelFor(std::size_t n, std::size_t threads, const Body& body) {
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < n; i = next++) body(i);
  };
  std::vector<std::thread> others;
  for (std::size_t t = 1; t < threads && t < n; ++t) others.emplace_back(work);
  work();
  for (std::thread& thread : others) thread.join();
}

}  // namespace vestibule
