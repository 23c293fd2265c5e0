/// The list of all laws: a law that is named here is known to every device, to scenes, to Python,
/// to checkpoints and to the reference of scenes.
#pragma once

#include "phyxel/physics/laws/corotated.hpp"
#include "phyxel/physics/laws/hencky.hpp"
#include "phyxel/physics/laws/mooney_rivlin.hpp"
#include "phyxel/physics/laws/neo_hookean.hpp"
#include "phyxel/physics/laws/small_strain.hpp"
#include "phyxel/physics/laws/st_venant_kirchhoff.hpp"
#include "phyxel/physics/laws/volume_conservation.hpp"

namespace phyxel {

/// Every law, in the order of the reference of scenes.
using Laws = LawList<StVenantKirchhoff, SmallStrain, NeoHookean, Corotated, Hencky, MooneyRivlin>;

/// The factor by which a material is stiffer than at rest, at most: 1 at rest.
/// @param law its index in `Laws`. @param volume_stiffness of volume conservation [Pa]; 0: none
template <class Real, class Constant>
PHYXEL_HD Real stiffening(int law, const Constant* constants, Real volume_stiffness,
                          const PrincipalStretches<Real>& stretches) {
  const PrincipalStretches<Real> rest{Real(1), Real(1), Real(1)};
  const VolumeConservation<Real> volume{volume_stiffness};
  return Laws::with<Real>(law, constants, [&](const auto& elastic) {
    return (elastic.wave_stiffness(stretches) + volume.wave_stiffness(stretches)) /
           (elastic.wave_stiffness(rest) + volume_stiffness);
  });
}

}  // namespace phyxel
