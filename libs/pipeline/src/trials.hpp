#pragma once

#include <atomic>
#include <cstddef>

#include "vestibule/core/parallel.hpp"
#include "vestibule/pipeline/progress.hpp"

namespace vestibule::pipeline {

/// Calls body(i, worker) for all trials side by side.
template <class Body>
void runTrials(std::size_t n, std::size_t workers, const Progress& progress, const Body& body) {
  std::atomic<std::size_t> next{0};
  std::atomic<std::size_t> done{0};
  parallelFor(workers, workers, [&](std::size_t worker) {
    for (std::size_t i = next++; i < n; i = next++) {
      body(i, worker);
      ++done;
      // The first worker is the caller's thread, which may draw.
      if (worker == 0) progress(static_cast<double>(done) / static_cast<double>(n), 0.0);
    }
  });
}

}  // namespace vestibule::pipeline
