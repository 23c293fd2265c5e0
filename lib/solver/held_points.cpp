#include "solver/held_points.hpp"

#include <algorithm>

#include "solver/step_sums.hpp"

namespace phyxel {

PlacedHeldPoints::PlacedHeldPoints(const Model& model)
    : model_(model), stands_still_(!has_moving_supports(model)), now_(model.held_points.size()) {
  constexpr std::size_t most = 64;
  for (std::size_t k = 0; k < now_.size(); k += most) {
    Group& group = groups_.emplace_back();
    group.begin = k;
    group.end = std::min(k + most, now_.size());
    for (std::size_t j = k; j < group.end; ++j) {
      now_[j].place = model.held_points[j].rest;
      extend(group.box, now_[j].place);
      group.offset = std::max(group.offset, model.held_points[j].offset);
    }
  }
}

void PlacedHeldPoints::place(double time, double dt) {
  if (stands_still_ || now_.empty()) return;
  std::vector<Path> before, after;
  for (const Motion& motion : model_.motions) {
    before.push_back(motion.path_at(time));
    after.push_back(motion.path_at(time + dt));
  }
  for (Group& group : groups_) {
    group.box = no_box;
    for (std::size_t k = group.begin; k < group.end; ++k) {
      const HeldPoint& point = model_.held_points[k];
      const auto moved = [&](const std::vector<Path>& paths) {
        const Index* m = point.motion;
        return Vec3d{paths[m[0]].at(point.rest).x, paths[m[1]].at(point.rest).y,
                     paths[m[2]].at(point.rest).z};
      };
      const Vec3d end = moved(after);
      now_[k] = {point.rest + end, (1 / dt) * (end - moved(before))};
      extend(group.box, now_[k].place);
    }
  }
}

}  // namespace phyxel
