#include "vestibule/tuning/search.hpp"

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <nlopt.hpp>
#include <optional>
#include <string>
#include <thread>

#include "vestibule/core/random.hpp"

namespace vestibule::tuning {
namespace {

constexpr double kFirstStep = 0.1;            // of a local search, in the unit cube
constexpr double kSmallestStep = 1e-3;        // where it ends
constexpr std::size_t kDirectDimensions = 6;  // up to here dividing the cube pays

std::string nameOf(nlopt::algorithm a) {
  switch (a) {
    case nlopt::GN_DIRECT_L:
      return "DIRECT-L";
    case nlopt::GN_CRS2_LM:
      return "CRS2";
    case nlopt::GN_ISRES:
      return "ISRES";
    case nlopt::LN_BOBYQA:
      return "BOBYQA";
    default:
      return "SBPLX";
  }
}

nlopt::algorithm globalFor(GlobalAlgorithm wanted, std::size_t dimensions, std::size_t island) {
  switch (wanted) {
    case GlobalAlgorithm::kDirectL:
      // It has no random part: a second one would repeat the first.
      return island == 0 ? nlopt::GN_DIRECT_L : nlopt::GN_CRS2_LM;
    case GlobalAlgorithm::kIsres:
      return nlopt::GN_ISRES;
    case GlobalAlgorithm::kAuto:
      return island == 0 && dimensions <= kDirectDimensions ? nlopt::GN_DIRECT_L
                                                            : nlopt::GN_CRS2_LM;
    default:
      return nlopt::GN_CRS2_LM;
  }
}

/// BOBYQA interpolates a quadratic and needs two dimensions.
nlopt::algorithm localFor(LocalAlgorithm wanted, std::size_t dimensions, bool smooth) {
  if (dimensions < 2) return nlopt::LN_SBPLX;
  if (wanted == LocalAlgorithm::kAuto) return smooth ? nlopt::LN_BOBYQA : nlopt::LN_SBPLX;
  return wanted == LocalAlgorithm::kBobyqa ? nlopt::LN_BOBYQA : nlopt::LN_SBPLX;
}

}  // namespace

/// One NLopt run in a thread of its own, which sleeps while its point is being tried.
class Search::Island {
 public:
  Island(nlopt::algorithm algorithm, std::vector<double> start, int evaluations, std::uint64_t seed)
      : algorithm_(algorithm), left_(evaluations) {
    thread_ = std::thread([this, start = std::move(start), seed] { search(start, seed); });
  }
  Island(const Island&) = delete;
  Island& operator=(const Island&) = delete;
  ~Island() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stop_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }

  /// The point it waits for; empty when it is done.
  std::optional<std::vector<double>> point() {
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return point_ || done_; });
    return done_ ? std::nullopt : point_;
  }
  void tell(double cost) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      cost_ = cost;
      point_.reset();
    }
    changed_.notify_all();
  }
  [[nodiscard]] nlopt::algorithm algorithm() const { return algorithm_; }

 private:
  void search(std::vector<double> x, std::uint64_t seed) {
    // NLopt's generator belongs to the thread.
    nlopt::srand(static_cast<unsigned long>(seed));
    const bool local = algorithm_ == nlopt::LN_BOBYQA || algorithm_ == nlopt::LN_SBPLX;
    try {
      nlopt::opt opt(algorithm_, static_cast<unsigned>(x.size()));
      opt.set_lower_bounds(0.0);
      opt.set_upper_bounds(1.0);
      opt.set_maxeval(left_);
      if (local) {
        opt.set_initial_step(kFirstStep);
        opt.set_xtol_abs(kSmallestStep);
      } else if (algorithm_ == nlopt::GN_CRS2_LM || algorithm_ == nlopt::GN_ISRES) {
        const auto n = static_cast<unsigned>(x.size());
        // Ten per dimension where the budget lasts for half as many trials again.
        const auto most = static_cast<unsigned>(std::max(0, left_ * 2 / 3));
        opt.set_population(std::max(n + 2, std::min(10 * (n + 1), most)));
      }
      opt.set_min_objective(
          [](const std::vector<double>& at, std::vector<double>&, void* self) {
            return static_cast<Island*>(self)->costOf(at);
          },
          this);
      double best = 0.0;
      opt.optimize(x, best);
    } catch (const std::exception&) {
      // Stopped, or as near as rounding allows: what it found has been told already.
    }
    const std::lock_guard<std::mutex> lock(mutex_);
    done_ = true;
    point_.reset();
    changed_.notify_all();
  }

  double costOf(const std::vector<double>& at) {
    std::unique_lock<std::mutex> lock(mutex_);
    // CRS2 may go past its limit to finish a step.
    if (stop_ || left_-- <= 0) throw nlopt::forced_stop();
    point_ = at;
    changed_.notify_all();
    changed_.wait(lock, [this] { return !point_ || stop_; });
    if (stop_) throw nlopt::forced_stop();
    return cost_;
  }

  nlopt::algorithm algorithm_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<std::vector<double>> point_;
  double cost_ = 0.0;
  int left_;
  bool done_ = false;
  bool stop_ = false;
  std::thread thread_;
};

double distanceInCube(const std::vector<double>& a, const std::vector<double>& b) {
  double largest = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

Search::Search(const SearchSpec& spec, std::vector<double> start, bool smooth, std::uint64_t seed)
    : spec_(spec), start_(std::move(start)), smooth_(smooth), seed_(seed) {}

Search::~Search() = default;

void Search::startGlobal() {
  stage_ = Stage::kGlobal;
  if (spec_.global == GlobalAlgorithm::kNone) return;
  const double share = spec_.local == LocalAlgorithm::kNone ? 1.0 : spec_.global_share;
  const int budget = static_cast<int>(share * spec_.evaluations) / spec_.islands;
  if (budget < 1) return;
  for (int i = 0; i < spec_.islands; ++i) {
    const auto island = static_cast<std::size_t>(i);
    islands_.push_back(std::make_unique<Island>(
        globalFor(spec_.global, start_.size(), island),
        start_,
        budget,
        derivedSeed(seed_, "global", island)));
  }
}

void Search::startLocal() {
  stage_ = Stage::kLocal;
  islands_.clear();
  const int left = spec_.evaluations - static_cast<int>(tried_.size());
  if (spec_.local == LocalAlgorithm::kNone || left < spec_.islands) return;
  std::stable_sort(
      tried_.begin(), tried_.end(), [](const Tried& a, const Tried& b) { return a.cost < b.cost; });
  std::vector<std::vector<double>> starts;
  for (const Tried& t : tried_) {
    const bool apart = std::all_of(starts.begin(), starts.end(), [&t](const auto& s) {
      return distanceInCube(s, t.point) > kApart;
    });
    if (apart) starts.push_back(t.point);
    if (starts.size() == static_cast<std::size_t>(spec_.islands)) break;
  }
  if (starts.empty()) starts.push_back(start_);
  const int budget = left / static_cast<int>(starts.size());
  for (std::size_t i = 0; i < starts.size(); ++i) {
    islands_.push_back(std::make_unique<Island>(
        localFor(spec_.local, start_.size(), smooth_),
        starts[i],
        budget,
        derivedSeed(seed_, "local", i)));
  }
}

std::vector<std::vector<double>> Search::ask() {
  asking_.clear();
  std::vector<std::vector<double>> points;
  while (stage_ != Stage::kOver) {
    if (stage_ == Stage::kBefore) startGlobal();
    for (const auto& island : islands_) {
      if (auto point = island->point()) {
        points.push_back(std::move(*point));
        asking_.push_back(island.get());
      }
    }
    if (!points.empty()) break;
    if (stage_ == Stage::kGlobal) {
      startLocal();
    } else {
      stage_ = Stage::kOver;
    }
  }
  return points;
}

void Search::tell(const std::vector<double>& costs) {
  for (std::size_t i = 0; i < asking_.size(); ++i) {
    if (stage_ == Stage::kGlobal) tried_.push_back({*asking_[i]->point(), costs[i]});
    asking_[i]->tell(costs[i]);
  }
}

std::string Search::algorithms() const {
  std::string text;
  if (spec_.global != GlobalAlgorithm::kNone) {
    for (int i = 0; i < spec_.islands; ++i) {
      text += (i > 0 ? ", " : "") +
              nameOf(globalFor(spec_.global, start_.size(), static_cast<std::size_t>(i)));
    }
  }
  if (spec_.local != LocalAlgorithm::kNone) {
    text += (text.empty() ? "" : "; then ") + nameOf(localFor(spec_.local, start_.size(), smooth_));
  }
  return text;
}

}  // namespace vestibule::tuning
