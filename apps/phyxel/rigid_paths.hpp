/// Where the free rigid bodies of a run were.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "phyxel/model.hpp"

namespace phyxel::app {

/// The places of free bodies in the frames of a run.
class RigidPaths {
 public:
  RigidPaths() = default;
  /// Reads the rigid.csv of a run's folder; without one there are no paths.
  explicit RigidPaths(const std::filesystem::path& folder);

  /// Where an obstacle is at a time [s]: a free body where it was at the nearest frame, or at the
  /// start if nothing is known of it.
  ObstacleStep at(const Obstacle& obstacle, double time) const;
  /// The state of a free body at the frame nearest to a time [s], by the name of the obstacle;
  /// unset if nothing is known of it.
  std::optional<RigidState> nearest(const std::string& name, double time) const;
  /// All places of the centre of an obstacle, by time.
  std::map<double, RigidState> of(const Obstacle& obstacle) const;

 private:
  std::map<std::string, std::map<double, RigidState>> states_;
};

}  // namespace phyxel::app
