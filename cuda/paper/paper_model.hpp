/// Bodies as the 2008 program prepared them on the CPU.
#pragma once

#include <string>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel::paper {

/// Slots for neighbours of a phyxel, and for phyxels of a surfel. The paper names the parameter
/// and not its value; 32 is the working point of the method.
inline constexpr int max_neighbours = 32;

/// "horn_bug", "alien_head", "dino": section 6.
const std::vector<std::string>& body_names();

/// One of those bodies, hung up as in section 6 (alien head by its neck, bug by a leg, Dino by its
/// mouth), `copies` times.
/// @throws InputError for another name.
Scene body_scene(const std::string& name, int copies = 1);

/// The rules of the 2008 program for a body: supports three times the mean distance to the ten
/// nearest, at most `max_neighbours` neighbours, masses and volumes by the kernel rule.
void use_paper_rules(BodyRequest& body);

/// `build_model`, with at most `max_neighbours` carriers a surfel (the nearest).
Model paper_model(const Scene& scene);
Model paper_model(const Scene& scene, const Cloud& cloud);
/// The same from clouds already in place, one for each body of the scene.
Model paper_model(const Scene& scene, std::span<const Cloud> clouds);

/// @throws InputError unless the model is one that the 2008 program could have run: a single body
///   of at most 65,535 phyxels, volumes by the kernel rule, phyxels held but not moved, gravity but
///   no loads, damping or volume conservation.
void check_paper_model(const Model& model);

/// Weights ω(r) [1/m³] of each surfel's carriers, in the order of `model.surfels.carriers`; 1 for
/// a lone carrier that is out of reach.
std::vector<double> surfel_weights(const Model& model);

/// C of equation (5), row-major 6×6 over (xx, yy, zz, xy, yz, zx), to be applied to the tensor
/// shear strains [Pa].
std::vector<double> material_tensor(const Material& material);

}  // namespace phyxel::paper
