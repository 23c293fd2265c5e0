/// Trajectories on disk: VTKHDF frames that ParaView opens, a series file, and the energy log.
#pragma once

#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/chunked_source.hpp"
#include "phyxel/model.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// Fields of one frame; only those that the scene's `output.fields` names are filled.
struct Frame {
  const State* state = nullptr;
  const SurfelState* surfels = nullptr;  ///< Null: no surface family.
  Diagnostics diagnostics;
  std::vector<double> von_mises;     ///< Von Mises Cauchy stress [Pa], shape [n] or empty.
  std::vector<double> volume_ratio;  ///< det F, shape [n] or empty.
};

/// All that this rank has of a quantity: of phyxels and surfels of its model, in the order they
/// have there. Empty: nothing.
std::span<const double> values_of(const Model& model, const Frame& frame, Quantity quantity);

/// A frame of a model that is whole here.
class FrameSource : public ChunkedSource {
 public:
  /// Both must outlive this.
  FrameSource(const Model& model, const Frame& frame, Index length = usual_length)
      : ChunkedSource(length), model_(model), frame_(frame) {}
  bool has(Quantity quantity) const override;
  std::span<const double> values(Quantity quantity, Index begin, Index end) override;
  std::span<const Triangle> triangles() const override { return model_.surfels.triangle; }

 private:
  const Model& model_;
  const Frame& frame_;
};

/// One frame of a series: its file and its time [s].
struct SeriesEntry {
  std::filesystem::path file;
  double time = 0;
};

/// Makes sure that a run can write into `directory` before any time is spent: the folder is made if
/// need be, it can be written, and no earlier trajectory in it would be lost.
/// @param may_exist whether a trajectory may be there: the run replaces or continues it.
/// @throws InputError.
void check_output_folder(const std::filesystem::path& directory, bool may_exist);

/// A series file in the making: each frame is appended in one write, so that it is valid at any
/// time.
class SeriesFile {
 public:
  /// Writes a new file with these entries.
  void create(const std::filesystem::path& file, const std::vector<SeriesEntry>& entries);
  /// Adds one entry at the end. @throws OutputError
  void append(const SeriesEntry& entry);
  /// Where it is.
  const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
  std::size_t end_ = 0;  // where the closing brackets begin
  bool empty_ = true;
};

/// The point at which a trajectory is continued, as a checkpoint tells it.
struct Continuation {
  std::int64_t frames = 0;  ///< Frames that were written up to it.
  std::int64_t step = std::numeric_limits<std::int64_t>::max();  ///< Step of the checkpoint.
  /// Total energy of the run's first state [J]; NaN: not compared.
  double initial_energy = std::numeric_limits<double>::quiet_NaN();
  /// The checkpoint. If it lies outside the output folder, that folder must hold no trajectory,
  /// unless it may be replaced. Empty: in the output folder.
  std::filesystem::path checkpoint = {};
};

/// True if a folder holds no more than the first frame of this very scene: a run that was ended
/// before its first checkpoint, which may begin again.
/// @throws InputError if its log cannot be read
bool holds_only_a_start(const std::filesystem::path& directory, const Scene& scene);

/// Writes frames into a folder:
///   phyxels_000000.hdf ...  VTKHDF UnstructuredGrid 1.0, one poly-vertex cell a body;
///   phyxels.hdf.series surface_000000.hdf ...  VTKHDF UnstructuredGrid 1.0, triangles;
///   surface.hdf.series energy.csv              one line a frame: time, energies, momenta
///   run.json                                   at the end, what `write_summary` is given
/// Each frame is written to a temporary name, for which the disk must have room beforehand, and
/// renamed. Metadata sit in the group `/phyxel`.
class Recorder {
 public:
  /// Checks the folder and the free space, then removes what the run replaces.
  /// @param model a rank's share of it will do, if all frames come in stretches
  /// @param point where an earlier part of this run is continued: its frames are kept, later ones
  ///   removed. Unset: a new run.
  /// @throws InputError, with nothing changed, if the folder holds an earlier trajectory and
  ///   `overwrite` is false, if `point` belongs to another run than the folder's or frames or lines
  ///   of the log are missing, if the folder cannot be written, or if the disk has no room for the
  ///   frames to come.
  Recorder(const Model& model, const Scene& scene, bool overwrite,
           const std::optional<Continuation>& point = std::nullopt);

  /// @throws OutputError; frames already written stay intact.
  void write(const Frame& frame);
  /// A frame whose values are not all here, or not at once. @throws likewise
  void write(const Diagnostics& diagnostics, ChunkedSource& values);

  /// Brings all frames written so far to the disk, as a checkpoint that counts them must find them
  /// after a power cut. @throws OutputError
  void sync();

  /// What a program has to say of a run that is done, as run.json. @throws OutputError
  void write_summary(const std::string& text) const;

  /// Including those of the earlier part of a resumed run.
  std::int64_t frames_written() const { return frames_; }
  /// Where they go.
  const std::filesystem::path& directory() const { return directory_; }
  std::vector<std::filesystem::path> files() const;  ///< Series files and the log, for summaries.

 private:
  void remove_unfinished() const;  ///< What a killed run has left.
  void check_space(std::int64_t frames_before) const;
  void begin_anew();
  void create_files();
  void continue_after(const Continuation& point, bool overwrite);

  const Model& model_;
  const Scene& scene_;
  std::filesystem::path directory_;
  bool writes_phyxels_, writes_surface_;
  std::int64_t frames_ = 0;
  SeriesFile phyxels_, surface_;
  std::vector<std::filesystem::path> unsynced_;  // frames
  std::size_t log_size_ = 0;                     // bytes of energy.csv
};

/// What a single frame holds, read back.
struct FrameData {
  double time = 0;
  std::vector<Vec3d> point;        ///< Deformed positions [m].
  std::vector<Triangle> triangle;  ///< Empty for phyxel frames.
  std::vector<Vec3d> normal;       ///< Empty unless the frame has them.
  std::vector<Index> body;         ///< Body of each point, or empty.
  /// The other fields that the frame has, by the names of `OutputRequest::fields`, shape [n] or
  /// [n, 3].
  std::map<std::string, std::vector<double>> field;
  std::string program, title, scene;  ///< What wrote it, and the scene's title and text.
};
/// @param with_fields whether `field` and what follows it are filled @throws InputError.
FrameData read_frame(const std::filesystem::path& file, bool with_fields = false);

/// The entries of a series file, paths resolved from its folder.
/// @throws InputError.
std::vector<SeriesEntry> read_series(const std::filesystem::path& file);

/// Writes all frames of a series into one temporal VTKHDF 2.0 file (ParaView 5.12 and later).
/// Topology is stored once. @throws InputError, OutputError.
void export_single(const std::filesystem::path& series, const std::filesystem::path& out,
                   bool overwrite);

}  // namespace phyxel
