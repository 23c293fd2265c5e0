/// Bodies of several materials: their phyxels, sorted by material.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "model/assembly.hpp"
#include "model/selection.hpp"

namespace phyxel {

/// Phyxels side by side that are of one material.
struct MaterialGroup {
  Index which = 0;  ///< 0 for the body's own material, k + 1 for its inclusion k.
  Material material;
  std::string name;  ///< For summaries.
  Index begin = 0, end = 0;
};

/// The material of each phyxel of a body: 0 for the body's own, k + 1 for its inclusion k. An
/// inclusion covers those before it.
struct MaterialChoice {
  std::vector<Index> material_of;      ///< shape [n]
  std::vector<std::int64_t> size;      ///< Phyxels of each material.
  std::vector<std::int64_t> selected;  ///< Phyxels that each inclusion selects, covered or not.
};
/// @param here a whole body, or some of its phyxels
/// @throws InputError as `select`
MaterialChoice choose_materials(const BodyRequest& request, const SomePhyxels& here);

/// The groups of a body's phyxels: its own material first, then its inclusions in the scene's
/// order, less those that others have covered.
/// @param size and @param selected as in `MaterialChoice`, of the whole body. @param box around it
/// @throws InputError naming the scene's line for an inclusion of no phyxel, or if none is left of
///   the body's own material
std::vector<MaterialGroup> material_groups(const BodyRequest& request,
                                           std::span<const std::int64_t> size,
                                           std::span<const std::int64_t> selected, const Box& box);

/// Refuses the inclusions of a body.
/// @throws InputError naming the first inclusion's line, why, and what is allowed
[[noreturn]] void refuse_inclusions(const BodyRequest& request, const char* why,
                                    const char* allowed);

/// A cloud and the order its phyxels are in by now.
struct SortedCloud {
  Cloud cloud;
  std::vector<Index> place;  ///< Where each phyxel of the cloud before is.
  std::vector<MaterialGroup> groups;
};

/// Sorts the phyxels of a body by material, and keeps their order within each.
/// @throws InputError as `material_groups`
SortedCloud sort_by_material(const BodyRequest& request, const Cloud& cloud);

}  // namespace phyxel
