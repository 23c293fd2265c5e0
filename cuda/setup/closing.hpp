/// Closed gradients found by a GPU.
#pragma once

#include "model/closure.hpp"

namespace phyxel {

/// The search of a GPU for what closes the sums of bodies, with the bits of `search_on_host`. Where
/// its memory has no room, on any rank, the host searches. What is returned throws DeviceError.
ClosingSearch cuda_closing_search(int device = 0);

}  // namespace phyxel
