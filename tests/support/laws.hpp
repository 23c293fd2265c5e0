/// A law of a caller's own whose answers are known.
#pragma once

#include <string>

#include "phyxel/custom_law.hpp"
#include "phyxel/material.hpp"
#include "phyxel/physics/laws/neo_hookean.hpp"

namespace phyxel::testing {

/// The library's neo-Hookean law once more, so many times as stiff.
class Repeated final : public CustomLaw {
 public:
  explicit Repeated(const Material& m, double factor = 1)
      : law_{{m.lame_lambda(), m.lame_mu()}}, factor_(factor) {}
  std::string name() const override { return "repeated " + std::to_string(factor_); }
  double energy(const Mat3d& grad_u) const override { return factor_ * law_.energy(grad_u); }
  Mat3d first_piola_stress(const Mat3d& grad_u) const override {
    return factor_ * law_.first_piola_stress(grad_u);
  }

 private:
  NeoHookean<double> law_;
  double factor_;
};

}  // namespace phyxel::testing
