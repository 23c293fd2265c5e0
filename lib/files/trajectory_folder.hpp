/// The folder of a trajectory: which files are a run's, and where a run may go on.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "phyxel/recorder.hpp"

namespace phyxel {

inline constexpr const char* log_name = "energy.csv";
inline constexpr const char* summary_name = "run.json";

std::filesystem::path frame_file(const std::filesystem::path& directory, const char* family,
                                 std::int64_t number);
std::string series_name(const char* family);

/// Everything in the folder that belongs to a trajectory, sorted.
std::vector<std::filesystem::path> trajectory_files(const std::filesystem::path& directory);

/// True if the folder holds more of a trajectory than checkpoints.
bool has_frames(const std::filesystem::path& directory);

/// True if the folder holds the file. An empty path counts as held.
bool is_in_folder(const std::filesystem::path& file, const std::filesystem::path& directory);

/// Checks that a run may go on in a folder. @throws InputError if the folder holds the trajectory
/// of another run and `overwrite` is false, or lacks what belongs to the run that is continued
void check_continuation(const std::filesystem::path& directory, const Continuation& point,
                        bool overwrite);

/// The part of the energy log up to a checkpoint.
struct KeptLog {
  std::string text;
  std::int64_t frames = 0;  ///< Lines below the header.
};
/// @throws InputError if the log has fewer lines, or is another run's
KeptLog kept_log(const std::filesystem::path& file, const Continuation& point);

/// The part of a series up to a checkpoint, and the files of later frames.
struct KeptSeries {
  std::vector<SeriesEntry> entries;
  std::vector<std::filesystem::path> later;
};
/// @param frames that the checkpoint counts; @param logged those of them that the log has, which
/// the
///   series must have as whole files
/// @throws InputError if it has not
KeptSeries kept_series(const std::filesystem::path& directory, const char* family,
                       std::int64_t frames, std::int64_t logged);

}  // namespace phyxel
