/// `phyxel run --profile`: who does what when, for a browser's trace viewer.
#pragma once

#include <string>

namespace phyxel::app {

/// Starts the record of all ranks at one moment. Collective.
/// @throws InputError if the file is there and may not be replaced
void start_profile(const std::string& file, bool force);

/// Writes what all ranks have recorded as trace events (JSON), a process a rank. Collective.
/// @throws OutputError
void write_profile(const std::string& file);

}  // namespace phyxel::app
