/// The frames of a run on disk, with surface and phyxels of equal time paired.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "phyxel/recorder.hpp"

namespace phyxel::app {

/// The files of one time of a trajectory; either path may be empty.
struct Shot {
  std::filesystem::path surface, phyxels;
  double time = 0;
};

struct Trajectory {
  std::vector<Shot> shots;
  bool series = true;  // false for a single frame file
};

/// The families of a trajectory that are requested.
struct Families {
  bool surface = true, phyxels = true;
};

/// Finds the frames of a run's folder, a series file or a frame file.
/// @throws InputError if there are no frames of the requested families
Trajectory find_trajectory(const std::filesystem::path& input, Families wanted);

/// The frame in a file; unset if the name is empty. @param fields true: with its fields
std::optional<FrameData> read_if_any(const std::filesystem::path& file, bool fields = false);

/// Number of decimals that distinguishes the frames' times, at least 2.
int time_decimals(const std::vector<Shot>& shots);

/// A choice of frames of a series. At most one member is set; none chooses all frames.
struct FrameChoice {
  std::vector<std::int64_t> frames;  ///< Numbers from 0; negative numbers count from the end.
  std::int64_t count = 0;            ///< Number of evenly spaced frames, first and last included.
  std::int64_t every = 0;            ///< Interval of frames, from the first.
};

/// The chosen frame numbers, ascending and unique.
/// @throws InputError for a number outside [-available, available), or a negative count or interval
std::vector<std::size_t> choose_frames(const FrameChoice& choice, std::size_t available);

}  // namespace phyxel::app
