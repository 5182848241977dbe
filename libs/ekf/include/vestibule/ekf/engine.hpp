#pragma once

#include <memory>

#include "vestibule/ekf/model.hpp"

namespace vestibule::ekf {

/// Runs the Kalman equations over PlanarModel. Gating is done before: what comes here is used.
/// The covariance stays symmetric.
class Engine {
 public:
  Engine() = default;
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;
  virtual ~Engine() = default;

  virtual void set(const State& x, const StateMatrix& P) = 0;
  virtual void predict(const Motion& u) = 0;
  /// \pre linearised at state(); R positive definite
  virtual void update(const Observation& z) = 0;
  [[nodiscard]] virtual State state() const = 0;
  [[nodiscard]] virtual StateMatrix covariance() const = 0;
};

/// On mrpt::bayes::CKalmanFilterCapable.
[[nodiscard]] std::unique_ptr<Engine> makeMrptEngine();

}  // namespace vestibule::ekf
