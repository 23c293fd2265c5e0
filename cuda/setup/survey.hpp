/// Neighbour search on a GPU: supports, list lengths and degenerate phyxels, without lists.
#pragma once

#include <memory>

#include "model/share_surveyor.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// The neighbour search of `build_model` on a GPU; `make_cuda_backend` then finds the lists.
/// Supports are equal to the CPU's bit by bit, kernel sums up to rounding. The function that is
/// returned throws DeviceError.
Surveyor cuda_surveyor(int device = 0);

/// The neighbour search of `build_share`, for ranks whose GPUs find their lists. @throws
/// DeviceError
std::unique_ptr<ShareSurveyor> cuda_share_surveyor(int device);

/// True if the search on a GPU supports all bodies of a scene: no `max_neighbours`, no inclusions,
/// no supports that end inside a body, no spacings of their own, and `nearest` up to 256.
bool can_survey_on_cuda(const Scene& scene);

}  // namespace phyxel
