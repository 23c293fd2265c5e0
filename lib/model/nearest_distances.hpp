/// The nearest points of a place, shared by the searches on the CPU and on the GPU: mean distances,
/// and so supports, are the same on both.
#pragma once

#include <cmath>

#include "model/cell_grid.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// The smallest squared distances that were offered, ascending.
class NearestDistances {
 public:
  /// @param squared room for `wanted` of them
  PHYXEL_HD NearestDistances(double* squared, int wanted) : squared_(squared), wanted_(wanted) {}
  PHYXEL_HD void clear() { found_ = 0; }
  PHYXEL_HD bool full() const { return found_ == wanted_; }
  PHYXEL_HD double largest() const { return squared_[found_ - 1]; }
  PHYXEL_HD void offer(double d2) {
    if (full() && d2 >= largest()) return;
    int k = full() ? found_ - 1 : found_++;
    for (; k > 0 && squared_[k - 1] > d2; --k) squared_[k] = squared_[k - 1];
    squared_[k] = d2;
  }
  PHYXEL_HD double mean_distance() const {
    using std::sqrt;
    double sum = 0;
    for (int k = 0; k < found_; ++k) sum += sqrt(squared_[k]);
    return found_ ? sum / found_ : 0;
  }

 private:
  double* squared_;
  int wanted_, found_ = 0;
};

/// Offers points ring by ring of cells, until no nearer one can come.
/// @param last_ring beyond it there is no point
/// @param offer_ring offer_ring(ring): the points of the cells that many away
/// @param offer_all all points
template <class OfferRing, class OfferAll>
PHYXEL_HD void search_nearest(NearestDistances& found, int last_ring, double cell_size,
                              OfferRing&& offer_ring, OfferAll&& offer_all) {
  for (int ring = 0; ring <= last_ring; ++ring) {
    if (ring == 12) {  // far from everything: looking at every point is cheaper
      found.clear();
      offer_all();
      return;
    }
    // Rings 0 to ring - 1 hold every point nearer than (ring - 1) cells.
    const double reached = (ring - 1 - 2 * cell_rounding) * cell_size;
    if (ring > 0 && found.full() && found.largest() <= reached * reached) return;
    offer_ring(ring);
  }
}

}  // namespace phyxel
