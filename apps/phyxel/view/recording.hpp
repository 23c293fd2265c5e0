/// What users have done to a live scene, on disk.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "view/request.hpp"

namespace phyxel::app {

/// An act, and the number of steps taken before it took effect (`LiveScene::taken`).
struct Recorded {
  std::int64_t step = 0;
  Request act;
  bool operator==(const Recorded&) const = default;
};

/// The acts of a session, in their order, and what they belong to.
struct Recording {
  std::string program;      ///< Version of the program.
  std::uint64_t model = 0;  ///< Digest of the model at the start.
  std::string precision;    ///< Of the arithmetic.
  std::vector<Recorded> acts;
};

/// A recording as lines of JSON: a head, and a line for each act.
std::string text_of(const Recording& recording);

/// Reads the text of a recording. @param file name for messages
/// @throws InputError naming the line and the fault
Recording parse_recording(const std::string& text, const std::filesystem::path& file);

}  // namespace phyxel::app
