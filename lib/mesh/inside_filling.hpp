/// The search for voxels that put a given number of sample points inside a surface.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mesh/inside_samples.hpp"

namespace phyxel {

/// The number of sample points to find, and the known properties of the surface.
struct FillingRequest {
  Index phyxels = 0;          ///< Number of phyxels, named in error messages.
  double samples = 0;         ///< Number of sample points wanted; -10% to +30% are accepted.
  std::uint64_t seed = 1;     ///< Seed of the sample points.
  std::size_t triangles = 0;  ///< Number of triangles of the surface.
  /// Signed volume of a closed surface [m^3]; unset for an open one. Regions that a
  /// self-intersecting surface encloses inside out count negative.
  std::optional<double> volume;
  int exponent = 0;     ///< The surface is scaled by 2^exponent relative to the user's.
  std::string defects;  ///< Description of the surface's defects, for error messages.
};

/// Sample points that fill the inside of a surface, and the cost of the search.
struct InsideFilling {
  std::vector<SampleBlock> blocks;
  SampleTally tally;  ///< Counts of the last sweep.
  double voxel = 0;   ///< Side of the voxels of the last sweep [m].
  int sweeps = 0;     ///< Sweeps over the whole surface.
  Offset work = 0;    ///< Work of all sweeps, in units of `SampleTally::work`.
};

/// Upper limit of the search's work for a surface: about 100 times the work for a compact body.
Offset most_filling_work(const FillingRequest& request);

/// Fills the inside with about the requested number of sample points. The search ends after
/// `most_filling_work` at the latest, and after a hundredth of it if the surface's volume shows
/// that it cannot succeed.
/// @param filling is set even if the surface is refused
/// @throws InputError if the surface has no volume, or too little for its area or its size
void fill_inside(const InsideSampler& sampler, const FillingRequest& request,
                 InsideFilling& filling);

}  // namespace phyxel
