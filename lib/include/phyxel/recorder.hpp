/// Trajectories on disk: VTKHDF frames that ParaView opens, a series file, and the energy log.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// Fields of one frame; only those that the scene's `output.fields` names are filled.
struct Frame {
  const State* state = nullptr;
  const SurfelState* surfels = nullptr;   ///< Null: no surface family.
  Diagnostics diagnostics;
  std::vector<double> von_mises;          ///< Von Mises Cauchy stress [Pa], shape [n] or empty.
  std::vector<double> volume_ratio;       ///< det F, shape [n] or empty.
};

/// Writes frames into a folder:
///   phyxels_000000.hdf ...  VTKHDF UnstructuredGrid 1.0, one poly-vertex cell; phyxels.hdf.series
///   surface_000000.hdf ...  VTKHDF UnstructuredGrid 1.0, triangles;            surface.hdf.series
///   energy.csv              one line a frame: time, energies, momenta
/// Each frame is written to a temporary name and renamed. Metadata sit in the group `/phyxel`.
class Recorder {
 public:
  /// Makes the folder and proves that it can be written.
  /// @param frames_before frames of an earlier part of this run to keep (restart); files of later
  ///   frames are removed.
  /// @throws InputError if the folder holds an earlier trajectory and `overwrite` is false, or it
  ///   cannot be written.
  Recorder(const Model& model, const Scene& scene, bool overwrite, std::int64_t frames_before = 0);

  /// @throws OutputError; frames already written stay intact.
  void write(const Frame& frame);

  std::int64_t frames_written() const { return static_cast<std::int64_t>(times_.size()); }
  const std::filesystem::path& directory() const { return directory_; }
  std::vector<std::filesystem::path> files() const;  ///< Series files and the log, for summaries.

 private:
  const Model& model_;
  const Scene& scene_;
  std::filesystem::path directory_;
  std::vector<double> times_;
};

/// What a trajectory folder or single frame holds, read back.
struct FrameData {
  double time = 0;
  std::vector<Vec3d> point;         ///< Deformed positions [m].
  std::vector<Triangle> triangle;   ///< Empty for phyxel frames.
  std::vector<Vec3d> normal;        ///< Empty unless the frame has them.
  std::vector<Index> body;          ///< Body of each point, or empty.
};
FrameData read_frame(const std::filesystem::path& file);

/// A series file: name and time of each frame, paths resolved.
struct SeriesEntry { std::filesystem::path file; double time = 0; };
std::vector<SeriesEntry> read_series(const std::filesystem::path& file);

/// Writes all frames of a series into one temporal VTKHDF 2.0 file (ParaView 5.12 and later).
void export_single(const std::filesystem::path& series, const std::filesystem::path& out, bool overwrite);

}  // namespace phyxel
