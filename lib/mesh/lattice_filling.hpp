/// Filling of a closed surface by a cubic lattice, of which the nodes near the surface give way to
/// the phyxels on it.
#pragma once

#include <cstdint>
#include <vector>

#include "bulk.hpp"
#include "mesh/filling_rules.hpp"
#include "mesh/inside_samples.hpp"
#include "mesh/repulsion.hpp"
#include "mesh/surface_sites.hpp"
#include "phyxel/cloud.hpp"

namespace phyxel {

class SurfaceOnDevice;

/// A surface to fill, and the number of phyxels to fill it with.
struct LatticeRequest {
  const Surface& surface;
  const InsideSampler& sampler;  ///< Sampler of the surface's inside.
  const SurfaceSites& sites;     ///< Phyxels on the surface and on cuts.
  double volume = 0;             ///< Enclosed volume [m^3].
  bool exact_volume = true;      ///< True if volumes have to add up to it.
  Index phyxels = 0;             ///< Number of phyxels inside, 1 or more.
  std::uint64_t seed = 1;        ///< Seed of the lattice's position and of sample points.
  int sweeps = 10;               ///< Sweeps that move the nodes near the surface.
  /// Does a part of the work; null for the host alone.
  const SurfaceOnDevice* device = nullptr;
};

/// Phyxels inside a surface, and the volumes of all its phyxels.
struct LatticeFilling {
  Bulk<Vec3d> position;  ///< Phyxels inside [m], shape [request.phyxels].
  /// Volumes of the phyxels on the surface, on cuts, then of those inside, shape [n_phyxels] [m^3].
  std::vector<double> volume;
  /// Distance from each phyxel to the nearest other one [m], shape [n_phyxels]; empty: not known.
  std::vector<double> gap;
  double spacing = 0;  ///< Lattice constant [m].
};

/// Clearance of the nodes nearest to the surface as a rule, and the least that is allowed where
/// there is no room for all, in spacings. These and the next were chosen by the accuracy of the
/// clouds.
inline constexpr double usual_clearance = 0.62, least_clearance = 0.45;
/// Sample points on the surface, from which nodes keep off too, for each square of the spacing.
inline constexpr double surface_samples = 12;
/// Phyxels on the surface, then those on cuts [m].
std::vector<Vec3d> all_sites(const SurfaceSites& sites);

/// The place of a point inside after a step of repulsion; see the function in filling_rules.hpp.
/// @param ball see `stays_inside`
template <class StepOf>
Vec3d repelled_inside(const LatticeRequest& request, Vec3d before, ClearBall& ball,
                      StepOf&& step_of) {
  const auto on_surface = static_cast<Index>(request.sites.position.size());
  return repelled_inside(on_surface, before, step_of, [&](Vec3d after) {
    return request.sampler.stays_inside(before, after, request.sites.spacing.coarsest(), ball);
  });
}

/// The turn of the lattice, by a unit quaternion of whole numbers: no direction of the lattice is
/// that of a face that people draw, so that no layer of nodes has one clearance for all.
Mat3d turn_of_lattice();

/// Fills a closed surface with a cubic lattice turned against the axes: exactly the requested
/// number of its nodes, those farthest from the surface and the phyxels on it. Nodes within two
/// spacings of the surface are then evened out: they and the phyxels on the surface repel each
/// other. Phyxels on cuts through the inside are treated as those on the surface are. Volumes are
/// shares of sample points within three spacings of the surface, and the cube of the lattice
/// constant elsewhere.
LatticeFilling fill_by_lattice(const LatticeRequest& request);

}  // namespace phyxel
