/// Weights of the neighbours of a phyxel, as set-up and output need them.
#pragma once

#include <span>

#include "phyxel/physics/weight.hpp"

namespace phyxel {

/// The weights w_ij of the neighbours j of one phyxel i.
class RowWeights {
 public:
  /// @param support of all phyxels [m]. @param pair_length `Part::pair_length` of the body [m]
  PHYXEL_HD RowWeights(const double* support, Index i, double pair_length)
      : support_(support), length_(pair_length) {
    const double h = support[i], length = length_ > 0 ? length_ : h;
    inverse_ = 1 / (length * length);
    if (length_ > 0) half_ = relative_half_support(h, length_);
  }

  /// Returns use(weight_of), where weight_of(j, r²) is the weight of neighbour j at a distance r
  /// [m]: the rule is chosen once for a whole row.
  template <class Use>
  PHYXEL_HD auto with(Use&& use) const {
    if (length_ > 0) {
      return use([this](Index j, double r_squared) {
        return pair_weight(r_squared, half_, relative_half_support(support_[j], length_), inverse_);
      });
    }
    return use([this](Index, double r_squared) { return weight_shape(r_squared, inverse_); });
  }
  /// The weight of neighbour j at a distance r.
  PHYXEL_HD double operator()(Index j, double r_squared) const {
    return with([&](auto&& weight_of) { return weight_of(j, r_squared); });
  }

 private:
  const double* support_;
  double length_, inverse_ = 0, half_ = 0;
};

}  // namespace phyxel
