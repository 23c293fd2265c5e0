/// Newton's method for a balance of forces, shared by searches for equilibrium and implicit steps.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "model/owned_vectors.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"
#include "solver/contact_penalty.hpp"
#include "solver/following_loads.hpp"
#include "solver/preconditioner.hpp"

namespace phyxel {

/// Checks that a backend computes in double, without which a search by Newton's method does not
/// come to an end: it takes differences of forces over 1e-7 of a support, and residuals have to
/// fall to 1e-8 of what acts.
/// @throws InputError with the precision, the method, and what is allowed
void check_precision(const Backend& backend, Method method);

/// A balance of forces: displacements u that satisfy, along every free axis of each phyxel,
///   f(u) + applied + following(u) + contact(u) - weight (u - centre) = 0.
/// Without loads that follow the surface, that is the derivative of minus the energy
/// E(u) - applied · u + ½ Σ weight |u - centre|².
struct Balance {
  using Vector = OwnedVectors::Vector;
  Vector free;                 ///< 1 along free axes, 0 along prescribed ones.
  Vector target;               ///< Displacement along prescribed axes [m].
  Vector applied;              ///< Gravity, constant loads and the caller's forces [N].
  std::vector<double> weight;  ///< Inertia [kg/s²], shape [n]; empty without inertia.
  Vector centre;               ///< Displacement that inertia alone leads to [m]; empty likewise.
  PlacedObstacles obstacles;   ///< At the time of the balance.
  SlipMeasure slip;            ///< Of contact with friction.
  double time = 0;             ///< Time of loads that follow the surface and grow [s].
  double scale = 0;  ///< Force added to the applied forces as the reference of residuals [N].
};

/// The outcome of a search.
struct NewtonReport {
  double residual = 0;           ///< Residual over applied forces, by Euclidean norms.
  int steps = 0;                 ///< Number of Newton steps.
  std::int64_t evaluations = 0;  ///< Evaluations of the forces of all phyxels.
  bool found = false;  ///< True if the residual is below the tolerance and prescribed phyxels are
                       ///< at their targets.
  bool interrupted = false;  ///< True if the observer stopped the search.
  std::string why;           ///< The reason of a failure, for error messages.
};

/// Newton's method with line search. The linear equations of each step are solved by conjugate
/// gradients with differences of the backend's forces, so that all terms are included and no matrix
/// is assembled. A step is shortened if it would strain the body too much or raise the energy.
///
/// Near a balance, a search keeps the linear form of the gaps between bodies (`Renewal`) until the
/// residual has fallen to a tenth, and then renews them; normal forces of friction are held until a
/// balance is found with them.
class Newton {
 public:
  using Vector = OwnedVectors::Vector;

  /// @param backend backend of the model, in double. Both must outlive this object. @param
  /// most_steps limit of Newton steps
  Newton(const Model& model, Backend& backend, int most_steps);

  /// Sets the observer, which is called after every evaluation and may stop the search. Set it on
  /// all ranks or on none.
  void observe(NewtonObserver observer) { observer_ = std::move(observer); }

  /// Finds the balance that descending the energy from u leads to. The state of the backend
  /// afterwards is close to u, not equal. Collective. If interrupted, u is that of the last
  /// accepted step, from which a second call continues identically.
  /// @param tolerance largest residual. @param u start of the search, and its result [m]
  NewtonReport solve(const Balance& balance, double tolerance, Vector& u);

  /// Returns the internal forces [N] at u.
  Vector inner_forces(const Vector& u);
  /// Returns the sum of internal, applied, following and contact forces [N] at u, without inertia.
  Vector acting_forces(const Balance& balance, const Vector& u);
  /// Contact with obstacles and of bodies, as it was when the last search ended.
  const ContactPenalty& contact() const { return contact_; }
  const OwnedVectors& vectors() const { return vectors_; }
  /// Sets the forces of gravity, loads and the caller. @param time of loads that grow [s]
  void set_applied(double time, Balance& balance) const;

 private:
  /// Progress of a search, and the state of its contact.
  struct Rounds {
    Renewal renewal = Renewal::all;  ///< Of the next look at contact.
    double renewed = 0;              ///< Residual when all of contact was found last.
    int kept = 0;                    ///< Steps since then.
    int of_normals = 0;              ///< Renewals of held normal forces.
    double smallest = std::numeric_limits<double>::infinity();  ///< Residual.
    int without_gain = 0;  ///< Renewals in a row that hardly reduced it.
    int exhausted = 0;     ///< Steps in a row whose linear equations stayed unsolved.
    void forget_gain() {
      smallest = std::numeric_limits<double>::infinity();
      without_gain = 0;
    }
  };
  void hold_normals(const Balance& balance, Rounds& rounds, const NewtonReport& report);
  bool renew_normals(const Balance& balance, Rounds& rounds);
  bool takes_stock(const Balance& balance, const Vector& u, const Vector& force, double tolerance,
                   bool is_placed, Vector& all, Rounds& rounds, NewtonReport& report);
  bool must_renew(const Rounds& rounds, const Balance& balance, const Vector& u, const Vector& all,
                  double tolerance) const;
  /// Start of a line search: the balance, its energy and residual, and true if prescribed phyxels
  /// move.
  struct Start {
    const Balance& balance;
    double energy, residual;
    bool moves;
  };
  enum class LineSearch { found, endless, interrupted };
  LineSearch search_line(const Start& start, const Vector& u, const Vector& step, Vector& force,
                         double& plain_energy, Vector& next);
  std::string why_to_end(const NewtonReport& report, int without_gain, int exhausted) const;
  Vector acting_without_contact(const Balance& balance, const Vector& u);
  Vector forces_without_contact(const Balance& balance, const Vector& u);
  /// Finds how bodies touch obstacles and each other at u.
  void linearise_contact(const Balance& balance, const Vector& u, Renewal renewal);
  /// Adds the forces of contact at u to those without.
  Vector with_contact(const Balance& balance, const Vector& u, Vector force) const;
  void put(const Vector& u);
  double potential(const Balance& balance, const Vector& u);
  double residual(const Balance& balance, const Vector& u, const Vector& force) const;
  double steepest(const Vector& step);
  double largest_entry(std::span<const Mat3d> gradient) const;
  void begin_preconditioner(const Balance& balance, const Vector& u);
  void stiffness_times(const Balance& balance, const Vector& u, const Vector& force,
                       const Vector& v, Vector& out);
  void find_stiffness(const Balance& balance);
  /// The outcome of conjugate gradients.
  enum class Inner { converged, indefinite, exhausted, interrupted };
  Inner find_step(const Balance& balance, const Vector& u, const Vector& force, const Vector& all,
                  Vector& step);
  /// Limit of conjugate gradient iterations in one step.
  int most_inner_here() const;
  /// Calls the observer. @returns true if it, or that of another rank, asks to stop
  bool asked_to_stop(int iteration, double inner_residual);

  const Model& model_;
  Backend& backend_;
  int most_steps_;
  OwnedVectors vectors_;
  FollowingLoads following_;
  /// True if forces have an energy only nearly: line searches look at residuals, too.
  bool is_nearly_potential_ = false;
  ContactPenalty contact_;
  Preconditioner preconditioner_;
  double difference_;              ///< Largest displacement in differences of forces [m].
  std::vector<double> stiffness_;  ///< Estimate for each phyxel against its neighbours [N/m].
  Vector placed_;
  std::int64_t evaluations_ = 0;
  NewtonObserver observer_;
  NewtonProgress progress_;
};

}  // namespace phyxel
