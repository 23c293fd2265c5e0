/// A fixture with the frames of a block that is thrown upwards.
#pragma once

#include <string>

#include "support/program.hpp"

namespace phyxel::test {

class ThrownBlock : public Program {
 protected:
  /// Runs the block for 0.02 s into the folder "out".
  void throw_block(int frames_per_second) const {
    write("scene.toml",
          "[time]\nend = 0.02\n[solver]\ndevice = \"cpu\"\n[output]\n"
          "directory = \"out\"\nframes_per_second = " +
              std::to_string(frames_per_second) + R"(
[[body]]
shape = "block"
size = [1, 1, 1]
spacing = 0.25
velocity = [0, 0, 2]
[body.material]
young = 1e5
poisson = 0.3
density = 1000
)");
    const Outcome done = run({"run", "scene.toml"});
    ASSERT_EQ(done.code, 0) << done.err;
  }
};

}  // namespace phyxel::test
