/// Energies, momenta and the watch over them.
#pragma once

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// Energies, conserved quantities and a finiteness check of a backend's present state, which is at
/// `time` = `step` × `dt`. Sums run in double and in the order of the phyxels, so they do not
/// depend on the number of threads.
Diagnostics diagnose(const Model& model, Backend& backend, std::int64_t step, double dt);

/// Von Mises equivalent of the Cauchy stress [Pa] and det F of every phyxel, shape [n]; either
/// pointer may be null.
void stress_fields(const Model& model, Backend& backend, std::vector<double>* von_mises,
                   std::vector<double>* volume_ratio);

/// Speed of pressure waves, sqrt((λ + 2μ + k_v) / ρ) [m/s].
double pressure_wave_speed(const Material& material);

}  // namespace phyxel
