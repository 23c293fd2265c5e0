/// A recorded session of a small scene, for tests of replays.
#pragma once

#include <string>

#include "phyxel/scene.hpp"
#include "version.hpp"
#include "view/live_scene.hpp"
#include "view/recording.hpp"

namespace phyxel::test {

/// A soft block on a floor, beside another body.
inline const char* session_scene() {
  return "gravity = [0, 0, -10]\n[time]\nend = 1\n[solver]\ndevice = 'cpu'\nthreads = 1\n"
         "[output]\ndirectory = 'out'\n[contact]\n"
         "[[obstacle]]\nname = 'floor'\nshape = 'plane'\nfriction = 0.4\n"
         "[[body]]\nname = 'block'\nshape = 'block'\nsize = [0.3, 0.1, 0.1]\nspacing = 0.02\n"
         "translation = [0, 0, 0.051]\n[body.material]\nyoung = 5e4\npoisson = 0.3\n"
         "density = 1000\n"
         "[[body]]\nname = 'cube'\nshape = 'block'\nsize = [0.1, 0.1, 0.1]\nspacing = 0.02\n"
         "translation = [0.21, 0, 0.051]\n[body.material]\nyoung = 5e4\npoisson = 0.3\n"
         "density = 1000\n";
}

/// A session in which the block is pushed against the cube and lifted, while settings change. It
/// saves after `saves` steps, while the hand holds the block, and at the end.
inline app::Recording session() {
  const app::LiveScene live(parse_scene(session_scene(), "scene.toml"), {}, false);
  app::Recording recording{program_version(),
                           {live.shared().digest(), "float", "verlet", live.solver().dt(),
                            scene_parameters(live.scene())},
                           {}};
  const auto add = [&](std::int64_t step, app::Request request) {
    recording.acts.push_back({step, std::move(request)});
  };
  using app::RequestKind;
  app::Request grab{RequestKind::grab}, push{RequestKind::move}, lift{RequestKind::move},
      set{RequestKind::set};
  grab.phyxel = 9;
  push.by = {0.3, 0, 0.02};
  lift.by = {0.3, 0.05, 0.4};
  set.settings = {.gravity = Vec3d{0, 0.5, -8}, .stiffness = 1.5, .friction = 0.2};
  add(20, grab);
  add(21, push);
  add(150, lift);
  add(403, {RequestKind::save});
  add(500, {RequestKind::drop});
  add(520, set);
  add(600, grab);
  add(601, push);
  add(700, {RequestKind::drop});
  add(801, {RequestKind::save});
  return recording;
}

}  // namespace phyxel::test
