#include "phyxel/backend.hpp"

#include <fmt/format.h>

#include "phyxel/error.hpp"

namespace phyxel {

void Backend::fit_residuals(std::vector<double>&) {
  throw InputError(name() + ": no hourglass control here; allowed is hourglass = 0");
}

void Backend::put_displacements(std::span<const Vec3d> displacement) {
  State state;
  download(state);
  state.displacement.assign(displacement.begin(), displacement.end());
  upload(state);
}

void check_sizes(const State& state, Index phyxels) {
  const auto n = static_cast<std::size_t>(phyxels);
  if (state.displacement.size() == n && state.velocity.size() == n) return;
  throw InputError(fmt::format(
      "a state of {} displacements and {} velocities for a model of {} phyxels: allowed "
      "are {} of each",
      state.displacement.size(), state.velocity.size(), n, n));
}

void check_external_forces(std::span<const Vec3d> force, Index phyxels) {
  if (force.empty() || force.size() == static_cast<std::size_t>(phyxels)) return;
  throw InputError(fmt::format("{} external forces for {} phyxels: allowed are {} or none",
                               force.size(), phyxels, phyxels));
}

void Backend::set_external_forces(std::span<const Vec3d> force) {
  if (force.empty()) return;
  throw InputError(name() + ": takes no external forces: allowed are none");
}

}  // namespace phyxel
