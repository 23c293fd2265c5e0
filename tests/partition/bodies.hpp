/// Bodies that are difficult to partition.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "partition/graph.hpp"
#include "support/clouds.hpp"

namespace phyxel::testing {

struct CutCase {
  const char* name;
  Model (*make)();
};
inline void PrintTo(const CutCase& c, std::ostream* out) { *out << c.name; }

inline Model cube() { return model_of(one_body(), lattice(14, 14, 14, 0.1, 0.2)); }
/// A coil of four turns with 3 × 3 phyxels across: points near in space are far along the wire.
inline Model coil() {
  Cloud cloud;
  constexpr int steps = 900;
  for (int k = 0; k < steps; ++k) {
    const double angle = 8 * M_PI * k / steps;
    for (int a = -1; a <= 1; ++a) {
      for (int b = -1; b <= 1; ++b) {
        const double radius = 3.6 + 0.1 * a;
        cloud.position.push_back({radius * std::cos(angle), radius * std::sin(angle),
                                  0.1 * b + 0.5 * angle / (2 * M_PI)});
        cloud.volume.push_back(1e-3);
      }
    }
  }
  return model_of(one_body(), cloud);
}
inline Model thread() { return model_of(one_body(), lattice(700, 1, 1, 0.1, 0.05)); }
/// Three bodies of different sizes without contact, with one-sided lists.
inline Model apart() {
  Scene scene = one_body();
  scene.bodies[0].neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  scene.bodies.resize(3, scene.bodies[0]);
  return build_model(
      scene, std::vector<Cloud>{lattice(12, 9, 7, 0.1, 0.3, 2), lattice(5, 5, 5, 0.1, 0.3, 3),
                                lattice(20, 4, 4, 0.1, 0.3, 4)});
}
inline Model tiny() { return model_of(one_body(), lattice(5, 1, 1, 0.1)); }

inline const std::vector<CutCase>& cut_cases() {
  static const std::vector<CutCase> cases{
      {"Cube", cube}, {"Coil", coil}, {"Thread", thread}, {"Apart", apart}, {"Tiny", tiny}};
  return cases;
}

}  // namespace phyxel::testing
