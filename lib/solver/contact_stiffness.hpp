/// The springs of contact by penalties.
#pragma once

#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// Stiffness of penalties in Verlet's steps, times `penalty` of an obstacle or of bodies and that
/// of a phyxel against its neighbours. On a face of phyxels s apart, whose volumes are s³/2 and
/// whose supports are 2.2 s, a phyxel then has `penalty` M s.
inline constexpr double share_of_layer = 10;

/// True if penalties act in Verlet's steps of a model.
bool has_penalties(const Model& model);

/// True if bodies touch each other by penalties in Verlet's steps.
inline bool has_body_penalties(const Model& model) {
  return model.body_contact.acts() && model.body_contact.penalty > 0;
}

/// True if some bodies rub on each other.
bool has_body_friction(const BodyContact& contact);

/// The stiffness of the penalty of an obstacle on each phyxel of the contact layer [N/m],
/// share m c²/h².
std::vector<double> stiffness_of_layer(const Model& model, double share);

/// An upper bound of the largest eigenfrequency of the springs of penalties in Verlet's steps on
/// the masses of phyxels [rad/s]; 0 without such springs. Of a share: collective.
double contact_frequency(const Model& model);

}  // namespace phyxel
