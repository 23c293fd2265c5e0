/// Which bodies have hourglass control, and how stiff it is.
#pragma once

#include <algorithm>

#include "phyxel/law_table.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/hourglass.hpp"

namespace phyxel {

/// Returns κ [N/m] of the body of a part; 0 without hourglass control. All parts of a body share
/// the value, that of the softest part, because pairs of phyxels of two parts do; it is the same on
/// every rank that has phyxels of the body. @param part a part of the model
inline double hourglass_stiffness(const Model& model, const Part& part) {
  const double strength = part.material.hourglass.value_or(0);
  if (!(strength > 0) || part.begin == part.end) return 0;
  double young = hourglass_modulus(part.material), volume = 0, size = 0, cubes = 0;
  for (const Part& other : model.parts_of_body(part)) {
    young = std::min(young, hourglass_modulus(other.material));
    volume += other.volume;
    size += other.size;
    cubes += other.support_cubes;
  }
  if (const double length = part.pair_length; length > 0) {
    // v/h³ is about the same everywhere: the volume of a phyxel whose support is H.
    return hourglass_stiffness(strength, young, volume / cubes * (length * length * length),
                               length);
  }
  return hourglass_stiffness(strength, young, volume / size,
                             model.neighbourhood.support[part.begin]);
}

inline bool has_hourglass_control(const Model& model) {
  for (const Part& part : model.parts) {
    if (part.material.hourglass.value_or(0) > 0) return true;
  }
  return false;
}

}  // namespace phyxel
