/// Filling of a closed surface with phyxels whose distances vary from place to place.
#pragma once

#include "mesh/lattice_filling.hpp"

namespace phyxel {

/// Fills a closed surface, on which there are phyxels already, with exactly the requested number of
/// others at the distances of `request.sites.spacing`. They start from nodes of cubic lattices, one
/// for each third of an octave of that distance, of which as many are left out, evenly along the
/// way through the lattice, as the distance asks for; then all repel each other. Volumes are shares
/// of sample points.
/// @param spacing receives the distances that were made: those of the sites, but for a factor near
///   one by which the coarsest fits the number of phyxels
LatticeFilling fill_graded(const LatticeRequest& request, SpacingField& spacing);

}  // namespace phyxel
