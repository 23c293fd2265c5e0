/// The search for voxels that put a given number of sample points inside a surface.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "mesh/inside_samples.hpp"

namespace phyxel {

/// What the search must find, and what it knows of the surface.
struct FillingRequest {
  Index phyxels = 0;          ///< For messages.
  double samples = 0;         ///< Number of sample points, within -10% and +30%.
  std::uint64_t seed = 1;     ///< Seed of the sample points.
  std::size_t triangles = 0;  ///< Number of triangles of the surface.
  /// Signed volume of a closed surface [m^3]; unset for an open one. Where a surface runs through
  /// itself inside out, parts of it count negative.
  std::optional<double> volume;
  int exponent = 0;     ///< Lengths of the surface are 2^exponent times those of the user's.
  std::string defects;  ///< The surface in words, for messages.
};

/// Sample points that fill the inside, and how they were found.
struct InsideFilling {
  std::vector<SampleBlock> blocks;
  SampleTally tally;  ///< Of the last sweep.
  double voxel = 0;   ///< Side of its voxels [m].
  int sweeps = 0;     ///< Sweeps over the whole surface.
  Offset work = 0;    ///< Work of all sweeps, in units of `SampleTally::work`.
};

/// The most work that the search does for a surface: about 100 times that of a compact body.
Offset most_filling_work(const FillingRequest& request);

/// Fills the inside with about as many sample points as asked for. Ends after `most_filling_work`
/// at the latest; after a hundredth of it if the surface's volume says that it cannot succeed.
/// @param filling is also set where the surface is refused
/// @throws InputError for a surface without volume, or with too little for its area or its size
void fill_inside(const InsideSampler& sampler, const FillingRequest& request,
                 InsideFilling& filling);

}  // namespace phyxel
