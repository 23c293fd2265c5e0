/// The choice of how the steps of a model are launched.
#pragma once

#include <memory>
#include <string>

#include "solver/boundary.cuh"
#include "solver/device_halo.cuh"
#include "solver/residence.cuh"

namespace phyxel::cuda {

/// Steps of a graph, and of a launch of resident steps that leaves a trail for surfels.
inline constexpr int steps_together = 16;

/// How steps are launched: resident, by graphs, or else two launches a step. All give the same
/// bits.
template <class Real, class StateReal>
struct LaunchPath {
  std::unique_ptr<Residence<Real, StateReal>> residence;  ///< Null: steps are not resident.
  bool recorded = false;  ///< True if `steps_together` steps are one graph.
  std::string reason;     ///< Of this choice, in words.
};

/// Chooses how steps are launched: resident in shared memory where the model allows it, else by
/// graphs where launches would count, else two launches a step. Of a share: collective.
/// @param halo of a share, or null
template <class Real, class StateReal>
LaunchPath<Real, StateReal> choose_path(const DeviceModel<Real, StateReal>& model,
                                        const DeviceHalo<Real, StateReal>* halo,
                                        const Boundary<Real, StateReal>& boundary,
                                        CudaPath wanted) {
  constexpr Index most_recorded = 4'000'000;  // a step of more takes longer than its launches
  LaunchPath<Real, StateReal> path;
  std::string launches;  // why there is no graph; empty: there is one
  if (wanted == CudaPath::launches) {
    launches = "as asked";
  } else if (boundary.changes()) {
    launches = "motions and growing loads change from step to step";
  } else if (model.size() > most_recorded) {
    launches = "a step of " + model.subject() + " takes longer than its launches";
  } else if (halo && !halo->is_direct()) {
    launches = "the host takes part in the exchange between ranks";
  }
  if (model.share()) {
    // Ranks launch alike, or one would wait for what another has not launched yet.
    path.recorded = model.share()->communicator->smallest(launches.empty()) > 0;
    path.reason = path.recorded      ? "ranks exchange ghosts in every step"
                  : launches.empty() ? "another rank cannot record its steps"
                                     : launches;
    return path;
  }
  if (wanted == CudaPath::automatic && !boundary.changes()) {
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
