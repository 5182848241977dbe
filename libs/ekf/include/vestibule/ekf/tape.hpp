#pragma once

#include "vestibule/ekf/model.hpp"

namespace vestibule::ekf {

/// Told of every operation on an estimate, in order.
class Tape {
 public:
  Tape() = default;
  Tape(const Tape&) = delete;
  Tape& operator=(const Tape&) = delete;
  virtual ~Tape() = default;
  virtual void predicted(const Transition& step) = 0;
  /// \param P  before the update
  virtual void updated(const StateMatrix& P, const Observation& z) = 0;
  /// The estimate began anew: what comes later says nothing about before.
  virtual void cut() = 0;
  /// These errors were replaced by new ones that have nothing to do with those before.
  virtual void replaced(int first, int count) = 0;
};

}  // namespace vestibule::ekf
