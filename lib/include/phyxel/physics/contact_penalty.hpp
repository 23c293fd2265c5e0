/// Contact of a point with a rigid obstacle as the derivative of an energy, for Newton's method:
/// a penalty on depth.
#pragma once

#include "phyxel/physics/contact.hpp"

namespace phyxel {

/// Force and stiffness of contact at a point, and their energy.
struct PenaltyForce {
  Vec3d force;        ///< On the point [N].
  Mat3d stiffness{};  ///< Minus its derivative, for a fixed normal [N/m].
  double energy = 0;  ///< [J]
};

/// The force on a point at a distance g < 0 from an obstacle: minus the derivative of ½ k g².
/// @param stiffness k [N/m]
inline PenaltyForce penalty_force(const Gap& gap, double stiffness) {
  return {(-stiffness * gap.distance) * gap.normal, stiffness * outer(gap.normal, gap.normal),
          0.5 * stiffness * gap.distance * gap.distance};
}

}  // namespace phyxel
