/// Which phyxels of a body a scene means.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "model/box.hpp"
#include "phyxel/cloud.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/space_region.hpp"

namespace phyxel {

/// A body of `size` phyxels, or those of it that the cloud has (already placed).
struct SomePhyxels {
  const Cloud& cloud;
  std::span<const Index> number;  ///< Which ones, ascending; empty: all.
  Index size = 0;
  Index number_of(Index i) const { return number.empty() ? i : number[i]; }
};

/// The faces of a box: as the scene has them, or as layers of a lattice were laid for a support.
enum class Faces { asked, laid };

/// The selected phyxels, ascending, counted in the cloud; there may be none.
/// @param request of the body
/// @throws InputError if a region is unknown, an index out of range, or a mesh not closed
std::vector<Index> select(const Selection& selection, const SomePhyxels& body,
                          const BodyRequest& request, Faces faces = Faces::asked);

/// Words for a message about a name that is not among the `named` sets, e.g.
/// ` (did you mean "x-"?); it has: x-, x+`.
std::string alternatives_to(const std::string& name,
                            const std::map<std::string, std::vector<Index>>& named);

/// The part of space that a selection means; unset if it means none.
std::optional<SpaceRegion> region_of(const Selection& selection);

/// The part of space in which a support acts: `region_of`, or, if faces have moved to layers of a
/// lattice, the region with these faces.
std::optional<SpaceRegion> acting_region(const Selection& selection, const SupportCuts& cuts);

/// The distance of a point from a region's boundary within which it lies on the boundary [m]: twice
/// the depth of phyxels, so that those on a face that two regions share belong to both.
double boundary_tolerance(const SpaceRegion& region, Vec3d point, const SupportCuts& cuts);

/// For a selection of nothing. @param box around the body @param more words for the message's end
/// @throws InputError
[[noreturn]] void refuse_selection(const Selection& selection, const std::string& name,
                                   const Box& box, const char* more = "");

}  // namespace phyxel
