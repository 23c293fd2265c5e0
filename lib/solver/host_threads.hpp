/// The number of threads of the host that work beside a backend.
#pragma once

#include <omp.h>

#include "phyxel/backend.hpp"

namespace phyxel {

/// The number of threads of the host that share work on a backend's values: the backend's own, or
/// all that OpenMP gives where the backend is on a device.
inline int host_threads(const Backend& backend) {
  return backend.threads() > 0 ? backend.threads() : omp_get_max_threads();
}

}  // namespace phyxel
