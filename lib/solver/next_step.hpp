/// What bodies and obstacles do in the next of Verlet's steps, without taking it.
#pragma once

#include <optional>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {

/// What bodies and obstacles do over the step from an instant, on this rank.
struct NextStep {
  StepSums sums;               ///< As `StepContacts` and `BodyContacts` would add them.
  std::vector<double> depths;  ///< Now, as of `BodyContacts::depths`.
  /// Forces of other bodies on phyxels of this rank that the forces of the instant do not contain
  /// [N], shape [n]; empty if bodies do not touch each other. Those on held phyxels change no
  /// motion, and their supports bear them.
  std::vector<Vec3d> of_bodies;
};

/// Finds it on the backend's device; nothing where that is left to the host. Of a share:
/// collective.
/// @param time present time [s]. @param dt size of the step [s]
std::optional<NextStep> next_step_of_device(Backend& backend, double time, double dt);

/// Finds it from the present state. Of a share: collective.
/// @param now instant of `PresentForces`. @param state the present state
NextStep next_step(const Model& model, Backend& backend, const SupportInstant& now,
                   const State& state);

/// Finds the forces of obstacles on phyxels that supports hold along some axes or all, which the
/// forces of the instant do not contain, over the step from an instant [N], shape [n]; empty if
/// nothing of a model that is held touches obstacles. Along free axes they mean nothing. Of a
/// share: collective.
/// @param now instant of `PresentForces`, but with the forces of other bodies, too
/// @param state the present state
std::vector<Vec3d> obstacles_on_supports(const Model& model, Backend& backend,
                                         const SupportInstant& now, const State& state);

}  // namespace phyxel
