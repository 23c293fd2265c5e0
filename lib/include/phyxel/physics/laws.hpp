/// The list of all laws: a law named here is available on every device, in scenes, in Python, in
/// checkpoints and in the reference of scenes.
#pragma once

#include "phyxel/physics/laws/clay.hpp"
#include "phyxel/physics/laws/corotated.hpp"
#include "phyxel/physics/laws/hencky.hpp"
#include "phyxel/physics/laws/j2.hpp"
#include "phyxel/physics/laws/j2_curve.hpp"
#include "phyxel/physics/laws/johnson_cook.hpp"
#include "phyxel/physics/laws/maxwell.hpp"
#include "phyxel/physics/laws/mooney_rivlin.hpp"
#include "phyxel/physics/laws/neo_hookean.hpp"
#include "phyxel/physics/laws/orthotropic.hpp"
#include "phyxel/physics/laws/small_strain.hpp"
#include "phyxel/physics/laws/st_venant_kirchhoff.hpp"
#include "phyxel/physics/laws/viscosity.hpp"
#include "phyxel/physics/laws/volume_conservation.hpp"

namespace phyxel {

/// Every law, in the order of the reference of scenes.
using Laws = LawList<StVenantKirchhoff, SmallStrain, NeoHookean, Corotated, Hencky, MooneyRivlin,
                     Orthotropic, J2, J2Curve, JohnsonCook, Clay, Maxwell>;

/// An upper bound of the factor by which viscosity exceeds that at rest: it acts on the rate of
/// Green's strain, and so grows as the stretch squared.
template <class Real>
PHYXEL_HD Real viscous_stiffening(const PrincipalStretches<Real>& stretches) {
  return stretches.largest * stretches.largest;
}

/// An upper bound of the factor by which the stiffness or viscosity of a material exceeds that at
/// rest; 1 at rest.
/// @param law its index in `Laws`
/// @param constants of the law, then the stiffness of volume conservation [Pa], then the relaxation
///   time of viscosity [s] (`ChosenLaw`)
/// @param volume_stiffness of volume conservation [Pa]; 0: none
template <class Real, class Constant>
PHYXEL_HD Real stiffening(int law, const Constant* constants, Real volume_stiffness,
                          const PrincipalStretches<Real>& stretches) {
  const PrincipalStretches<Real> rest{Real(1), Real(1), Real(1)};
  const VolumeConservation<Real> volume{volume_stiffness};
  return Laws::with<Real>(law, constants, [&](const auto& elastic) {
    const Real stiffer = (elastic.wave_stiffness(stretches) + volume.wave_stiffness(stretches)) /
                         (elastic.wave_stiffness(rest) + volume_stiffness);
    using Elastic = std::decay_t<decltype(elastic)>;
    const bool is_viscous = constants[constants_of_law<Elastic, Real> + 1] > Constant(0);
    const Real viscous = is_viscous ? viscous_stiffening(stretches) : Real(0);
    return stiffer < viscous ? viscous : stiffer;
  });
}

/// The response of a phyxel's material at the end of a step.
template <class Real>
struct PointResponse {
  Mat3<Real> first_piola_stress;          ///< P of law, volume conservation and viscosity [Pa].
  Real strain_energy{}, volume_energy{};  ///< Stored [J/m³].
  Real plastic_work{}, viscous_work{};    ///< Turned into heat so far [J/m³].
};

/// The response of a law with its history, volume conservation and viscosity.
/// @param law its index in `Laws`
/// @param constants of the law, then the stiffness of volume conservation [Pa], then the relaxation
///   time of viscosity [s] (`ChosenLaw`)
/// @param history gives number k of the phyxel's history at the step's start
/// @param dt length of the step [s]
template <class Real, class Constant, class History>
PHYXEL_HD PointResponse<Real> response_after_step(int law, const Constant* constants,
                                                  const Mat3<Real>& grad_u, const History& history,
                                                  Real dt) {
  return Laws::with<Real>(law, constants, [&](const auto& own) {
    using Law = std::decay_t<decltype(own)>;
    using Solid = SumOf<Law, VolumeConservation<Real>>;
    using Viscous = WithViscosity<Solid, Real>;
    const auto* const beside = constants + constants_of_law<Law, Real>;
    const Solid solid{own, {static_cast<Real>(beside[0])}};
    const Real relaxation_time = static_cast<Real>(beside[1]);
    const auto read = [&](auto& state, int numbers) {
      Real values[history_numbers<Viscous, Real>];
      for (int k = 0; k < numbers; ++k) values[k] = history(k);
      memcpy(static_cast<void*>(&state), values, static_cast<std::size_t>(numbers) * sizeof(Real));
    };
    PointResponse<Real> response;
    HistoryOf<Law> state{};
    if (relaxation_time > Real(0)) {
      typename Viscous::State all{};
      read(all, history_numbers<Viscous, Real>);
      const Viscous viscous{solid, relaxation_time};
      response.first_piola_stress = viscous.first_piola_stress(grad_u, all, dt);
      response.viscous_work = all.viscous_work;
      state = all.law;
    } else {
      if constexpr (has_history<Law>) read(state, history_numbers<Law, Real>);
      response.first_piola_stress = stress_after_step(own, grad_u, state, dt);
      if (solid.second.stiffness > Real(0)) {
        response.first_piola_stress += solid.second.first_piola_stress(grad_u);
      }
    }
    response.strain_energy = stored_energy(own, grad_u, state);
    response.plastic_work = plastic_work<Real>(own, state);
    response.viscous_work = response.viscous_work + viscous_work<Real>(own, state);
    if (solid.second.stiffness > Real(0)) response.volume_energy = solid.second.energy(grad_u);
    return response;
  });
}

}  // namespace phyxel
