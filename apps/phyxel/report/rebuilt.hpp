/// The scene of a trajectory, built anew to find what its frames do not say.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/recorder.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::app {

/// A quantity of each phyxel, by which colours go.
struct Field {
  std::string name, unit;
  std::vector<double> values;
};

/// Why a scene that a frame carries is not built, or "". Anybody may have written the frame, so
/// what building takes is bounded by the run's own files: about as many phyxels as the frames have,
/// with a bounded number of neighbours, and no file outside the run's folder, unless the scene file
/// that `scene.file` names is still there with the same text, as the user then has it.
/// @param spacing typical distance between phyxels of the frames [m]
std::string obstacle_to_building(const Scene& scene, std::size_t phyxels, double spacing,
                                 const std::filesystem::path& folder);

/// A model of the scene, which finds strains and stresses from frames.
class Rebuilt {
 public:
  /// @throws InputError if it has another number of phyxels than the frames
  Rebuilt(Scene scene, std::size_t phyxels);

  /// Fields that are not there yet.
  void add_fields(const FrameData& frame, std::vector<Field>& fields);
  /// Positions at rest.
  const std::vector<Vec3d>& rest() const { return model_.position; }

 private:
  Scene scene_;
  Model model_;
  std::unique_ptr<Backend> backend_;
};

}  // namespace phyxel::app
