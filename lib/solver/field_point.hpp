/// What fields show of a phyxel on the surface.
#pragma once

#include <span>
#include <vector>

#include "solver/part_law.hpp"

namespace phyxel {

/// The gradient, the stress and the history that fields show of a phyxel.
struct FieldPoint {
  Mat3d grad_u;
  Mat3d first_piola_stress;     ///< [Pa]
  std::vector<double> history;  ///< Of the state, in the law's order.
};

/// The point of a phyxel's own gradient, from which forces follow.
/// @param history of the state, in the law's order. @param dt length of the step that it awaits [s]
FieldPoint own_point(const PartLaw& law, const Mat3d& own, std::span<const double> history,
                     double dt);

/// The point of a phyxel on the surface whose gradient is recovered. The gradient is changed along
/// the normal so that the traction is that of the own stress. A material with a history takes the
/// way from its own gradient to this one as a further step, in which viscous stresses stay what
/// they are. If it yields on that way, stress and history are those after the step; if it yields on
/// the opposite way, it has come less far than its own gradient says, and the history is the own
/// one minus what changes on that way. The stress never lies beyond the yield surface. A phyxel
/// whose det F would change by a factor of two, as at a kink, keeps its own point.
/// @param own the result of `own_point`. @param normal outward. @param share of the recovered
///   gradient
FieldPoint recovered_point(const PartLaw& law, const FieldPoint& own, const Mat3d& recovered,
                           Vec3d normal, double share);

}  // namespace phyxel
