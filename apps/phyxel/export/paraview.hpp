/// phyxel export --format paraview: a Python state of ParaView for a run.
#pragma once

#include <filesystem>
#include <string>

#include "field_colours.hpp"

namespace phyxel::app {

/// A Python script by which ParaView opens the series of a run, with colours, times and camera set:
/// surface and phyxels, of which one is coloured by a field.
/// @param folder of the run
/// @param colours request for colours; without a field, von_mises, displacement or the first field
/// @throws InputError if the run has no trajectory, or lacks the field
std::string paraview_state(const std::filesystem::path& folder, ColourRequest colours);

}  // namespace phyxel::app
