#include <algorithm>
#include <cmath>
#include <numbers>

#include "model/assembly.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

Path Motion::path_after(double share) const {
  Path path{share * displacement, {}, about};
  if (rotation != Vec3d{}) path.turn = rotation_by(share * rotation) - identity<double>();
  return path;
}

Path Motion::path_at(double time) const {
  const double s = duration > 0 ? std::clamp(time / duration, 0.0, 1.0) : 1.0;
  Path path = path_after(s * s * (3 - 2 * s));
  path.displacement +=
      time * velocity + std::sin(2 * std::numbers::pi * frequency * time) * amplitude;
  return path;
}

namespace {
/// The path that leads from one instant to another.
Path between(const Path& before, const Path& after) {
  return {after.displacement - before.displacement, after.turn - before.turn, after.about};
}
}  // namespace

Path Motion::last_step(double time, double dt) const {
  return between(path_at(std::max(time - dt, 0.0)), path_at(time));
}

Path Motion::mean_step(double time, double dt) const {
  const Path both = between(path_at(std::max(time - dt, 0.0)), path_at(time + dt));
  return {0.5 * both.displacement, 0.5 * both.turn, both.about};
}

}  // namespace phyxel
