/// When points of surfaces that may touch other bodies have to be found anew.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "model/box.hpp"
#include "phyxel/model.hpp"
#include "solver/surface_layer.hpp"

namespace phyxel {

/// A phyxel of a surface at the start of a step.
struct SurfaceState {
  Vec3d displacement;  ///< [m]
  Vec3d velocity;      ///< [m/s]
};

/// When points that may touch have to be found anew: before phyxels have moved by half a skin.
class ContactWatch {
 public:
  /// @param rarest most steps between two looks: what an impact sets in motion must not go far
  ///   before the next one
  explicit ContactWatch(int rarest) : rarest_(rarest) {}
  /// True if it is time to look where phyxels are, before a step of `dt` [s].
  bool is_due(double dt) { return dt != dt_ || --left_ <= 0; }
  /// True if the next look is due before the next step.
  bool is_due_next() const { return left_ <= 1; }
  /// True if points have been found for steps of `dt` [s].
  bool has_found(double dt) const { return generation_ > 0 && dt == dt_; }
  /// Notes that points are found anew for steps of `dt` [s].
  void renew(double dt) {
    ++generation_;
    dt_ = dt;
  }
  /// Puts the next look off by some steps, one at least, as far as that may be.
  void put_off(double steps = HUGE_VAL) {
    left_ = static_cast<int>(std::clamp(steps, 1.0, static_cast<double>(rarest_)));
  }
  /// Most steps between two looks.
  int rarest() const { return rarest_; }
  /// How often points had to be found.
  std::int64_t generation() const { return generation_; }

 private:
  int rarest_;
  std::int64_t generation_ = 0;
  double dt_ = 0;  // [s]
  int left_ = 0;   // steps until the next look
};

/// The motion of the phyxels of a body's surface since points were found.
struct SurfaceWay {
  Box moved = no_box;   ///< Box of their ways [m].
  Box speeds = no_box;  ///< Box of their velocities [m/s].
};

/// Watches the layer of a model, in each step on the host, every few steps on a device: what comes
/// to bodies at rest may set them in motion in any step. Bodies that move together need no new
/// points, however fast they are, nor do bodies far from each other.
class LayerWatch {
 public:
  /// @param layer must outlive this. @param threads most threads that share the work
  /// @param rarest most steps between two looks (`ContactWatch`)
  LayerWatch(const SurfaceLayer& layer, int threads, int rarest = 1);

  /// True if it is time to look where phyxels are, before a step of `dt` [s].
  bool is_due(double dt) { return watch_.is_due(dt); }
  /// True if the next look is due before the next step.
  bool is_due_next() const { return watch_.is_due_next(); }
  /// Asks for a look before the next step, since phyxels have been moved other than by steps.
  void look_next() { watch_.put_off(1); }
  /// True if points have to be found anew before a step of `dt` [s]. Of a share: collective.
  /// @param ways of the groups since points were found, zero before that
  /// @param since steps since the time of these ways
  bool is_late_by(std::vector<SurfaceWay> ways, double dt, int since = 0) {
    ways_ = std::move(ways);
    return layer_.model().share ? is_late_on_ranks(dt, since) : is_late_here(dt, since);
  }
  /// True if points have to be found anew before a step of `dt` [s]. Of a share: collective.
  /// @param state_of returns the state of a phyxel
  template <class StateOf>
  bool is_late(double dt, StateOf&& state_of) {
    const bool have_been_found = !found_at_.empty();
#pragma omp parallel for schedule(static) num_threads(threads_)
    for (std::size_t g = 0; g < ways_.size(); ++g) {
      SurfaceWay way;
      for (std::size_t k = layer_.groups()[g].begin; k < layer_.groups()[g].end; ++k) {
        const Index i = layer_.phyxels()[k];
        const SurfaceState state = state_of(i);
        const Vec3d now = layer_.model().position[i] + state.displacement;
        extend(way.moved, have_been_found ? now - found_at_[k] : Vec3d{});
        extend(way.speeds, state.velocity);
      }
      ways_[g] = way;
    }
    return is_late_by(std::move(ways_), dt);
  }
  /// The skins of bodies for the lists that are to be found [m], once `is_late` has asked for them:
  /// they last for some steps, within the bounds of the layer, and for one at least. Fast bodies
  /// need wide ones; wide ones cost time in each step.
  const std::vector<double>& skins() const { return skins_; }
  /// Notes where bodies are when points are found.
  void found(const BodyReach& reach) { reach_ = reach; }
  /// Notes their phyxels' places, too, which `is_late` with states looks at [m], shape [layer].
  void found(std::vector<Vec3d> position, const BodyReach& reach) {
    found_at_ = std::move(position);
    found(reach);
  }
  /// A number that changes with each search.
  std::int64_t generation() const { return watch_.generation(); }
  std::size_t bytes() const { return found_at_.size() * sizeof(Vec3d); }

 private:
  bool is_late_on_ranks(double dt, int since);
  bool is_late_here(double dt, int since);
  /// The motions of bodies.
  struct BodyMotions {
    std::vector<Box> speeds;  ///< Boxes of the velocities now [m/s], shape [bodies].
    std::vector<Box> ways;    ///< Boxes of the ways since points were found [m], shape [bodies].
    std::vector<Box> boxes;   ///< Boxes of the bodies now [m]; empty before points are found.
  };
  BodyMotions body_motions() const;
  /// The boxes of bodies now and over some steps, in which speeds may grow [m].
  std::vector<Box> boxes_after(const BodyMotions& bodies, int steps, double dt) const;
  /// Calls visit(a, b) for bodies whose boxes overlap; with a = b if bodies may touch themselves.
  template <class Visit>
  void for_each_meeting(std::span<const Box> boxes, Visit&& visit);
  /// The number of steps for which the lists hold: bodies touch at no place that is not among the
  /// points. Infinite if that is beyond the next look.
  double steps_left(const BodyMotions& bodies, double dt);
  /// Sets the skins of bodies by the relative speeds of those that may soon be near each other; of
  /// all bodies before points are found. @returns the number of steps that they last for
  double set_skins(const BodyMotions& bodies, double dt);
  /// The skin for bodies that move against each other at a speed [m/s].
  double skin_for(double speed, double dt) const;

  const SurfaceLayer& layer_;
  int threads_;
  ContactWatch watch_;
  std::vector<double> skins_;     // of bodies [m]
  std::vector<Vec3d> found_at_;   // [m], shape [layer]
  std::vector<SurfaceWay> ways_;  // of each group
  NearBoxes near_;                // of bodies
  BodyReach reach_;               // when points were found
};

}  // namespace phyxel
