/// Where the bodies of a model break, and where they are cut before they move.
#pragma once

#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// The critical stretch s_c of the pairs of a body, from the energy G_c that a crack takes by its
/// area [J/m²]:
///
///   s_c = C √(G_c / (E′ s)),   E′ = E/(1 - ν²),   s: distance between neighbours in a cubic
///   lattice
///
/// Near the tip of a crack under the energy release rate G, displacements are √(G/E′) times a
/// function of the place over the square root of a length (Irwin 1957), of which s is the only one
/// that a lattice has. So the largest stretch of a pair at the tip is C √(G/(E′ s)), with a number
/// C that depends on the support over s and on ν alone, and a pair that breaks at this stretch
/// breaks under G_c.
///
/// C is measured with the weights of the moments, by a strip in plane strain between fixed grips,
/// whose exact energy release rate is the energy of a column far ahead of the crack, with all
/// forces of phyxel, hourglass control of 0.1 included (`scripts/calibrate_fracture.py`). It is the
/// root mean square over the places in the lattice at which a cut may end: the G under which a cut
/// begins to grow differs from G_c by 9% with the default support of 2.1 s, by up to a third at the
/// ends of the table, and by more beyond them. Between the values of the table C is linear. The
/// energy of the strip falls by 0.980 and 0.987 of the exact value where it is 16 and 24 spacings
/// high.
/// @param poisson ν. @param relative_support h/s
/// @throws InputError for a ν or a support outside the table
double fracture_constant(double poisson, double relative_support);

/// s_c as above, without unit. @param spacing s [m]
double critical_stretch(double energy_release_rate, double young, double poisson, double spacing,
                        double relative_support);

/// Checks that the terms of a body that breaks allow it.
/// @throws InputError naming the key, its value and what is allowed
void check_fracture(const BodyRequest& request);

/// Sets `Model::fracture`, of a share, too, of which global ids must be known.
/// @throws InputError for a strength that the distance between phyxels cannot represent
void find_fracture(Model& model, const Scene& scene);

/// Checks that each region whose phyxels do not break holds some. Of a share: collective.
/// @throws InputError for one that does not
void check_unbreakable(const Model& model, const Scene& scene);

/// The pairs whose connection at rest crosses a notch of their body, as of `State::broken`.
/// @throws InputError for a notch that cuts no pair. Of a share: collective
std::vector<PhyxelPair> notched_pairs(const Model& model, const Scene& scene);

}  // namespace phyxel
