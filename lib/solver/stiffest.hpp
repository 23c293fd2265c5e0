/// The largest `Stiffening` of phyxels, independent of the order in which they are added.
#pragma once

#include <cmath>
#include <limits>

#include "phyxel/communicator.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// Ties of the ratio go to the larger stretch, ties of the stretch to the smaller global id. A NaN
/// ratio counts as infinite.
class Stiffest {
 public:
  Stiffest() = default;
  explicit Stiffest(const Stiffening& found) : found_(found) {}

  void look_at(double ratio, double stretch, Index phyxel) {
    if (!(ratio < infinity)) ratio = infinity;
    if (!(stretch < infinity)) stretch = infinity;
    const bool equal = ratio == found_.ratio && stretch == found_.stretch;
    if (found_.phyxel >= 0 &&
        (ratio < found_.ratio || (ratio == found_.ratio && stretch < found_.stretch) ||
         (equal && phyxel > found_.phyxel))) {
      return;
    }
    found_ = {ratio, stretch, phyxel};
  }
  void look_at(const Stiffest& other) {
    const Stiffening& o = other.found_;
    if (o.phyxel >= 0) look_at(o.ratio, o.stretch, o.phyxel);
  }
  /// Combines the results of all ranks. Collective.
  void look_at_ranks(const Communicator& ranks) {
    const bool any = found_.phyxel >= 0;
    const double ratio = ranks.largest(any ? found_.ratio : 0);
    bool mine = any && found_.ratio == ratio;
    const double stretch = ranks.largest(mine ? found_.stretch : 0);
    mine = mine && found_.stretch == stretch;
    const double who = ranks.smallest(mine ? static_cast<double>(found_.phyxel) : infinity);
    found_ = {ratio, stretch, who < infinity ? static_cast<Index>(who) : -1};
  }
  const Stiffening& values() const { return found_; }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();
  Stiffening found_{0, 0, -1};
};

}  // namespace phyxel
