/// Contact of the bodies of a scene with each other.
#pragma once

#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "model/box.hpp"
#include "model/near_boxes.hpp"
#include "phyxel/model.hpp"
#include "phyxel/neighbourhood.hpp"

namespace phyxel {

/// True if a body of a scene touches another one, or itself.
bool touches_bodies(const Scene& scene, std::size_t body);

/// The supports of the phyxels by which a body touches others: the smallest and the largest one
/// [m].
struct LayerSupports {
  double least = HUGE_VAL, most = 0;
};

/// Adds the laws by which bodies touch each other to a model, and the layer of their phyxels, if
/// its scene asks for contact. Of a share: collective.
/// @param offset of all phyxels (`contact_offset`) [m]
/// @returns the supports of each body's layer; none if no bodies touch
std::vector<LayerSupports> add_body_layer(Model& model, const Scene& scene,
                                          std::span<const double> offset);

/// Adds the distances from the surfaces of bodies that touch each other to a model.
/// @param supports as `add_body_layer` has returned
/// @param surface_of returns the surface of a body, in place
/// @throws InputError for a surface that is open
void add_body_surfaces(Model& model, const Scene& scene, std::span<const LayerSupports> supports,
                       const std::function<Surface(std::size_t body)>& surface_of);

/// The bodies that each body touches if it meets them, by their boxes: ascending, and with the body
/// itself if its parts touch each other.
/// @param near has served earlier boxes of the bodies, or none
Csr partners_of_bodies(const BodyContact& contact, std::span<const Box> boxes, NearBoxes& near);

/// The error of a model whose bodies are to touch but overlap at the start. Empty if none do. Of a
/// share: collective, and empty on all ranks but one.
std::string bodies_overlap_at_start(const Model& model, const Scene& scene);

}  // namespace phyxel
