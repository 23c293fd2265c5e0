/// Which bodies have hourglass control, and how stiff it is.
#pragma once

#include "phyxel/model.hpp"
#include "phyxel/physics/hourglass.hpp"

namespace phyxel {

/// κ of a body [N/m]; 0: none. The same on every rank that has phyxels of it.
inline double hourglass_stiffness(const Model& model, const Part& part) {
  const Material& m = part.material;
  if (!(m.hourglass > 0) || part.begin == part.end) return 0;
  return hourglass_stiffness(m.hourglass, m.young, part.volume / part.size,
                             model.neighbourhood.support[part.begin]);
}

inline bool has_hourglass_control(const Model& model) {
  for (const Part& part : model.parts) {
    if (part.material.hourglass > 0) return true;
  }
  return false;
}

}  // namespace phyxel
