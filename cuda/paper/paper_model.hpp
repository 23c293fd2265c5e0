/// Models as the 2008 program prepared them on the CPU.
#pragma once

#include <string>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel::paper {

/// Number of slots for the neighbours of a phyxel, and for the carriers of a surfel. The paper
/// names the parameter without its value; 32 is the working point of the method.
inline constexpr int max_neighbours = 32;

/// The names of the bodies of section 6: "horn_bug", "alien_head" and "dino".
const std::vector<std::string>& body_names();

/// A scene with `copies` of a body, fixed as in section 6 (the alien head at its neck, the bug at a
/// leg, the dino at its mouth). @throws InputError for an unknown name
Scene body_scene(const std::string& name, int copies = 1);

/// Sets the rules of the 2008 program: supports of three times the mean distance to the ten nearest
/// phyxels, at most `max_neighbours` neighbours, masses and volumes by the kernel rule.
void use_paper_rules(BodyRequest& body);

/// Builds a model by `build_model`, with the `max_neighbours` nearest carriers of each surfel.
Model paper_model(const Scene& scene);
Model paper_model(const Scene& scene, const Cloud& cloud);
/// Builds a model from positioned clouds, one for each body of the scene.
Model paper_model(const Scene& scene, std::span<const Cloud> clouds);

/// Checks that the 2008 program could run a model: a single body of at most 65,535 phyxels, volumes
/// by the kernel rule, fixed phyxels without prescribed motion, and gravity, without loads, damping
/// or volume conservation. @throws InputError
void check_paper_model(const Model& model);

/// Weights ω(r) [1/m³] of each surfel's carriers, in the order of `model.surfels.carriers`; 1 for a
/// single carrier out of reach.
std::vector<double> surfel_weights(const Model& model);

/// The matrix C of equation (5) [Pa], row-major 6×6 over (xx, yy, zz, xy, yz, zx), for tensor shear
/// strains.
std::vector<double> material_tensor(const Material& material);

}  // namespace phyxel::paper
