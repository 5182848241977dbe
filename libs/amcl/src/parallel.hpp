#pragma once

#include <algorithm>
#include <cstddef>
#include <thread>
#include <vector>

namespace vestibule::amcl {

/// Calls work(begin, end) on up to `threads` pieces of [0, n), whose ends are multiples of `grain`.
/// Pieces must not depend on each other; few items run in the calling thread alone, as starting
/// a thread costs about as much as some thousand particles.
template <class Work>
void forPieces(std::size_t n, std::size_t grain, int threads, std::size_t min_piece, Work work) {
  const std::size_t pieces =
      std::min(static_cast<std::size_t>(std::max(threads, 1)), n / std::max<std::size_t>(min_piece, 1));
  if (pieces <= 1) {
    work(std::size_t{0}, n);
    return;
  }
  const std::size_t piece = (n / pieces + grain - 1) / grain * grain;
  std::vector<std::thread> helpers;
  for (std::size_t begin = piece; begin < n; begin += piece) {
    helpers.emplace_back(work, begin, std::min(begin + piece, n));
  }
  work(std::size_t{0}, std::min(piece, n));
  for (std::thread& helper : helpers) helper.join();
}

}  // namespace vestibule::amcl
