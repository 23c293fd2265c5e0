/// Materials and stress measures for tests of J2 plasticity.
#pragma once

#include <cmath>
#include <type_traits>

#include "phyxel/physics/laws/j2.hpp"
#include "support/deformations.hpp"
#include "support/laws.hpp"

namespace phyxel::testing::j2 {

/// A J2 material by the keys of its parameters.
struct J2Parameters {
  double young = 0, poisson = 0, yield_stress = 0, hardening = 0, saturation_stress = 0,
         saturation_rate = 0;

  operator Material() const {  // NOLINT: tests hand these to what takes materials
    Material m;
    m.young = young;
    m.poisson = poisson;
    m.law = "j2";
    m.parameters = {{"yield_stress", yield_stress},
                    {"hardening", hardening},
                    {"saturation_stress", saturation_stress},
                    {"saturation_rate", saturation_rate}};
    return m;
  }
};

// Copper, in GPa: with linear hardening, with Voce's, and with none.
inline const J2Parameters linear{
    .young = 117, .poisson = 0.35, .yield_stress = 0.4, .hardening = 0.1};
inline const J2Parameters voce{.young = 117,
                               .poisson = 0.35,
                               .yield_stress = 0.4,
                               .hardening = 0.1,
                               .saturation_stress = 0.7,
                               .saturation_rate = 16.93};
inline const J2Parameters perfect{.young = 117, .poisson = 0.35, .yield_stress = 0.4};
/// Copper that never yields.
inline Material voce_elastic() {
  Material m;
  m.young = voce.young;
  m.poisson = voce.poisson;
  return m;
}

using Law = J2<double>;
using State = Law::State;
static_assert(sizeof(State) == 7 * sizeof(double) && sizeof(Law) == 6 * sizeof(double));
static_assert(std::is_trivially_copyable_v<Law> && std::is_trivially_copyable_v<State>);

/// First Piola-Kirchhoff stress of a step that ends at F.
inline M3 stress(const Law& law, const M3& f, State& state) {
  return eigen(law.first_piola_stress(grad_u(f), state, 1e-3));
}
inline M3 deviator(const M3& m) { return m - m.trace() / 3 * M3::Identity(); }
/// Von Mises equivalent of the Kirchhoff stress P Fᵀ.
inline double von_mises(const M3& p, const M3& f) {
  return std::sqrt(1.5) * deviator(p * f.transpose()).norm();
}
/// The closed form of the flow stress. @param e equivalent plastic strain
inline double flow_stress(const J2Parameters& p, double e) {
  const double rise = p.saturation_stress > 0 ? p.saturation_stress - p.yield_stress : 0;
  return p.yield_stress + p.hardening * e + rise * (1 - std::exp(-p.saturation_rate * e));
}

}  // namespace phyxel::testing::j2
