/// The three bodies of Farias et al. 2008, section 6, rebuilt from rounded parts.
#pragma once

#include <string>

#include "shapes/implicit_body.hpp"

namespace phyxel {

/// The definition of one of the paper's bodies.
struct PaperBody {
  std::string name;
  Index phyxels, surfels;
  ImplicitBody form;
  std::string region;   ///< Name of the region that scenes fix: the phyxels nearest to an anchor.
  Vec3d region_anchor;  ///< Position of the anchor [m].
  int region_size;      ///< Number of phyxels of the region.
};

/// The body called `name`, or null if the paper has none of that name.
const PaperBody* find_paper_body(const std::string& name);

/// Samples a body with its number of phyxels; `surface` adds its surfels.
Cloud make_paper_body(const PaperBody& body, bool surface);

}  // namespace phyxel
