/// phyxel export --format gltf and glb: the surfaces of a run, in motion.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "export/gltf_file.hpp"
#include "field_colours.hpp"

namespace phyxel::app {

/// A request for a glTF file.
struct GltfRequest {
  std::filesystem::path input;  ///< Folder of a run, or a series of surfaces.
  FrameChoice choice;
  ColourRequest colours;                    ///< Vertices have colours if its field is set.
  std::optional<double> seconds;            ///< Duration of the animation; unset: that of the run.
  double megabytes = 500;                   ///< Largest size of the file.
  std::filesystem::path scene_folder = {};  ///< As of `obstacles_of_frames`.
  GltfContainer container = GltfContainer::binary;
};

/// A glTF file of a run.
struct GltfExport {
  std::string content;
  std::size_t frames = 0;          ///< Number of frames in it.
  std::vector<std::string> notes;  ///< Sentences about what the file lacks.
};

/// Makes a glTF file of a run's surfaces. Each body is a mesh with a material, and each frame but
/// the first a morph target of it, with normals; the weights of the targets are animated so that
/// surfaces move linearly from frame to frame. Obstacles are meshes on animated nodes; the root
/// turns the scene's vertical to y, which is that of glTF. If the file would be too large, evenly
/// spaced frames are left out.
/// @throws InputError for a run without surfaces, frames with different triangles, a field that
///   frames lack, a duration that leaves no time between frames, or if two frames are too large
GltfExport gltf_of_run(const GltfRequest& request);

}  // namespace phyxel::app
