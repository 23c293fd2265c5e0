/// Loads that follow the surface: pressures on the deformed surface, and gases in cavities.
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "exact_sum.hpp"
#include "model/loads.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/follower.hpp"
#include "phyxel/physics/strain.hpp"
#include "rank_sums.hpp"

namespace phyxel {

/// Sums over the phyxels on which a load acts that follows the surface. Places x are those of the
/// deformed body, from some origin, and w is the size of a phyxel's force at rest.
struct SurfaceSums {
  ExactSum flux;              ///< Σ x · f [N m], f being the present force at full size.
  ExactVector force, torque;  ///< Σ f [N], Σ x × f [N m]
  LoadSums sizes;             ///< Of w in place of masses.

  /// Adds a phyxel. @param x its place [m]. @param f its present force [N]. @param w [N]
  void add(Vec3d x, Vec3d f, double w);
  /// Adds the sums over another set of phyxels.
  void add(SurfaceSums& set);
  std::vector<ExactSum*> all();
  /// Returns the volume of a cavity that a gas of pressure p fills, ⅓ Σ (x - mean of x) · f / p
  /// [m³], which a shift of the body does not change. @param p at rest [Pa]
  double volume(double p) const;
  /// Finds the changes of the forces that take away their total and their torque.
  ForceBalance balance() const;
};

/// A phyxel on which a load acts that follows the surface.
struct Followed {
  Index phyxel;
  Vec3d rest_force;  ///< [N]
  Mat3d gradient;    ///< Of the displacement there.
};

/// The loads of a model that follow the surface. A gas of pressure p₀ in a cavity has the pressure
/// p₀ (V₀/V)^γ once the volume is V, found from the areas cof(F) S of the phyxels around it. On
/// surfaces without an edge the forces of a pressure have neither sum nor torque; those of the
/// phyxels have small ones, of second order in the spacing, which are taken off.
/// Displacements are given by a function: displacement(i) returns that of phyxel i [m], ghosts
/// included.
class FollowingLoads {
 public:
  /// Collective on a share, if there is a gas. The model must outlive this object.
  explicit FollowingLoads(const Model& model);

  const Model& model() const { return model_; }
  /// True if no load follows the surface.
  bool empty() const { return model_.following.empty(); }
  /// True if a load acts on a surface without an edge, and needs sums over its phyxels.
  bool has_closed() const;
  /// The load of entry `f` of `Model::following`.
  const Load& load_of(const Following& f) const { return model_.loads[f.load]; }
  /// The origin of the sums of a load [m].
  static Vec3d origin_of(const Load& load) { return load.centroid; }

  /// The state of a gas.
  struct Gas {
    std::size_t following;  ///< Number among `Model::following`.
    double exponent;        ///< γ
    double volume_at_rest;  ///< [m³]
    double volume;          ///< [m³]
    /// Its present pressure over that at rest.
    double ratio() const { return std::pow(volume_at_rest / volume, exponent); }
  };
  /// What follows from the sums of all closed surfaces.
  struct Present {
    std::vector<Gas> gases;              ///< In the order of the loads.
    std::vector<ForceBalance> balances;  ///< Shape [Model::following]; zero on open surfaces.
  };
  /// Finds it. Collective if there is a closed surface.
  template <class U>
  Present present(const U& displacement) const {
    std::vector<SurfaceSums> sums;
    for (const Following& f : model_.following) {
      const Load& load = load_of(f);
      if (!load.closed) continue;
      SurfaceSums& of_surface = sums.emplace_back();
#pragma omp parallel
      {
        SurfaceSums of_thread;
#pragma omp for schedule(static) nowait
        for (std::size_t k = 0; k < f.entry.size(); ++k) {
          const Followed at = followed(f, k, displacement);
          of_thread.add(place_of(load, at.phyxel, displacement),
                        following_force(at.gradient, at.rest_force), norm(at.rest_force));
        }
#pragma omp critical
        of_surface.add(of_thread);
      }
    }
    return present_of(sums);
  }
  /// The same from sums over the phyxels of this rank. Collective.
  Present present_of(std::vector<SurfaceSums>& sums) const;
  /// Returns the factors of the forces at rest, in the order of `Model::following`: how far loads
  /// have grown, times `Gas::ratio`. @param time [s]
  std::vector<double> factors(double time, const std::vector<Gas>& gases) const;

  /// Adds the present forces [N], shape [n]. Collective if there is a closed surface.
  /// @param time [s]
  template <class U>
  void add(double time, const U& displacement, std::vector<Vec3d>& force) const {
    if (empty()) return;
    const Present now = present(displacement);
    const std::vector<double> factor = factors(time, now.gases);
    for (std::size_t l = 0; l < factor.size(); ++l) {
      const Following& f = model_.following[l];
      const Load& load = load_of(f);
#pragma omp parallel for schedule(static)
      for (std::size_t k = 0; k < f.entry.size(); ++k) {
        const Followed at = followed(f, k, displacement);
        Vec3d own = following_force(at.gradient, at.rest_force);
        if (load.closed) {
          own +=
              now.balances[l].change(place_of(load, at.phyxel, displacement), norm(at.rest_force));
        }
        force[at.phyxel] += factor[l] * own;
      }
    }
  }
  /// Returns minus the work since rest [J] on the phyxels of all ranks. Collective if there is such
  /// a load. @param time [s]
  template <class U>
  double energy(double time, const U& displacement) const {
    if (empty()) return 0;
    ExactSum work;
    for (const Following& f : model_.following) {
      const Load& load = model_.loads[f.load];
      for (std::size_t k = 0; !load.gas && k < f.entry.size(); ++k) {
        const Followed at = followed(f, k, displacement);
        const Vec3d force = load.scale_at(time) * at.rest_force;
        work.add(dot(mean_following_force(at.gradient, force), displacement(at.phyxel)));
      }
    }
    if (model_.share) add_over_ranks(*model_.share->communicator, {&work});
    const bool has_gas = !volume_at_rest_.empty();
    return (has_gas ? energy_of(time, present(displacement).gases) : 0) - work.value();
  }

 private:
  /// The place of a phyxel from the origin of a load's sums [m].
  template <class U>
  Vec3d place_of(const Load& load, Index i, const U& displacement) const {
    return model_.position[i] - origin_of(load) + displacement(i);
  }
  /// Returns the phyxel of an entry and the gradient there.
  template <class U>
  Followed followed(const Following& f, std::size_t k, const U& displacement) const {
    const Load& load = model_.loads[f.load];
    Followed at{load.phyxels[f.entry[k]], load.force[f.entry[k]], {}};
    const Vec3d own = displacement(at.phyxel);
    for (Offset e = f.near.offsets[k]; e < f.near.offsets[k + 1]; ++e) {
      add_gradient_term(at.gradient, displacement(f.near.indices[e]) - own, f.slope[e]);
    }
    return at;
  }
  double energy_of(double time, const std::vector<Gas>& gases) const;

  const Model& model_;
  std::vector<double> volume_at_rest_;  // of gases [m³]
};

/// Copies displacements of owners to ghosts, if a load follows the surface, whose gradients need
/// them. Collective on a share. @param displacement [m], shape [n]
void refresh_for_following(const Model& model, std::vector<Vec3d>& displacement);

/// Adds all loads to forces [N], shape [n]. Collective if there is a closed surface. @param time
/// [s]
/// @param displacement [m], shape [n], with those of ghosts
void add_loads(const FollowingLoads& following, double time, std::span<const Vec3d> displacement,
               std::vector<Vec3d>& force);

}  // namespace phyxel
