/// phyxel export --format vtu: frames as VTK's XML files, which most tools for meshes read.
#pragma once

#include <filesystem>
#include <vector>

#include "phyxel/recorder.hpp"
#include "trajectory.hpp"

namespace phyxel::app {

/// A frame as an unstructured grid in VTK's XML format (.vtu), with all fields: a surface has
/// triangles, and phyxels are one vertex cell each. Arrays are in Base64.
std::string vtu_text(const FrameData& frame);

/// Writes the frames of a run's folder or of a series as `folder`/surface_<number>.vtu and
/// phyxels_<number>.vtu, and a collection of either family, surface.pvd and phyxels.pvd, with the
/// times.
/// @returns the files written; the collections are the last
/// @throws InputError if there are no frames, or, without `overwrite`, if one of the files exists
///   (none is written then); OutputError if writing fails
std::vector<std::filesystem::path> export_vtu(const std::filesystem::path& input,
                                              const std::filesystem::path& folder,
                                              const FrameChoice& choice, bool overwrite);

}  // namespace phyxel::app
