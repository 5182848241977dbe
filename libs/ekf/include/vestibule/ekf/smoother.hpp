#pragma once

#include <variant>
#include <vector>

#include "vestibule/core/time.hpp"
#include "vestibule/ekf/tape.hpp"

namespace vestibule::ekf {

/// Fixed-interval smoothing of a recorded run: the estimate at each marked moment from everything
/// before and after it. The Rauch-Tung-Striebel smoother in the adjoint form of Bryson and Frazier
/// (Bierman, "Fixed interval smoothing with discrete measurements", 1973): no covariance is
/// inverted, and any sequence of steps and updates will do.
class Smoother : public Tape {
 public:
  struct Smoothed {
    Timestamp stamp;
    State x;
    StateMatrix P;
  };

  void predicted(const Transition& step) override;
  void updated(const StateMatrix& P, const Observation& z) override;
  void cut() override { operations_.emplace_back(Cut{}); }
  void replaced(int first, int count) override { operations_.emplace_back(Replaced{first, count}); }
  /// The filter's estimate of a moment that is to be smoothed.
  void mark(Timestamp stamp, const State& x, const StateMatrix& P);

  /// One per mark, in their order.
  [[nodiscard]] std::vector<Smoothed> smooth() const;

 private:
  struct Predicted {
    Eigen::Matrix<double, kStateSize, 1> keep;
    Eigen::Matrix<double, Transition::kTop, kStateSize> coupling;
  };
  struct Updated {
    int rows;
    Eigen::Matrix<double, 3, kStateSize> H;
    Eigen::Matrix<double, kStateSize, 3> K;
    Eigen::Matrix3d S_inverse;
    Eigen::Vector3d residual;
  };
  struct Cut {};
  struct Replaced {
    int first;
    int count;
  };
  struct Mark {
    std::size_t index;
  };
  std::vector<std::variant<Predicted, Updated, Cut, Replaced, Mark>> operations_;
  std::vector<Smoothed> marks_;
};

}  // namespace vestibule::ekf
