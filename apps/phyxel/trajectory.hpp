/// The frames of a run on disk, surface and phyxels of one time together.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "phyxel/recorder.hpp"

namespace phyxel::app {

/// Where one moment of the trajectory is on disk; either path may be empty.
struct Shot {
  std::filesystem::path surface, phyxels;
  double time = 0;
};

struct Trajectory {
  std::vector<Shot> shots;
  bool series = true;  // else a single frame file
};

/// Which of a trajectory's families are wanted.
struct Families {
  bool surface = true, phyxels = true;
};

/// The frames of a run's folder, of one series file, or one frame file.
/// @throws InputError if there are none of those wanted
Trajectory find_trajectory(const std::filesystem::path& input, Families wanted);

/// The frame of that file; nothing if its name is empty.
std::optional<FrameData> read_if_any(const std::filesystem::path& file);

/// Enough decimals to tell two frames apart, at least 2.
int time_decimals(const std::vector<Shot>& shots);

/// Which frames of a series; at most one member is set, none means all of them.
struct FrameChoice {
  std::vector<std::int64_t> frames;  ///< Numbers from 0; negative ones count from the end.
  std::int64_t count = 0;            ///< This many, evenly spread, first and last included.
  std::int64_t every = 0;            ///< Every so many, from the first.
};

/// Frame numbers in rising order, each once.
/// @throws InputError for a number outside [-available, available), or a negative count or step.
std::vector<std::size_t> choose_frames(const FrameChoice& choice, std::size_t available);

}  // namespace phyxel::app
