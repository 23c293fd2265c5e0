/// Trajectories on disk: VTKHDF frames that ParaView opens, a series file, and the energy log.
#pragma once

#include <filesystem>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/chunked_source.hpp"
#include "phyxel/contacts.hpp"
#include "phyxel/fragments.hpp"
#include "phyxel/gases.hpp"
#include "phyxel/model.hpp"
#include "phyxel/point_fields.hpp"
#include "phyxel/probes.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// What is read off at each frame.
struct Readings {
  std::vector<Reaction> reactions;         ///< Of supports (`find_reactions`), or none.
  std::vector<ProbeReading> probes;        ///< Of the scene's probes (`Probes::read`), or none.
  std::vector<GasReading> gases;           ///< Of gases in cavities (`read_gases`), or none.
  std::vector<ContactReading> contacts;    ///< Of obstacles (`find_contacts`), or none.
  std::vector<RigidReading> rigid;         ///< Of free rigid bodies (`read_rigid_bodies`), or none.
  std::vector<FragmentReading> fragments;  ///< Of broken bodies (`read_fragments`), or none.
};

/// Fields of one frame; only those that the scene's `output.fields` names are filled.
struct Frame {
  const State* state = nullptr;
  const SurfelState* surfels = nullptr;  ///< Surfels; null without a surface family.
  /// The triangles of the surface that no crack crosses; null: all.
  const std::vector<Triangle>* triangles = nullptr;
  Diagnostics diagnostics;
  Readings readings;
  FieldValues fields;  ///< Computed fields (`find_fields`); others are not written.
};

/// This rank's values of a quantity, in the order of its model; empty if the frame lacks it.
std::span<const double> values_of(const Model& model, const Frame& frame, Quantity quantity);

/// A source of a frame's values for a model on one rank.
class FrameSource : public ChunkedSource {
 public:
  /// @param model,frame must outlive the source
  FrameSource(const Model& model, const Frame& frame, Index length = usual_length)
      : ChunkedSource(length), model_(model), frame_(frame) {}
  bool has(Quantity quantity) const override;
  std::span<const double> values(Quantity quantity, Index begin, Index end) override;
  std::span<const Triangle> triangles() const override {
    return frame_.triangles ? *frame_.triangles : model_.surfels.triangle;
  }

 private:
  const Model& model_;
  const Frame& frame_;
};

/// A frame of a series: its file and its time [s].
struct SeriesEntry {
  std::filesystem::path file;
  double time = 0;
};

/// Checks in advance that a run can write into `directory`: creates the folder if necessary, and
/// checks that it is writable and that no earlier trajectory would be lost.
/// @param may_exist true if the run replaces or continues a trajectory in the folder
/// @throws InputError
void check_output_folder(const std::filesystem::path& directory, bool may_exist);

/// A series file to which each frame is appended in one write, so that it is always valid.
class SeriesFile {
 public:
  /// Writes a new file with these entries.
  void create(const std::filesystem::path& file, const std::vector<SeriesEntry>& entries);
  /// Adds one entry at the end. @throws OutputError
  void append(const SeriesEntry& entry);
  /// Path of the file.
  const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
  std::size_t end_ = 0;  // offset of the closing brackets
  bool empty_ = true;
};

/// A log with some lines for each frame, as CSV.
class FrameLog {
 public:
  /// @param header first line, with its end
  FrameLog(std::filesystem::path file, std::string header)
      : file_(std::move(file)), header_(std::move(header)) {}
  /// Reads the lines up to `last_time` [s], below the header. A folder without the file, of an
  /// earlier version of the program, has none. @throws InputError if it has another header, or ends
  /// before that time
  std::string kept(double last_time) const;
  /// Writes the file anew. @param lines below the header
  void create(const std::string& lines = {});
  /// Adds lines at the end. @throws OutputError
  void append(const std::string& lines);
  /// Path of the file.
  const std::filesystem::path& file() const { return file_; }

 private:
  std::filesystem::path file_;
  std::string header_;
  std::size_t size_ = 0;  // of the file [bytes]
};

/// The point at which a trajectory is continued, from a checkpoint.
struct Continuation {
  std::int64_t frames = 0;  ///< Number of frames written before.
  /// Time of the checkpoint [s]. Steps do not tell which frame was first: they change their size.
  double time = std::numeric_limits<double>::infinity();
  /// Total energy of the run's first state [J]; not compared if NaN.
  double initial_energy = std::numeric_limits<double>::quiet_NaN();
  /// The checkpoint. If it is outside the output folder, that folder must have no trajectory,
  /// unless it may be replaced. Empty for a checkpoint in the output folder.
  std::filesystem::path checkpoint = {};
};

/// True if a folder has at most the first frame of this scene, from a run that was stopped before
/// its first checkpoint and may begin again.
/// @throws InputError if its log cannot be read
bool holds_only_a_start(const std::filesystem::path& directory, const Scene& scene);

/// Writer of a trajectory's folder:
///   phyxels_000000.hdf ...  VTKHDF UnstructuredGrid 1.0, one poly-vertex cell a body;
///   phyxels.hdf.series surface_000000.hdf ...  VTKHDF UnstructuredGrid 1.0, triangles;
///   surface.hdf.series energy.csv              one line a frame: time, energies, momenta
///   reactions.csv                              of a scene with supports: one line a frame and set
///   probes.csv                                 of a scene with probes: one line a frame and point
///   gas.csv                                    of a scene with gases: one line a frame and gas
///   contacts.csv                               one line a frame and obstacle, if there are any
///   rigid.csv                                  one line a frame and free rigid body, likewise
///   fragments.csv                              one line a frame and fragment, if bodies may break
///   run.json                                   at the end, what `write_summary` is given
/// Each frame is written atomically, after allocating its disk space. Metadata are in the group
/// `/phyxel`.
class Recorder {
 public:
  /// Checks the folder and the free space, and removes the files that the run replaces.
  /// @param model may be a rank's share if frames come from a `ChunkedSource`
  /// @param point point at which an earlier part of this run is continued: its frames are kept,
  /// later
  ///   ones removed; unset for a new run
  /// @throws InputError, with nothing changed, if the folder holds an earlier trajectory and
  ///   `overwrite` is false, if `point` belongs to another run than the folder's or frames or lines
  ///   of the log are missing, if the folder cannot be written, or if the disk has no room for the
  ///   frames to come.
  Recorder(const Model& model, const Scene& scene, bool overwrite,
           const std::optional<Continuation>& point = std::nullopt);

  /// Writes a frame. @throws InputError for an array that does not fit the model; OutputError if
  ///   writing fails: earlier frames stay intact
  void write(const Frame& frame);
  /// Writes a frame whose values come from a source, chunk by chunk. @throws OutputError likewise
  void write(const Diagnostics& diagnostics, ChunkedSource& values, const Readings& readings = {});

  /// Flushes all frames to the disk, so that a checkpoint that counts them finds them after a power
  /// cut.
  /// @throws OutputError
  void sync();

  /// Writes the summary of a finished run as run.json. @throws OutputError
  void write_summary(const std::string& text) const;

  /// Number of frames, including those of the earlier part of a resumed run.
  std::int64_t frames_written() const { return frames_; }
  /// The output folder.
  const std::filesystem::path& directory() const { return directory_; }
  std::vector<std::filesystem::path> files() const;  ///< Series files and logs, for summaries.

 private:
  void remove_unfinished() const;  ///< Removes temporary files of a killed run.
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
  std::vector<std::filesystem::path> unsynced_;  // frames to be flushed
  std::size_t log_size_ = 0;                     // size of energy.csv [bytes]
  // Set if the model has supports, probes, gases, obstacles, and bodies that may break.
  std::optional<FrameLog> reactions_, probes_, gases_, contacts_, rigid_, fragments_;

  /// Those of them that are set.
  std::vector<FrameLog*> logs();
};

/// The content of a frame.
struct FrameData {
  double time = 0;
  std::vector<Vec3d> point;        ///< Deformed positions [m].
  std::vector<Triangle> triangle;  ///< Triangles; empty for phyxel frames.
  std::vector<Vec3d> normal;       ///< Normals; empty if the frame has none.
  std::vector<Index> body;         ///< Body of each point; empty if the frame has none.
  /// Other fields of the frame, by the names of `OutputRequest::fields`, shape [n] or [n, 3].
  std::map<std::string, std::vector<double>> field;
  std::string program, title,
      scene;  ///< Program that wrote the frame; title and text of the scene.
};
/// Reads a frame. @param with_fields true to read `field` and the following members
/// @throws InputError
FrameData read_frame(const std::filesystem::path& file, bool with_fields = false);

/// Reads a series file; paths are resolved from its folder. @throws InputError
std::vector<SeriesEntry> read_series(const std::filesystem::path& file);

/// Writes all frames of a series into one temporal VTKHDF 2.0 file (ParaView 5.12 and later).
/// Topology is stored once. @throws InputError, OutputError.
void export_single(const std::filesystem::path& series, const std::filesystem::path& out,
                   bool overwrite);

}  // namespace phyxel
