/// Newton's method for forces that cancel: what a search for rest and an implicit step share.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"
#include "solver/owned_vectors.hpp"

namespace phyxel {

/// Displacements u at which, along every axis that a phyxel is free along,
///   f(u) + applied - weight (u - centre) = 0,
/// the derivative of minus the energy E(u) - applied · u + ½ Σ weight |u - centre|².
struct Balance {
  using Vector = OwnedVectors::Vector;
  Vector free;                 ///< 1 along axes that a phyxel is free along, 0 along others.
  Vector target;               ///< Where it is along the others [m].
  Vector applied;              ///< [N]
  std::vector<double> weight;  ///< [kg/s²], shape [n]; empty: nothing is inert.
  Vector centre;               ///< Where inertia would lead [m]; empty likewise.
  double scale = 0;            ///< Forces beside what is applied that residuals are held to [N].
};

/// How a search went.
struct NewtonReport {
  double residual = 0;           ///< Of what is applied, by Euclidean norms.
  int steps = 0;                 ///< Newton's.
  std::int64_t evaluations = 0;  ///< Of the forces of all phyxels.
  bool found = false;            ///< The residual is below the tolerance, all held are in place.
  bool interrupted = false;      ///< The observer asked to stop.
  std::string why;               ///< Why nothing was found, in words.
};

/// Each step's linear equations are solved by conjugate gradients over differences of the backend's
/// forces, so that every term counts and no matrix is made. Steps are cut where they would strain
/// the body by much, or would raise the energy.
class Newton {
 public:
  using Vector = OwnedVectors::Vector;

  /// @param backend of the model, in double; both must outlive this
  Newton(const Model& model, Backend& backend, int most_steps);

  /// Whom to tell of every evaluation, and who may stop the search; on all ranks or on none.
  void observe(NewtonObserver observer) { observer_ = std::move(observer); }

  /// From u to the nearest balance downhill. The backend is left somewhere near. Collective.
  /// Interrupted, u is that of the last accepted step, from which a second call goes on alike.
  /// @param tolerance of the residual
  NewtonReport solve(const Balance& balance, double tolerance, Vector& u);

  /// Inner forces at u [N].
  Vector inner_forces(const Vector& u);
  const OwnedVectors& vectors() const { return vectors_; }
  /// Adds the caller's own forces [N], shape [n].
  void add_external_forces(Vector& applied) const;

 private:
  Vector forces(const Balance& balance, const Vector& u);
  void put(const Vector& u);
  double potential(const Balance& balance, const Vector& u);
  double residual(const Balance& balance, const Vector& u, const Vector& force) const;
  double steepest(const Vector& step);
  void stiffness_times(const Balance& balance, const Vector& u, const Vector& force,
                       const Vector& v, Vector& out);
  void find_stiffness(const Balance& balance);
  /// How conjugate gradients ended.
  enum class Inner { converged, indefinite, exhausted, interrupted };
  Inner find_step(const Balance& balance, const Vector& u, const Vector& force, Vector& step);
  /// Conjugate gradients' iterations of one step, at most.
  int most_inner_here() const;
  /// Tells the observer. @returns whether it, or another rank's, asks to stop
  bool asked_to_stop(int iteration, double inner_residual);

  const Model& model_;
  Backend& backend_;
  int most_steps_;
  OwnedVectors vectors_;
  double difference_;              ///< How far stiffness moves phyxels at most [m].
  std::vector<double> stiffness_;  ///< About that of each phyxel against its neighbours [N/m].
  Vector placed_;
  std::int64_t evaluations_ = 0;
  NewtonObserver observer_;
  NewtonProgress progress_;
};

}  // namespace phyxel
