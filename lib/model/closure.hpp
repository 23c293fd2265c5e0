/// The set-up of closed gradients (phyxel/physics/closing.hpp).
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "model/closing_bodies.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// A body whose gradients shall be closed.
struct ClosedBody {
  std::span<Part> parts;
  double enclosed = 0;  ///< Volume inside its surface [m³].
};

/// What closes the sums of bodies, of each phyxel of a model: 0 beyond the bodies and for ghosts.
struct Closing {
  std::vector<double> volume;  ///< Relative changes of volumes.
  std::vector<Vec3d> vector;   ///< Closing vectors ĉ at the changed volumes [1/m].
  std::vector<double> area;    ///< Relative changes of areas.
};

/// A search for what closes the sums of bodies, in which the iterations of each body end where it
/// stands then. The model may be a connected share. Collective.
/// @param areas S of each phyxel of the model, undefined for ghosts [m²]
using ClosingSearch = std::function<Closing(const Model& model, const closing::Bodies& bodies,
                                            const std::vector<Vec3d>& areas)>;
/// The search on the threads of the host.
Closing search_on_host(const Model& model, const closing::Bodies& bodies,
                       const std::vector<Vec3d>& areas);

/// Finds the closing vectors of bodies, and their volumes: those of the surface's inside, each
/// changed by some percent where that closes the sums better. Masses stay; loads by volume follow.
/// The model may be a connected share: closing vectors have the same bits on any number of ranks,
/// and all ranks get the same result. Collective.
/// @param bodies in the order of the model's
/// @param areas S of each phyxel of the model (`areas_of_phyxels`), undefined for ghosts [m²]
/// @returns why the sums of a body cannot be closed; nothing if they are
std::optional<std::string> close_bodies(Model& model, const std::vector<ClosedBody>& bodies,
                                        const std::vector<Vec3d>& areas,
                                        const ClosingSearch& search);

/// Closes the gradients of the bodies of a whole model that ask for it.
/// @throws InputError naming the body if its sums cannot be closed
void close_gradients(Model& model, const ClosingSearch& search);

}  // namespace phyxel
