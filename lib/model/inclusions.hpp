/// Bodies of several materials: their phyxels, sorted by material.
#pragma once

#include <vector>

#include "model/assembly.hpp"

namespace phyxel {

/// Phyxels side by side that are of one material.
struct MaterialGroup {
  Material material;
  std::string name;  ///< For summaries.
  Index begin = 0, end = 0;
};

/// A cloud and the order its phyxels are in by now.
struct SortedCloud {
  Cloud cloud;
  std::vector<Index> place;  ///< Where each phyxel of the cloud before is.
  std::vector<MaterialGroup> groups;
};

/// The body's own material first, then its inclusions in the scene's order; those that others have
/// covered are left out.
/// @throws InputError naming the scene's line for an inclusion of no phyxel, or if none is left of
///   the body's own material
SortedCloud sort_by_material(const BodyRequest& request, const Cloud& cloud);

}  // namespace phyxel
