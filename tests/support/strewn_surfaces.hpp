/// Two surfaces whose parts lie where no motion would lead them: many patches of one near the
/// other.
#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "phyxel/model.hpp"
#include "support/contact_scene.hpp"

namespace phyxel {

/// A long bar, and a cube that is far from it at rest. @param young in Pa
inline std::string bar_and_cube(double young) {
  const std::string spacing = "spacing = 0.02\nlattice = 'nodes'\n";
  return end + "[contact]\n" +
         body("bar", "shape = 'block'\nsize = [0.4, 0.06, 0.06]\n" + spacing, "", young) +
         body("cube", "shape = 'block'\nsize = [0.06, 0.06, 0.06]\n" + spacing,
              "translation = [0, 0, 1]\n", young);
}

/// Places of the phyxels of both surfaces [m]: the ends of the bar are pressed onto the cube, and
/// what is between them is strewn around it.
inline std::vector<Vec3d> strewn(const Model& model, std::mt19937& random) {
  std::uniform_real_distribution<double> around(-0.14, 0.14), beside(-0.02, 0.01);
  std::vector<Vec3d> places;
  for (const Index i : model.body_contact.layer.phyxels) {
    Vec3d x = model.position[i];
    if (i >= model.parts[1].begin) {
      x.z -= 1;
    } else if (std::abs(x.x) > 0.1) {
      x.x += std::copysign(0.1, -x.x) + beside(random);
    } else {
      x = {around(random), around(random), around(random)};
    }
    places.push_back(x);
  }
  return places;
}

}  // namespace phyxel
