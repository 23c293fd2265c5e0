/// The innermost loop of the search for nearest sites. It is compiled for this machine's vector
/// units, but without contractions, so that its results have the same bits on all machines.
#pragma once

#include <cstddef>
#include <cstdint>

namespace phyxel {

/// Coordinates of `count` points [m].
struct PointArrays {
  std::size_t count;
  const float *x, *y, *z;
};

/// Finds, for each point, the nearest candidate; of several at the same distance, the first.
/// @param distance2 work space, shape [points.count]
/// @param nearest receives the index of that candidate, shape [points.count]; 0 if there is none
void find_nearest(const PointArrays& points, const PointArrays& candidates, float* distance2,
                  std::int32_t* nearest);

}  // namespace phyxel
