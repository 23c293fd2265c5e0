#include "phyxel/backend.hpp"

#include "phyxel/error.hpp"

namespace phyxel {

void Backend::fit_residuals(std::vector<double>&) {
  throw InputError(name() + ": no hourglass control here; allowed is hourglass = 0");
}

void Backend::set_external_forces(std::span<const Vec3d> force) {
  if (force.empty()) return;
  throw InputError(name() + ": forces of the caller's own are for the CPU: allowed are none here");
}

}  // namespace phyxel
