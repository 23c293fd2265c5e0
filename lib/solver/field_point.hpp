/// The gradient and the stress of a phyxel in output fields.
#pragma once

#include <span>

#include "solver/part_law.hpp"

namespace phyxel {

/// The gradient and the stress of a phyxel in output fields.
struct FieldPoint {
  Mat3d grad_u;
  Mat3d first_piola_stress;  ///< [Pa]
};

/// The point of a phyxel's own gradient, from which forces follow.
/// @param history of the state, in the law's order. @param dt length of the step that it awaits [s]
FieldPoint own_point(const PartLaw& law, const Mat3d& own, std::span<const double> history,
                     double dt);

/// The point of a phyxel on the surface whose gradient is recovered. The gradient is changed along
/// the normal so that the traction is that of the own stress. Viscous stresses, which follow from
/// rates, stay what they are.
///
/// Phyxels keep their own point if their material has yielded, or has the history of a caller's
/// law: the history belongs to the own gradient, and the elastic part of the difference to another
/// gradient is not known. A phyxel also keeps its own point if its det F would change by a factor
/// of two, or its gradient by much more than recovery asks for, as at a kink.
/// @param own the result of `own_point`. @param normal outward. @param share of the recovered
///   gradient
FieldPoint recovered_point(const PartLaw& law, const FieldPoint& own,
                           std::span<const double> history, const Mat3d& recovered, Vec3d normal,
                           double share);

}  // namespace phyxel
