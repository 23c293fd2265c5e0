/// The folder of a trajectory: its files, and checks before a run continues in it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "phyxel/recorder.hpp"

namespace phyxel {

inline constexpr const char* log_name = "energy.csv";
inline constexpr const char* reactions_name = "reactions.csv";
inline constexpr const char* gas_name = "gas.csv";
inline constexpr const char* contacts_name = "contacts.csv";
inline constexpr const char* rigid_name = "rigid.csv";
inline constexpr const char* fragments_name = "fragments.csv";
inline constexpr const char* probes_name = "probes.csv";
inline constexpr const char* summary_name = "run.json";

std::filesystem::path frame_file(const std::filesystem::path& directory, const char* family,
                                 std::int64_t number);
std::string series_name(const char* family);

/// The files of the folder that belong to a trajectory, sorted.
std::vector<std::filesystem::path> trajectory_files(const std::filesystem::path& directory);

/// True if the folder holds files of a trajectory other than checkpoints.
bool has_frames(const std::filesystem::path& directory);

/// True if the file is in the folder, or if its path is empty.
bool is_in_folder(const std::filesystem::path& file, const std::filesystem::path& directory);

/// Checks that a run may continue in a folder.
/// @throws InputError if the folder holds the trajectory of another run and `overwrite` is false,
/// or
///   lacks files of the run that is continued
void check_continuation(const std::filesystem::path& directory, const Continuation& point,
                        bool overwrite);

/// The part of the energy log up to a checkpoint.
struct KeptLog {
  std::string text;
  std::int64_t frames = 0;  ///< Lines below the header.
  double last_time = -1;    ///< Time of the last line [s]; -1 if there is none.
};
/// Reads the energy log up to a checkpoint.
/// @throws InputError if the log has too few lines, or belongs to another run
KeptLog kept_log(const std::filesystem::path& file, const Continuation& point);

/// The part of a series up to a checkpoint, and the files of later frames.
struct KeptSeries {
  std::vector<SeriesEntry> entries;
  std::vector<std::filesystem::path> later;
};
/// Reads a series up to a checkpoint.
/// @param frames number of frames at the checkpoint
/// @param logged number of frames in the energy log, for each of which the series must have a file
/// @throws InputError if a file is missing or incomplete
KeptSeries kept_series(const std::filesystem::path& directory, const char* family,
                       std::int64_t frames, std::int64_t logged);

}  // namespace phyxel
