/// Contact of bodies with each other in the steps of Verlet's method, on the host.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/neighbourhood.hpp"
#include "solver/contact_search.hpp"
#include "solver/contact_watch.hpp"
#include "solver/point_exchange.hpp"
#include "solver/step_sums.hpp"
#include "solver/surface_layer.hpp"

namespace phyxel {

/// The points of surfaces that may touch other bodies soon, and the lists of neighbours among them.
/// The points of this rank come first, then the points of other ranks.
class TouchingPoints {
 public:
  /// @param layer must outlive this
  explicit TouchingPoints(const SurfaceLayer& layer) : model_(layer.model()), layer_(layer) {}

  /// Finds them anew from places. Of a share: collective. @param dt size of the step [s]
  /// @param skins of the bodies [m] (`skin_of`)
  void find(std::span<const Vec3d> position, double dt, std::span<const double> skins);

  /// The extents of bodies when points were found.
  const BodyReach& reach() const { return reach_; }

  /// Numbers, in the layer, of this rank's points.
  std::span<const Index> own() const { return own_; }
  std::span<const SurfaceSite> sites() const { return site_; }
  /// The index of each point in the whole model.
  std::span<const Index> ids() const { return id_; }
  /// The body that each point belongs to.
  std::span<const Index> bodies() const { return body_; }
  std::span<const ContactRow> rows() const { return rows_.rows; }
  const Csr& near() const { return rows_.near; }
  /// The points near the point of a row.
  std::span<const Index> near_row(std::size_t r) const { return rows_.near_row(r); }
  /// For each point, the entries that name it, in `contact_threads` lists, and the rows that belong
  /// to it, ascending.
  const Csr& entries_of() const { return entries_of_; }
  /// The row of each of these entries.
  std::span<const Index> rows_naming() const { return rows_naming_; }
  const Csr& rows_from() const { return rows_from_; }
  /// True if there are rows on any rank.
  bool any() const { return any_; }
  /// True if a point of a row is beside several patches of a body.
  bool have_patches() const { return rows_.have_patches(); }
  /// The modulus of pressure waves of each point [Pa]. Of a share: collective.
  std::vector<double> wave_moduli() const;
  /// 1 over what the damping of a step of `dt` [s] keeps of a velocity, of this rank's points.
  std::vector<double> regains(double dt) const { return of_own(layer_.regains(dt)); }
  /// Gives the points of other ranks the values that their owners have: motions, or vectors. Of a
  /// share: collective. @param of_points shape [points]
  template <class T>
  void refresh(std::vector<T>& of_points) const {
    exchange_.refresh(of_points);
  }

  std::size_t bytes() const;

 private:
  std::vector<ContactCandidate> candidates(std::span<const Vec3d> position, double dt) const;
  void keep_what_counts(const std::vector<ContactCandidate>& all, ContactRows found);
  void invert();
  std::vector<double> of_own(const std::vector<double>& of_layer) const;

  const Model& model_;
  const SurfaceLayer& layer_;
  std::vector<double> skins_;  // of bodies [m]
  NearBoxes near_bodies_;
  BodyReach reach_;
  PointExchange exchange_;
  std::vector<Index> own_;
  std::vector<SurfaceSite> site_;
  std::vector<Index> id_;  // of each point, in the whole model
  std::vector<Index> body_;
  ContactRows rows_;
  Csr entries_of_, rows_from_;
  std::vector<Index> rows_naming_;
  bool any_ = false;
};

/// Keeps the bodies of a model out of each other, step by step, and adds up what they do.
class BodyContacts {
 public:
  /// @param model must outlive this. @param threads most threads that share the work
  BodyContacts(const Model& model, int threads);

  /// True if bodies touch each other.
  bool acts() const { return model_.body_contact.acts(); }
  /// True if points of any rank may touch in this step.
  bool any() const { return points_.any(); }

  /// Prepares for a step. Of a share: collective.
  /// @param state_of returns the state of a phyxel
  template <class StateOf>
  void begin_step(double dt, StateOf&& state_of) {
    if (!acts()) return;
    const std::vector<Index>& layer = model_.body_contact.layer.phyxels;
    if (watch_.is_late(dt, state_of)) {
      std::vector<Vec3d> position;
      position.reserve(layer.size());
      for (const Index i : layer) position.push_back(model_.position[i] + state_of(i).displacement);
      find_points(std::move(position), dt);
    }
    dt_ = dt;
    for (std::size_t p = 0; p < points_.own().size(); ++p) {
      const Index i = layer[points_.own()[p]];
      const SurfaceState state = state_of(i);
      motion_[p].before = model_.position[i] + state.displacement;
      motion_[p].earlier = state.velocity;
    }
  }
  /// The phyxels of this rank whose gradients of displacement `set_gradient` needs in each step.
  std::size_t count() const { return points_.own().size(); }
  Index phyxel(std::size_t p) const { return model_.body_contact.layer.phyxels[points_.own()[p]]; }
  void set_gradient(std::size_t p, const Mat3d& gradient);
  /// A number that changes when these phyxels do.
  std::int64_t generation() const { return watch_.generation(); }

  /// Changes the velocities with which the step starts by penalties, whose forces it finds, where
  /// points are `before` and gradients are set. Of a share: collective.
  /// @param get,set return and replace the state of a phyxel
  template <class Get, class Set>
  void push_apart(Get&& get, Set&& set) {
    if (!pushes_ || !points_.any()) return;
    forget_totals();
    for (std::size_t p = 0; p < count(); ++p) motion_[p].after = motion_[p].before;
    points_.refresh(motion_);
    find_way();
    find_touches();
    find_active();
    find_pushes();
    for (const Index p : own_active_) {
      totals_[p].normal += forces_[p].normal;
      const Vec3d change = regain_[p] * passes().change_by({forces_[p].normal, {}}, p);
      if (change == Vec3d{}) continue;
      const SurfaceState state = get(phyxel(p));
      set(phyxel(p), {state.displacement, state.velocity + change});
    }
  }
  /// Calls each(i, force) with the forces [N] that `push_apart` has found on phyxels of this rank.
  template <class Each>
  void for_each_push(Each&& each) const {
    for (const Index p : own_active_) each(phyxel(p), forces_[p].normal);
  }
  /// Adds the energies of this rank's points by these forces [J].
  void add_push_energy(ExactSum& sum);

  /// Moves phyxels that the step has led into bodies out of them, or lets them rub on bodies by
  /// which `push_apart` has pushed them. Of a share: collective.
  /// @param get,set return and replace the state of a phyxel at the end of the step
  template <class Get, class Set>
  void keep_apart(Get&& get, Set&& set) {
    if (!acts() || !points_.any()) return;
    if (pushes_) return rub(get, set);
    forget_totals();
    place(get);
    find_touches();
    find_active();
    if (active_.empty() && !model_.share) return;
    find_responses();
    for (int sweep = 0; sweep < model_.body_contact.sweeps; ++sweep) {
      if (sweep > 0) points_.refresh(velocity_);
      find_forces();
      const ContactPasses passes = this->passes();
      for (const Index p : own_active_) {
        move_by(passes.change_by(forces_[p], p), p, get, set);
        totals_[p].normal += forces_[p].normal;
        totals_[p].tangential += forces_[p].tangential;
      }
    }
    add_totals();
  }
  /// Calls each(i, force) with the force [N] of other bodies in the last step on phyxels of this
  /// rank, held ones, too.
  template <class Each>
  void for_each_force(Each&& each) const {
    for (const Index p : own_active_) each(phyxel(p), totals_[p].sum());
  }
  /// The depth of the deepest phyxel of each body in other bodies [m], then the largest depth of
  /// each over the smaller range of both bodies; shape [2, bodies]. Of a share: those of this
  /// rank's phyxels; collective. @param get returns the state of a phyxel
  template <class Get>
  std::vector<double> depths(Get&& get) {
    std::vector<double> deepest(2 * model_.body_contact.distances.size());
    if (!acts() || !points_.any()) return deepest;
    place(get);
    find_touches();
    add_depths(deepest);
    return deepest;
  }

  /// The sums of each body of the scene so far (`ContactTerms`).
  const StepSums& sums() const { return sums_; }
  std::size_t bytes() const;

 private:
  void find_points(std::vector<Vec3d> position, double dt);
  /// Sets where points are at the end of the step.
  template <class Get>
  void place(Get&& get) {
    for (std::size_t p = 0; p < count(); ++p) {
      const SurfaceState state = get(phyxel(p));
      motion_[p].after = model_.position[phyxel(p)] + state.displacement;
      velocity_[p] = state.velocity;
    }
    points_.refresh(motion_);
    points_.refresh(velocity_);
    find_way();
  }
  /// Adds to the way of points.
  void find_way();
  void forget_totals() {
    for (const Index p : own_active_) totals_[p] = {};
  }
  /// Ends a step of penalties: adds friction, and all to the sums.
  template <class Get, class Set>
  void rub(Get&& get, Set&& set) {
    for (std::size_t p = 0; p < count(); ++p) velocity_[p] = get(phyxel(p)).velocity;
    if (rubs_) {
      points_.refresh(velocity_);
      find_responses();
      find_rubs();
      for (const Index p : own_active_) {
        const Vec3d friction = forces_[p].tangential;
        totals_[p].tangential += friction;
        move_by(passes().change_by({{}, friction}, p), p, get, set);
      }
    }
    add_totals();
  }
  /// Changes the velocity of a point at the end of the step, and its place by as much over the
  /// step.
  template <class Get, class Set>
  void move_by(Vec3d change, Index p, Get&& get, Set&& set) {
    if (change == Vec3d{}) return;
    const SurfaceState state = get(phyxel(p));
    set(phyxel(p), {state.displacement + dt_ * change, state.velocity + change});
    velocity_[p] = get(phyxel(p)).velocity;
  }
  void add_totals() {
    for (const Index p : own_active_) {
      if (totals_[p].normal != Vec3d{}) add_to_sums(p, totals_[p]);
    }
  }
  void find_touches();
  /// Finds the rows whose points are inside other bodies, all points of these rows, for no other
  /// point has a force, and the entries by which forces act on them.
  void find_active();
  void find_responses();
  void find_forces();
  void find_pushes();
  void find_rubs();
  /// Runs find(passes, r) for the rows whose points are inside, and finds the forces on points.
  template <class Passes, class Find>
  void find_forces_by(const Passes& passes, Find&& find);
  void add_depths(std::vector<double>& deepest) const;
  int threads_here() const;
  ContactPasses passes();
  PenaltyPasses penalties();
  void add_to_sums(std::size_t p, const PointForces& forces);

  const Model& model_;
  int threads_;
  SurfaceLayer layer_;
  TouchingPoints points_;
  std::vector<PlacedDistances> fields_;  // of each body of the scene
  StepSums sums_;
  std::vector<SurfaceMotion> motion_;       // shape [points]
  std::vector<Vec3d> velocity_;             // shape [points]
  std::vector<SurfaceTouch> touches_;       // shape [rows]
  std::vector<SurfaceResponse> responses_;  // shape [rows]
  std::vector<SurfaceShare> carries_;       // shape [entries]
  std::vector<SurfaceCarrier> carriers_;    // shape [entries]
  std::vector<Index> carrier_counts_;       // shape [contact_threads, points]
  std::vector<char> in_patch_;              // shape [entries]; empty if there are no patches
  std::vector<SurfaceForce> row_forces_;    // shape [rows]
  std::vector<double> shares_;              // c of each point
  std::vector<double> wakes_;               // of each row
  std::vector<Vec3d> place_;                // of each point, as of `way_` [m]
  PointWay way_;
  std::vector<PointForces> forces_;         // on this rank's points, of the active ones
  std::vector<PointForces> totals_;         // the same of all sweeps of a step
  std::vector<char> is_inside_;             // of each row
  std::vector<Index> inside_;               // rows whose point is inside the body
  std::vector<char> is_active_;             // of each point
  std::vector<Index> active_, own_active_;  // points of these rows, and those of this rank
  LayerWatch watch_;
  double dt_ = 0;                // [s]
  bool pushes_;                  // true if bodies act by penalties; else all that follows is empty
  bool rubs_ = false;            // true if some of them have friction
  std::vector<double> modulus_;  // of pressure waves, shape [points] [Pa]
  std::vector<double> regain_;   // 1 over what damping keeps of a velocity, of own points
};

}  // namespace phyxel
