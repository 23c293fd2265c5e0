/// Walls of bodies: where they are, and which neighbours they part.
#pragma once

#include <span>
#include <vector>

#include "phyxel/cloud.hpp"
#include "phyxel/neighbourhood.hpp"
#include "phyxel/scene.hpp"

namespace phyxel {

/// The walls of a body, of whose cuts those count whose supports hold all axes, by one or several
/// entries.
Walls walls_of(const BodyRequest& request, const Cloud& cloud);

/// Removes the pairs of phyxels that are not in the same room of a body. A phyxel beside a wall
/// keeps them if no phyxel lies on the wall near it, as in a layer outside the wall that is too
/// thin for others. A phyxel on or outside a wall also keeps them if its other neighbours lie
/// nearly in a plane, as in an acute wedge between the wall and the surface.
/// @param pair_length `Part::pair_length` of the body
void separate(Neighbourhood& hood, std::span<const Vec3d> position, const Walls& walls,
              double pair_length);

/// The regions of space in which a body is held or moved, in place, without repetitions, and in the
/// order of `comes_before`. A region holds all axes if the entries that have it hold or move all,
/// one or several together.
std::vector<SupportRegion> support_regions(const BodyRequest& request);

/// The source of a body, with the regions at whose boundaries the body's supports end, before it
/// is scaled and moved.
struct CutSource {
  BodySource source;
  std::vector<SupportRegion> supports;
  std::vector<Grading::Finer> finer;  ///< Regions in which phyxels are nearer to each other.
  double shift = 0;  ///< Length of the translation, whose digits coordinates of supports lack [m].
};
CutSource source_of(const BodyRequest& request);

/// The source of bodies that follow one another and are copies: that of the first, so that all have
/// the same cloud before they are placed.
struct SharedSource {
  CutSource from;
  std::vector<std::size_t> bodies;  ///< Their numbers in the scene, ascending.
};
/// The sources of a scene's bodies, in their order.
std::vector<SharedSource> shared_sources(const Scene& scene);

/// True if two sources are the same but for the rounding of their supports, as those of copies of a
/// body are.
bool is_same(const CutSource& a, const CutSource& b);

/// Moves the cuts of a cloud to where the supports of a body are; cuts of other supports are left
/// out.
void place_cuts(Cloud& cloud, const BodyRequest& request);

}  // namespace phyxel
