/// An implicit step: as long as what is to be seen allows, however stiff the body is.
#pragma once

#include "solver/newton.hpp"

namespace phyxel {

/// Steps of the singly diagonal Runge–Kutta method of Alexander 1977 (Diagonally implicit
/// Runge–Kutta methods for stiff O.D.E.'s, equation for two stages): second order, L-stable, so
/// that oscillations much faster than a step are damped away instead of kept. Each of its two
/// stages is a balance of forces with inertia. Linear momentum is kept to rounding.
class ImplicitStep {
 public:
  /// @param backend of the model, in double; both must outlive this
  ImplicitStep(const Model& model, Backend& backend);

  void observe(NewtonObserver observer) { newton_.observe(std::move(observer)); }

  /// From `state`, whose velocities are of its time, over state.dt; it is uploaded after.
  /// Collective.
  /// @throws DivergedError if Newton's method does not find a balance, InterruptedError if the
  ///   observer asks for it; `state` is then what it was
  void take(State& state);

  const NewtonReport& work() const { return work_; }  ///< Of all steps; the largest residual.

 private:
  using Vector = Newton::Vector;
  void find_applied(double time);
  /// A stage of length s [s] that ends at `time`.
  /// @param from,v U and V; @param u where the search begins
  /// u and v are those after it.
  void take_stage(double time, double s, const Vector& from, Vector& u, Vector& v);
  void take_both_stages(State& state);

  const Model& model_;
  Backend& backend_;
  Newton newton_;
  Balance balance_;
  std::vector<double> damping_;  ///< [1/s], shape [n]; empty: none.
  NewtonReport work_;
};

}  // namespace phyxel
