/// The choice of how the steps of a model are launched.
#pragma once

#include <memory>
#include <string>

#include "solver/boundary.cuh"
#include "solver/contacts.cuh"
#include "solver/device_halo.cuh"
#include "solver/residence.cuh"

namespace phyxel::cuda {

/// Steps per graph, and per launch of resident steps that records a trail for surfels.
inline constexpr int steps_together = 16;

/// The way in which steps are launched: resident, by graphs, or with two launches per step. All
/// give the same bits.
template <class Real, class StateReal>
struct LaunchPath {
  std::unique_ptr<Residence<Real, StateReal>> residence;  ///< Null if steps are not resident.
  bool recorded = false;  ///< True if `steps_together` steps are one graph.
  std::string reason;     ///< Reason of the choice, for messages.
};

/// Chooses how steps are launched: resident in shared memory if the model allows it, else by graphs
/// if launches would cost time, else with two launches per step. Collective on a share.
/// @param halo halo of a share, or null
template <class Real, class StateReal>
LaunchPath<Real, StateReal> choose_path(const DeviceModel<Real, StateReal>& model,
                                        const DeviceHalo<Real, StateReal>* halo,
                                        const Boundary<Real, StateReal>& boundary,
                                        const Contacts<Real, StateReal>& contacts,
                                        CudaPath wanted) {
  constexpr Index most_recorded = 4'000'000;  // larger models: a step outlasts its launches
  LaunchPath<Real, StateReal> path;
  std::string launches;  // reason against a graph; empty if there is none
  if (wanted == CudaPath::launches) {
    launches = "as asked";
  } else if (boundary.changes()) {
    launches = "motions, and loads that grow or follow the surface, change from step to step";
  } else if (contacts.changes()) {
    launches = "obstacles move from step to step";
  } else if (model.model().body_contact.acts()) {
    launches = "points that may touch change from step to step";
  } else if (model.model().fracture.acts() && model.share()) {
    launches = "ghosts are received before pairs are looked at after each step";
  } else if (contacts.acts() && model.share()) {
    launches = "phyxels are kept out of obstacles before they are sent";
  } else if (model.size() > most_recorded) {
    launches = "a step of " + model.subject() + " takes longer than its launches";
  } else if (halo && !halo->is_direct()) {
    launches = "the host takes part in the exchange between ranks";
  }
  if (model.share()) {
    // All ranks choose alike, or one would wait for kernels that another has not launched yet.
    path.recorded = model.share()->communicator->smallest(launches.empty()) > 0;
    path.reason = path.recorded      ? "ranks exchange ghosts in every step"
                  : launches.empty() ? "another rank cannot record its steps"
                                     : launches;
    return path;
  }
  if (wanted == CudaPath::automatic && model.model().fracture.acts()) {
    path.reason = "pairs that break are looked for after each step";
  } else if (wanted == CudaPath::automatic && model.model().body_contact.acts()) {
    path.reason = "bodies that touch each other are kept apart after each step";
  } else if (wanted == CudaPath::automatic && contacts.acts()) {
    path.reason = "phyxels are kept out of obstacles after each step";
  } else if (wanted == CudaPath::automatic && !boundary.changes()) {
    auto attempt = Residence<Real, StateReal>::of(model);
    path.residence = std::move(attempt.residence);
    path.reason = std::move(attempt.reason);
    if (path.residence) return path;
  }
  path.recorded = launches.empty();
  if (!path.recorded) path.reason = launches;
  return path;
}

}  // namespace phyxel::cuda
