/// When points of surfaces that may touch other bodies have to be found anew.
#pragma once

#include <cstdint>
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
  /// Returns true if points have to be found anew. Of a share: collective.
  /// @param moved how far the phyxels of the layer have moved since the last time [m]
  /// @param fastest their largest speed [m/s]
  bool look(const Model& model, double moved, double fastest, double skin, double dt);
  /// True if points have been found for steps of `dt` [s].
  bool has_found(double dt) const { return generation_ > 0 && dt == dt_; }
  /// Notes that points are found anew for steps of `dt` [s].
  void renew(double dt) {
    ++generation_;
    dt_ = dt;
  }
  /// Puts the next look off as long as that may be.
  void put_off() { left_ = rarest_; }
  /// Most steps between two looks.
  int rarest() const { return rarest_; }
  /// How often they had to be.
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
  /// True if points have to be found anew before a step of `dt` [s]. Of a share: collective.
  /// @param ways of the groups since points were found; not looked at before that
  bool is_late_by(std::vector<SurfaceWay> ways, double dt, double skin) {
    ways_ = std::move(ways);
    return layer_.model().share ? is_late_on_ranks(dt, skin) : is_late_here(dt, skin);
  }
  /// True if points have to be found anew before a step of `dt` [s]. Of a share: collective.
  /// @param skin as of `TouchingPoints` [m]. @param state_of returns the state of a phyxel
  template <class StateOf>
  bool is_late(double dt, double skin, StateOf&& state_of) {
    if (!found_at_.empty()) {
#pragma omp parallel for schedule(static) num_threads(threads_)
      for (std::size_t g = 0; g < ways_.size(); ++g) {
        SurfaceWay way;
        for (std::size_t k = layer_.groups()[g].begin; k < layer_.groups()[g].end; ++k) {
          const Index i = layer_.phyxels()[k];
          const SurfaceState state = state_of(i);
          extend(way.moved, layer_.model().position[i] + state.displacement - found_at_[k]);
          extend(way.speeds, state.velocity);
        }
        ways_[g] = way;
      }
    }
    return is_late_by(std::move(ways_), dt, skin);
  }
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
  bool is_late_on_ranks(double dt, double skin);
  bool is_late_here(double dt, double skin);
  /// True if bodies may touch in the next step at places that are not among the points.
  bool have_come_near(double dt, double skin) const;

  const SurfaceLayer& layer_;
  int threads_;
  ContactWatch watch_;
  std::vector<Vec3d> found_at_;   // [m], shape [layer]
  std::vector<SurfaceWay> ways_;  // of each group
  BodyReach reach_;               // when points were found
};

}  // namespace phyxel
