#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "vestibule/tuning/session.hpp"

namespace vestibule::tuning {

/// NLopt turned inside out: it asks for the cost of points of the unit cube instead of calling a
/// function. Several searches ("islands") run side by side and ask together, so that their points
/// can be tried in parallel; what they ask depends on nothing but the costs they are told.
///
/// First every island searches globally (the first with DIRECT-L up to six dimensions, else with
/// controlled random search, each from a seed of its own), then each goes on locally from one of
/// the best points so far that are apart from each other.
class Search {
 public:
  /// \param start   where a search without a global stage begins
  /// \param smooth  the cost is smooth in the parameters: a quadratic model will fit
  Search(const SearchSpec& spec, std::vector<double> start, bool smooth, std::uint64_t seed);
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;
  ~Search();

  /// One point per island that still searches; empty when the search is over.
  [[nodiscard]] std::vector<std::vector<double>> ask();
  /// The costs of the points last asked, in their order. Finite.
  void tell(const std::vector<double>& costs);

  /// "DIRECT-L, CRS2; then BOBYQA".
  [[nodiscard]] std::string algorithms() const;

 private:
  class Island;
  struct Tried {
    std::vector<double> point;
    double cost;
  };
  void startGlobal();
  void startLocal();

  SearchSpec spec_;
  std::vector<double> start_;
  bool smooth_;
  std::uint64_t seed_;
  enum class Stage { kBefore, kGlobal, kLocal, kOver } stage_ = Stage::kBefore;
  std::vector<std::unique_ptr<Island>> islands_;
  std::vector<Island*> asking_;
  std::vector<Tried> tried_;
};

/// Apart in the unit cube by more than this, two points are different.
inline constexpr double kApart = 0.05;
[[nodiscard]] double distanceInCube(const std::vector<double>& a, const std::vector<double>& b);

}  // namespace vestibule::tuning
