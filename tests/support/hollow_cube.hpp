/// A hollow cube with a gas in its cavity, for runs of the program.
#pragma once

#include <string>

#include "support/mesh_content.hpp"
#include "support/surfaces.hpp"

namespace phyxel::test {

/// A unit cube with a cavity of 0.4 × 0.4 × 0.4 m, as an STL file.
inline std::string hollow_cube_stl() {
  return binary_stl(together(unit_cube(), turned(box({0.3, 0.3, 0.3}, {0.7, 0.7, 0.7}))));
}

/// The scene of that cube, hollow.stl, without its duration: a gas at constant temperature blows it
/// up, and a pressure on one face goes up, down and to the other side.
inline const std::string hollow_cube_scene = R"([solver]
threads = 1
device = "cpu"
[output]
frames_per_second = 50
[[body]]
name = "hollow"
mesh = "hollow.stl"
phyxels = 900
[body.material]
young = 2e4
poisson = 0.3
density = 1000
[[body.fixed]]
box = [[-1, -1, -1], [0.1, 2, 2]]
[[body.traction]]
box = [[0, 0, 0.99], [1, 1, 1.01]]
pressure = 200
curve = [[0.01, 0], [0.03, 1], [0.06, -0.5]]
[[body.traction]]
box = [[0.2, 0.2, 0.2], [0.8, 0.8, 0.8]]
pressure = 2000
gas = 1
)";

}  // namespace phyxel::test
