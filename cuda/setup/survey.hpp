/// Supports, list lengths and degenerate phyxels, found on a GPU.
#pragma once

#include "phyxel/model.hpp"

namespace phyxel {

/// For `build_model`, whose lists are then found by `make_cuda_backend`: the same supports as on
/// the CPU to the last bit, kernel sums to rounding. The function throws DeviceError.
Surveyor cuda_surveyor(int device = 0);

/// Whether that surveyor knows the rules of all bodies: not `max_neighbours`, and `nearest` up to
/// 256.
bool can_survey_on_cuda(const Scene& scene);

}  // namespace phyxel
