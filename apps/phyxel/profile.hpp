/// `phyxel run --profile`: a timeline of all ranks for a browser's trace viewer.
#pragma once

#include <string>

namespace phyxel::app {

/// Starts recording on all ranks at the same time. Collective.
/// @throws InputError if the file exists and must not be replaced
void start_profile(const std::string& file, bool force);

/// Writes the recorded trace events (JSON), with a process for each rank. Collective.
/// @throws OutputError
void write_profile(const std::string& file);

}  // namespace phyxel::app
