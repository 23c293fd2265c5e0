/// The three bodies of Farias et al. 2008, section 6, rebuilt from rounded parts.
#pragma once

#include <string>

#include "shapes/implicit_body.hpp"

namespace phyxel {

/// What is fixed about one of the paper's bodies.
struct PaperBody {
  std::string name;
  Index phyxels, surfels;
  ImplicitBody form;
  std::string region;   ///< The phyxels a scene hangs it by ...
  Vec3d region_anchor;  ///< ... which are those nearest to this place [m],
  int region_size;      ///< and this many.
};

/// @returns nullptr for a name that is not one of the paper's.
const PaperBody* find_paper_body(const std::string& name);

Cloud make_paper_body(const PaperBody& body, bool surface);

}  // namespace phyxel
