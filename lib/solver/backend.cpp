#include "phyxel/backend.hpp"

#include <fmt/format.h>

#include <cmath>

#include "phyxel/error.hpp"

namespace phyxel {
namespace {

[[noreturn]] void refuse_value(const char* name, std::size_t phyxel, Vec3d value) {
  throw InputError(fmt::format("{} of phyxel {} is ({}, {}, {}); allowed: finite numbers", name,
                               phyxel, value.x, value.y, value.z));
}

}  // namespace

void Backend::fit_residuals(std::vector<double>&) {
  throw InputError(name() + ": no hourglass control here; allowed is hourglass = 0");
}

std::vector<PhyxelMotion> Backend::motions_of(std::span<const Index> phyxels) {
  State state;
  download(state);
  std::vector<Mat3d> gradient;
  displacement_gradients(gradient);
  std::vector<PhyxelMotion> motions;
  motions.reserve(phyxels.size());
  for (const Index i : phyxels) {
    motions.push_back({state.displacement[i], state.velocity[i], gradient[i]});
  }
  return motions;
}

void Backend::put_displacements(std::span<const Vec3d> displacement) {
  State state;
  download(state);
  check_displacements(displacement, size());
  state.displacement.assign(displacement.begin(), displacement.end());
  put(state);
}

void Backend::upload(const State& state) {
  check_state(state, size());
  put(state);
}

void check_state(const State& state, Index phyxels) {
  const auto n = static_cast<std::size_t>(phyxels);
  if (state.displacement.size() != n || state.velocity.size() != n) {
    throw InputError(fmt::format(
        "a state of {} displacements and {} velocities for a model of {} phyxels: allowed "
        "are {} of each",
        state.displacement.size(), state.velocity.size(), n, n));
  }
  const auto check = [](const char* name, const std::vector<Vec3d>& values) {
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (!is_finite(values[i])) refuse_value(name, i, values[i]);
    }
  };
  check("displacement [m]", state.displacement);
  check("velocity [m/s]", state.velocity);
  if (!std::isfinite(state.history_interval) || state.history_interval < 0) {
    throw InputError(fmt::format("history_interval = {} s of a state; allowed: >= 0, finite",
                                 state.history_interval));
  }
}

void check_fits(const Model& model, const Backend& backend) {
  if (model.size() == backend.size()) return;
  throw InputError(
      fmt::format("a model of {} phyxels and a backend of {}: allowed is the backend that was made "
                  "of the model",
                  model.size(), backend.size()));
}

void check_displacements(std::span<const Vec3d> displacement, Index phyxels) {
  if (displacement.size() == static_cast<std::size_t>(phyxels)) return;
  throw InputError(fmt::format("{} displacements for {} phyxels: allowed are {}",
                               displacement.size(), phyxels, phyxels));
}

void check_external_forces(std::span<const Vec3d> force, const Model& model) {
  const auto n = static_cast<std::size_t>(model.size());
  if (!force.empty() && force.size() != n) {
    throw InputError(fmt::format("{} external forces for {} phyxels: allowed are {} or none",
                                 force.size(), n, n));
  }
  for (std::size_t i = 0; i < force.size(); ++i) {
    if (is_finite(force[i]) || !model.owns(static_cast<Index>(i))) continue;
    refuse_value("external force [N]", i, force[i]);
  }
}

void Backend::set_external_forces(std::span<const Vec3d> force) {
  if (force.empty()) return;
  throw InputError(name() + ": takes no external forces: allowed are none");
}

}  // namespace phyxel
