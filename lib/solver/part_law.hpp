/// The law of a material as sums over phyxels in double see it: a caller's own or one of ours.
#pragma once

#include "phyxel/custom_law.hpp"
#include "phyxel/law_table.hpp"

namespace phyxel {

/// The law of a material without volume conservation. The material must outlive it.
class PartLaw {
 public:
  explicit PartLaw(const Material& material) : custom_(material.custom_law.get()) {
    if (!custom_) chosen_ = chosen_law(material);
  }
  /// Null for one of ours.
  const CustomLaw* custom() const { return custom_; }
  /// The index in `Laws` and the constants of one of ours.
  const ChosenLaw& chosen() const { return chosen_; }

  /// ψ [J/m³].
  double energy(const Mat3d& grad_u) const {
    if (custom_) return custom_->energy(grad_u);
    return Laws::with<double>(chosen_.index, chosen_.constants.data(),
                              [&](const auto& law) { return law.energy(grad_u); });
  }
  /// P [Pa].
  Mat3d first_piola_stress(const Mat3d& grad_u) const {
    if (custom_) return custom_->first_piola_stress(grad_u);
    return Laws::with<double>(chosen_.index, chosen_.constants.data(),
                              [&](const auto& law) { return law.first_piola_stress(grad_u); });
  }

 private:
  const CustomLaw* custom_;
  ChosenLaw chosen_;
};

}  // namespace phyxel
