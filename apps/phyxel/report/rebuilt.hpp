/// A model rebuilt from the scene of a trajectory, which computes fields that its frames lack.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/recorder.hpp"
#include "phyxel/recovery.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::app {

/// A quantity of each phyxel that colours show.
struct Field {
  std::string name, unit;
  std::vector<double> values;
};

/// The reason why a file that the scene in a frame names must not be read; "" if it may: it lies in
/// the run's folder, or the file `scene` still exists with the same text.
std::string obstacle_to_reading(const std::filesystem::path& file,
                                const std::filesystem::path& scene, const std::string& text,
                                const std::filesystem::path& folder);

/// The reason why the scene in a frame must not be rebuilt; "" if it may. Frames may come from an
/// untrusted source, so rebuilding is limited by the run's files: about as many phyxels as the
/// frames have, with a bounded number of neighbours, and no file outside the run's folder unless
/// the scene file `scene.file` still exists with the same text.
/// @param spacing typical distance between phyxels of the frames [m]
std::string obstacle_to_building(const Scene& scene, std::size_t phyxels, double spacing,
                                 const std::filesystem::path& folder);

/// A model of the scene that computes strains and stresses of frames.
class Rebuilt {
 public:
  /// Builds the model. @throws InputError if its number of phyxels differs from that of the frames
  Rebuilt(Scene scene, std::size_t phyxels);

  /// Adds the fields that `fields` lacks.
  void add_fields(const FrameData& frame, std::vector<Field>& fields);
  /// Rest positions [m].
  const std::vector<Vec3d>& rest() const { return model_.position; }

 private:
  Scene scene_;
  Model model_;
  std::unique_ptr<Backend> backend_;
  std::optional<Recovery> recovery_;
};

}  // namespace phyxel::app
