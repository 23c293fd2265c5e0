#include "mesh/nearest_points.hpp"

#include <limits>

namespace phyxel {

void find_nearest(const PointArrays& points, const PointArrays& candidates, float* distance2,
                  std::int32_t* nearest) {
  const std::size_t n = points.count;
  const float *const x = points.x, *const y = points.y, *const z = points.z;
  for (std::size_t k = 0; k < n; ++k) {
    distance2[k] = std::numeric_limits<float>::max();
    nearest[k] = 0;
  }
  for (std::size_t c = 0; c < candidates.count; ++c) {
    const float cx = candidates.x[c], cy = candidates.y[c], cz = candidates.z[c];
    const auto number = static_cast<std::int32_t>(c);
#pragma omp simd
    for (std::size_t k = 0; k < n; ++k) {
      const float dx = x[k] - cx, dy = y[k] - cy, dz = z[k] - cz;
      const float d2 = dx * dx + dy * dy + dz * dz;
      const bool nearer = d2 < distance2[k];
      nearest[k] = nearer ? number : nearest[k];
      distance2[k] = nearer ? d2 : distance2[k];
    }
  }
}

}  // namespace phyxel
