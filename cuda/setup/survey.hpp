/// Supports, list lengths and degenerate phyxels, found on a GPU.
#pragma once

#include <memory>

#include "model/share_surveyor.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// For `build_model`, whose lists are then found by `make_cuda_backend`: the same supports as on
/// the CPU to the last bit, kernel sums to rounding. The function throws DeviceError.
Surveyor cuda_surveyor(int device = 0);

/// For `build_share`, on ranks whose GPUs find their lists themselves. @throws DeviceError
std::unique_ptr<ShareSurveyor> cuda_share_surveyor(int device);

/// Whether those surveyors know what all bodies ask for: not `max_neighbours`, nor `closure`, and
/// `nearest` up to 256.
bool can_survey_on_cuda(const Scene& scene);

}  // namespace phyxel
