/// A fixture that runs the program on a small beam.
#pragma once

#include <string>

#include "support/program.hpp"

namespace phyxel::test {

/// Runs the program on a scene of one beam, beam.toml.
class BeamProgram : public Program {
 protected:
  /// Writes a small beam that swings for `end` seconds, with `extra` at the top of the file. One
  /// thread steps, so that a second core can write files meanwhile.
  void write_beam(const std::string& end = "0.2", const std::string& extra = "") const {
    write("beam.toml", extra + R"(
gravity = [0.0, 0.0, -9.81]
[time]
end = )" + end + R"(
[solver]
threads = 1
[output]
directory = "out"
frames_per_second = 50
[[body]]
name = "beam"
shape = "beam"
size = [0.6, 0.2, 0.2]
spacing = 0.05
jitter = 0.1
[body.material]
young = 2e5
poisson = 0.3
density = 1000
[[body.fixed]]
region = "x-"
)");
  }
  void replace_in_beam(const std::string& what, const std::string& by) const {
    std::string text = text_of(folder_ / "beam.toml");
    text.replace(text.find(what), what.size(), by);
    write("beam.toml", text);
  }
};

}  // namespace phyxel::test
