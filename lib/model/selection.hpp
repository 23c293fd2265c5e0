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

/// The selected phyxels, ascending, counted in the cloud; there may be none.
/// @param request of the body
/// @throws InputError if a region is unknown, an index out of range, or a mesh not closed
std::vector<Index> select(const Selection& selection, const SomePhyxels& body,
                          const BodyRequest& request);

/// Words for a message about a name that is not among the `named` sets, e.g.
/// ` (did you mean "x-"?); it has: x-, x+`.
std::string alternatives_to(const std::string& name,
                            const std::map<std::string, std::vector<Index>>& named);

/// The part of space that a selection means; unset if it means none.
std::optional<SpaceRegion> region_of(const Selection& selection);

/// For a selection of nothing. @param box around the body @throws InputError
[[noreturn]] void refuse_selection(const Selection& selection, const std::string& name,
                                   const Box& box);

}  // namespace phyxel
