/// Room in the arrays of a model that grow with each body.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// The sizes of these arrays, in an order of their own.
std::vector<std::size_t> sizes_of(const Model& model);

/// Makes room for copies of the last body, so that arrays do not move as these are added.
/// @param before sizes of the arrays without that body
void reserve_for_copies(Model& model, std::span<const std::size_t> before, std::size_t copies);

}  // namespace phyxel
