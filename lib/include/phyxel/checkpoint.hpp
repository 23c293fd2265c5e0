/// Checkpoints: a `State` on disk from which a run continues with the same bits.
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

/// The content of a checkpoint beside the state.
struct CheckpointInfo {
  int version = 0;      ///< Version of the format; 2 has no parameters.
  std::string program;  ///< "phyxel 0.1.0 (commit)".
  Precision precision = Precision::single;
  Method method = Method::verlet;  ///< Determines the time level of velocities.
  std::string scene_text;
  std::uint64_t model_digest = 0;  ///< Digest of rest positions, masses and neighbour lists.
  /// Values of the scene by name (`scene_parameters`), which a resumed run must have, too.
  std::vector<Parameter> parameters;
  double total_energy = 0;          ///< [J], for the drift of the continued run.
  Watched watched;                  ///< Values for the watch; version 2 has the start energy only.
  std::int64_t frames_written = 0;  ///< Frames on disk at that time.
};

/// Writes `directory/checkpoint_<step>.h5`: to a temporary name, synced, renamed. Keeps the last
/// two checkpoints and removes older ones, and those of later steps, which a run resumed from an
/// earlier one has left behind. State arrays are stored in the precision of the run's state.
/// @throws OutputError; earlier checkpoints stay intact.
std::filesystem::path write_checkpoint(const std::filesystem::path& directory, const State& state,
                                       const CheckpointInfo& info);
/// Writes a checkpoint of a state whose arrays come from a source, chunk by chunk.
/// @param state state without arrays
std::filesystem::path write_checkpoint(const std::filesystem::path& directory, const State& state,
                                       const CheckpointInfo& info, Index phyxels,
                                       ChunkedSource& values);

/// A whole checkpoint.
struct Checkpoint {
  State state;
  CheckpointInfo info;
};

class Hdf5Reader;

/// A checkpoint whose arrays are read in chunks.
class CheckpointReader {
 public:
  /// Verifies the digest, and reads everything except the arrays.
  /// @throws InputError for a missing, truncated, altered or foreign file, or wrong content.
  explicit CheckpointReader(const std::filesystem::path& file);
  ~CheckpointReader();
  CheckpointReader(CheckpointReader&&) noexcept;
  CheckpointReader& operator=(CheckpointReader&&) noexcept;

  /// The content beside the state.
  const CheckpointInfo& info() const { return info_; }
  /// Number of phyxels of the state.
  Index phyxels() const { return phyxels_; }
  /// The state of phyxels `begin` to `end`. @throws InputError if a value is not finite.
  State state(Index begin, Index end) const;

 private:
  std::unique_ptr<const Hdf5Reader> file_;
  CheckpointInfo info_;
  State state_;  // has no arrays
  Index phyxels_ = 0;
};

/// Reads a whole checkpoint. @throws InputError as `CheckpointReader`
Checkpoint read_checkpoint(const std::filesystem::path& file);

/// The newest checkpoint in `directory` that can be read completely; those that cannot are skipped,
/// and named in `warning`.
std::optional<std::filesystem::path> latest_checkpoint(const std::filesystem::path& directory,
                                                       std::string* warning = nullptr);

}  // namespace phyxel
