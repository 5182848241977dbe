#pragma once

#include <cstddef>
#include <thread>
#include <vector>

namespace vestibule::mapping {

/// Calls work(worker, i) once for every i in [0, n), on up to `threads` threads; worker < threads.
/// Which worker takes which i is fixed. The work must not throw.
template <class Work>
void parallelFor(std::size_t threads, std::size_t n, const Work& work) {
  const std::size_t count = threads < n ? threads : n;
  const auto run = [&](std::size_t worker) {
    for (std::size_t i = worker; i < n; i += count) work(worker, i);
  };
  std::vector<std::thread> others;
  for (std::size_t worker = 1; worker < count; ++worker) others.emplace_back(run, worker);
  if (count > 0) run(0);
  for (std::thread& other : others) other.join();
}

}  // namespace vestibule::mapping
