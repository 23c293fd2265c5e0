/// Loads on phyxels and tractions on surfaces, as forces on single phyxels.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "exact_sum.hpp"
#include "model/closing_areas.hpp"
#include "model/region_integrals.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// The name of an entry of a body in its scene, e.g. "fixed 1". @param number from 0
std::string entry_name(const char* kind, std::size_t number);

/// Sums over the phyxels that a load selects.
struct LoadSums {
  ExactSum mass;                   ///< Σ m [kg]
  ExactVector moment;              ///< Σ m x [kg m], x from some origin.
  std::array<ExactSum, 6> second;  ///< Σ m x xᵀ [kg m²]: xx, xy, xz, yy, yz, zz.
  /// Adds a phyxel. @param m mass [kg] @param x position from the origin [m]
  void add(double m, Vec3d x);
  Sym3d second_moment() const;  ///< Σ m x xᵀ [kg m²]
  /// All sums, for exchanges between ranks.
  std::vector<ExactSum*> all();
};

/// Changes of forces f on phyxels that add a total and a torque to their sums: each force changes
/// by |f| (shift + turn × (x - mean)).
struct ForceBalance {
  Vec3d shift;  ///< Without unit.
  Vec3d turn;   ///< [1/m]
  Vec3d mean;   ///< Centroid of the sizes |f| [m].

  /// Finds the changes that add a force [N] and a torque [N m]; zero if all sizes are.
  /// @param sizes sums over the phyxels, of |f| in place of masses. @param torque about the origin
  ///   of the sums
  static ForceBalance adding(const LoadSums& sizes, Vec3d force, Vec3d torque);
  /// The change of a force [N]. @param x place of its phyxel from the origin of the sums [m]
  Vec3d change(Vec3d x, double size) const { return size * (shift + cross(turn, x - mean)); }
};

/// The parts of a body on which its loads in boxes and balls act, one for each load; unset for
/// other loads, and for bodies of several materials or without a closed surface.
std::vector<std::optional<BodyPiece>> loaded_pieces(const BodyRequest& request,
                                                    const Surface& surface);

/// The load of entry `number` (from 0) of a body. Weights of the phyxels are their masses, times a
/// linear function of position that moves their centroid to that of the piece.
/// @param phyxels the selected phyxels of the model
/// @param sums over all of them, in the whole body, of positions from `origin` [m]
Load load_of(const BodyRequest& request, std::size_t number, std::vector<Index> phyxels,
             const Model& model, LoadSums sums, Vec3d origin,
             const std::optional<BodyPiece>& piece);

/// A traction on a surface: the pieces of triangles on which it acts, and the force on each.
struct LoadedFacets {
  std::vector<Facet> facets;
  std::vector<Vec3d> force;  ///< [N], shape [facets]
  bool closed = false;       ///< True of a follower on surfaces without an edge.
};
/// The surface of a body, in a model or by itself.
struct BodySurface {
  std::span<const Vec3d> position;
  std::span<const Triangle> triangle;
  Index first = 0;  ///< Number of the surface's first vertex in `triangle`.
  const std::map<std::string, std::vector<Index>>& groups;  ///< Of triangles.
};
/// Finds where a traction acts. @param longest greatest edge of a facet [m]
/// @throws InputError if it acts nowhere, or on a group that the surface lacks
LoadedFacets loaded_facets(const BodyRequest& request, const TractionRequest& traction,
                           const BodySurface& surface, double longest);

/// The load of traction `number` (from 0) of a body, without phyxels and forces.
Load traction_load(const BodyRequest& request, std::size_t number, const LoadedFacets& loaded);

/// Makes a traction follow the areas of the phyxels that it acts on, so that it balances a uniform
/// stress where that stress does: each force grows as the area does, and total and torque stay.
/// Collective.
/// @param change of the area of each phyxel of the model, relative
void follow_areas(const Model& model, Load& load, const std::vector<double>& change);

/// Adds the tractions of a scene to a whole model.
void add_tractions(Model& model, const Scene& scene);

}  // namespace phyxel
