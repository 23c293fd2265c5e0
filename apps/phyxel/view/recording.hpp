/// Acts of users on a live scene, as files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "phyxel/scene.hpp"
#include "view/request.hpp"

namespace phyxel::app {

/// An act, and the number of steps taken before it took effect (`LiveScene::taken`).
struct Recorded {
  std::int64_t step = 0;
  Request act;
  bool operator==(const Recorded&) const = default;
};

/// The run that a session belongs to. In an equal run, the same acts give the same bits.
struct RecordedRun {
  std::uint64_t model = 0;            ///< Digest of the model at the start.
  std::string precision, method;      ///< By name.
  double dt = 0;                      ///< First step [s].
  std::vector<Parameter> parameters;  ///< Of the scene (`scene_parameters`).
};

/// The acts of a session, in their order, and its run.
struct Recording {
  std::string program;  ///< Version of the program.
  RecordedRun of;
  std::vector<Recorded> acts;
};

/// The differences between two runs in words, a line each; empty if there are none.
std::string differences(const RecordedRun& then, const RecordedRun& now);

/// A recording as lines of JSON: a head, and a line for each act.
std::string text_of(const Recording& recording);

/// Reads the text of a recording. @param file name for messages
/// @throws InputError naming the line and the fault
Recording parse_recording(const std::string& text, const std::filesystem::path& file);

}  // namespace phyxel::app
