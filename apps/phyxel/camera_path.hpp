/// Where the camera is in each picture of a trajectory.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "camera.hpp"
#include "phyxel/camera_request.hpp"
#include "phyxel/recorder.hpp"
#include "phyxel/scene.hpp"
#include "rigid_paths.hpp"
#include "trajectory.hpp"

namespace phyxel::app {

/// What replaces the camera of a scene; members that are unset replace nothing.
struct CameraOptions {
  std::optional<Vec3d> view, up, position, target;
  std::optional<double> field_of_view, orbit;
  std::optional<std::string> follow;  ///< "": no body.
};

/// What a scene, or options in its place, ask of the camera.
struct CameraWishes {
  Vec3d view{-1, 2, -0.6}, up{0, 0, 1};
  CameraRequest camera;
};

/// The wishes in the text of a scene; the defaults if it cannot be read, as in frames without text
/// or of another version.
CameraWishes camera_wishes(const std::string& scene, const std::filesystem::path& file);

/// The wishes of a scene with options in their place. A view of the options also replaces position
/// and target of the scene.
/// @throws InputError for a view beside a position and a target, or for a target at the position
CameraWishes with_options(CameraWishes scene, const CameraOptions& options);

/// The number of a body by its name; unset for the name of an obstacle that is a free rigid body.
/// @param scene text of the frames' scene
/// @throws InputError if the scene cannot be read, or has no such body
std::optional<Index> body_called(const std::string& name, const std::string& scene,
                                 const std::filesystem::path& file);

/// The mean of the points of a body in a frame [m]; unset if it has none.
std::optional<Vec3d> centre_of(const FrameData& frame, Index body);

/// The way of a followed body's centre since the first frame [m], frame by frame.
class FollowedBody {
 public:
  /// @param name of the body, or of a free rigid body; "": nothing is followed, and all ways are
  ///   zero
  /// @param paths of the free rigid bodies
  FollowedBody(std::string name, const std::string& scene, const std::filesystem::path& file,
               RigidPaths paths = {});
  /// Adds the next frame: its phyxels, or else its surface. @throws InputError without points of
  /// the
  ///   body, or a path of the rigid body
  void add(const FrameData* surface, const FrameData* phyxels);
  Vec3d way(std::size_t frame) const { return way_[frame]; }

 private:
  std::optional<Vec3d> centre_in(const FrameData& frame) const;

  std::string name_;
  std::optional<Index> body_;  // unset: a rigid one
  RigidPaths paths_;
  std::optional<Vec3d> start_;  // of the centre [m]
  std::vector<Vec3d> way_;
};

/// The cameras of some pictures, for a body that is followed as if it did not move.
/// @param fit of the camera to the whole motion, along the direction of view
/// @param points some of the motion, the outermost among them, if the camera has to find its place
std::vector<Camera> camera_path(const CameraWishes& wishes, const CameraFit& fit,
                                const std::vector<Vec3d>& points, std::size_t pictures);

/// True if `camera_path` needs points.
bool needs_points(const CameraRequest& camera);

}  // namespace phyxel::app
