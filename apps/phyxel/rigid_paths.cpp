#include "rigid_paths.hpp"

#include <cmath>

#include "csv.hpp"
#include "files/trajectory_folder.hpp"

namespace phyxel::app {
namespace {

/// The rotation about an axis by its length [rad].
UnitQuaternion turn_by(Vec3d rotation) {
  const double angle = norm(rotation);
  if (angle == 0) return {};
  return {std::cos(angle / 2), (std::sin(angle / 2) / angle) * rotation};
}

}  // namespace

RigidPaths::RigidPaths(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / rigid_name;
  if (!std::filesystem::exists(file)) return;
  const CsvTable table = read_csv(file);
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const auto vector = [&](const std::string& name, const char* unit) {
      const auto number = [&](const char* axis) {
        return table.number(row, name + axis + " [" + unit + "]");
      };
      return Vec3d{number("_x"), number("_y"), number("_z")};
    };
    states_[table.text(row, "obstacle")][table.number(row, "time [s]")] = {
        .place = vector("place", "m"), .turn = turn_by(vector("rotation", "rad"))};
  }
}

std::map<double, RigidState> RigidPaths::of(const Obstacle& obstacle) const {
  const auto found = states_.find(obstacle.name);
  return found == states_.end() ? std::map<double, RigidState>{} : found->second;
}

std::optional<RigidState> RigidPaths::nearest(const std::string& name, double time) const {
  const auto found = states_.find(name);
  if (found == states_.end() || found->second.empty()) return std::nullopt;
  const std::map<double, RigidState>& states = found->second;
  auto next = states.lower_bound(time);
  if (next == states.end()) --next;
  if (next != states.begin()) {
    const auto before = std::prev(next);
    if (time - before->first < next->first - time) next = before;
  }
  return next->second;
}

ObstacleStep RigidPaths::at(const Obstacle& obstacle, double time) const {
  const auto state = obstacle.free ? nearest(obstacle.name, time) : std::nullopt;
  return state ? obstacle.placed(*state) : obstacle.step_from(time, 0);
}

}  // namespace phyxel::app
