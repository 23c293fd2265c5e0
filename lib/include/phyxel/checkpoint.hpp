/// Checkpoints: a `State` on disk that lets a run go on as if it had never stopped.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "phyxel/chunked_source.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// What a checkpoint holds beside the state.
struct CheckpointInfo {
  int version = 0;      ///< Of the format; 2 has no parameters.
  std::string program;  ///< "phyxel 0.1.0 (commit)".
  Precision precision = Precision::single;
  Method method = Method::verlet;  ///< Which tells when velocities are.
  std::string scene_text;
  std::uint64_t model_digest = 0;  ///< Of rest positions, masses and neighbour lists.
  /// Values of the scene by name (`scene_parameters`), which a resumed run must have, too.
  std::vector<Parameter> parameters;
  double total_energy = 0;          ///< [J], for the drift of the continued run.
  Watched watched;                  ///< Version 2 holds the start energy only.
  std::int64_t frames_written = 0;  ///< Frames on disk at that time.
};

/// Writes `directory/checkpoint_<step>.h5`: to a temporary name, synced, renamed. Keeps the last
/// two checkpoints and removes older ones, and those of later steps, which a run resumed from an
/// earlier one has left behind. State arrays are stored in the precision of the run's state.
/// @throws OutputError; earlier checkpoints stay intact.
std::filesystem::path write_checkpoint(const std::filesystem::path& directory, const State& state,
                                       const CheckpointInfo& info);
/// The same for a state of so many phyxels whose arrays are not all here, or not at once.
/// @param state its arrays are not looked at
std::filesystem::path write_checkpoint(const std::filesystem::path& directory, const State& state,
                                       const CheckpointInfo& info, Index phyxels,
                                       ChunkedSource& values);

/// A whole checkpoint.
struct Checkpoint {
  State state;
  CheckpointInfo info;
};

class Hdf5Reader;

/// A checkpoint whose arrays are read a stretch at a time.
class CheckpointReader {
 public:
  /// Compares the digest, and reads all but the arrays.
  /// @throws InputError for a missing, truncated, altered or foreign file, or wrong content.
  explicit CheckpointReader(const std::filesystem::path& file);
  ~CheckpointReader();
  CheckpointReader(CheckpointReader&&) noexcept;
  CheckpointReader& operator=(CheckpointReader&&) noexcept;

  /// What is beside the state.
  const CheckpointInfo& info() const { return info_; }
  /// Phyxels of its state.
  Index phyxels() const { return phyxels_; }
  /// The state of phyxels `begin` to `end`. @throws InputError if a value is not finite.
  State state(Index begin, Index end) const;

 private:
  std::unique_ptr<const Hdf5Reader> file_;
  CheckpointInfo info_;
  State state_;  // without arrays
  Index phyxels_ = 0;
};

/// Reads one checkpoint, whole. @throws InputError as `CheckpointReader`.
Checkpoint read_checkpoint(const std::filesystem::path& file);

/// The newest checkpoint in `directory` that can be read to its last value; one that cannot is
/// skipped, and `warning` says so.
std::optional<std::filesystem::path> latest_checkpoint(const std::filesystem::path& directory,
                                                       std::string* warning = nullptr);

}  // namespace phyxel
