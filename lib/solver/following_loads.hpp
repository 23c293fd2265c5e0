/// Loads that follow the surface: pressures on the deformed surface, and gases in cavities.
#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "exact_sum.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/follower.hpp"
#include "phyxel/physics/strain.hpp"
#include "rank_sums.hpp"

namespace phyxel {

/// Sums over the phyxels around a cavity, from which its volume follows.
struct CavitySums {
  ExactSum flux;      ///< Σ x · a [m³], a being the present area.
  ExactVector area;   ///< Σ a [m²]
  ExactVector place;  ///< Σ x [m]
  ExactSum phyxels;   ///< Their number.

  /// Adds a phyxel. @param x its position [m]. @param a area out of the body, into the cavity [m²]
  void add(Vec3d x, Vec3d a);
  std::vector<ExactSum*> all() {
    return {&flux, &area.x, &area.y, &area.z, &place.x, &place.y, &place.z, &phyxels};
  }
  /// Returns -⅓ Σ (x - mean of x) · a [m³], which a shift of the body does not change.
  double volume() const;
};

/// A phyxel on which a load acts that follows the surface.
struct Followed {
  Index phyxel;
  Vec3d rest_force;  ///< [N]
  Mat3d gradient;    ///< Of the displacement there.
};

/// The loads of a model that follow the surface. A gas of pressure p₀ in a cavity has the pressure
/// p₀ (V₀/V)^γ once the volume is V, found from the areas cof(F) S of the phyxels around it.
/// Displacements are given by a function: displacement(i) returns that of phyxel i [m], ghosts
/// included.
class FollowingLoads {
 public:
  /// Collective on a share, if there is a gas. The model must outlive this object.
  explicit FollowingLoads(const Model& model);

  const Model& model() const { return model_; }
  /// True if no load follows the surface.
  bool empty() const { return model_.following.empty(); }
  /// True if a load is a gas in a cavity.
  bool has_gas() const { return !volume_at_rest_.empty(); }

  /// The state of a gas.
  struct Gas {
    std::size_t following;  ///< Number among `Model::following`.
    double exponent;        ///< γ
    double volume_at_rest;  ///< [m³]
    double volume;          ///< [m³]
    /// Its present pressure over that at rest.
    double ratio() const { return std::pow(volume_at_rest / volume, exponent); }
  };
  /// Returns the state of each gas, in the order of the loads. Collective if there is one.
  template <class U>
  std::vector<Gas> gases(const U& displacement) const {
    if (!has_gas()) return {};
    std::vector<CavitySums> sums;
    for (const Following& f : model_.following) {
      const Load& load = model_.loads[f.load];
      if (!load.gas) continue;
      CavitySums& of_gas = sums.emplace_back();
      for (std::size_t k = 0; k < f.entry.size(); ++k) {
        const Followed at = followed(f, k, displacement);
        of_gas.add(model_.position[at.phyxel] + displacement(at.phyxel),
                   following_force(at.gradient, (-1 / load.pressure) * at.rest_force));
      }
    }
    return gases_of(sums);
  }
  /// The same from sums over the phyxels of this rank. Collective.
  std::vector<Gas> gases_of(std::vector<CavitySums>& sums) const;
  /// Returns the factors of the forces at rest, in the order of `Model::following`: how far loads
  /// have grown, times `Gas::ratio`. @param time [s]
  std::vector<double> factors(double time, const std::vector<Gas>& gases) const;

  /// Adds the present forces [N], shape [n]. Collective if there is a gas. @param time [s]
  template <class U>
  void add(double time, const U& displacement, std::vector<Vec3d>& force) const {
    if (empty()) return;
    const std::vector<double> factor = factors(time, gases(displacement));
    for (std::size_t l = 0; l < factor.size(); ++l) {
      const Following& f = model_.following[l];
#pragma omp parallel for schedule(static)
      for (std::size_t k = 0; k < f.entry.size(); ++k) {
        const Followed at = followed(f, k, displacement);
        force[at.phyxel] += following_force(at.gradient, factor[l] * at.rest_force);
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
    return energy_of(time, gases(displacement)) - work.value();
  }

 private:
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

/// Adds all loads to forces [N], shape [n]. Collective if there is a gas. @param time [s]
/// @param displacement [m], shape [n], with those of ghosts
void add_loads(const FollowingLoads& following, double time, std::span<const Vec3d> displacement,
               std::vector<Vec3d>& force);

}  // namespace phyxel
