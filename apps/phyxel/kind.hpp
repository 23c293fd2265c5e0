/// What kind of file a command was given, so that the wrong one is answered with what to do.
#pragma once

#include <filesystem>
#include <string>

namespace phyxel::app {

enum class Kind { missing, folder, scene, mesh, series, hdf5, table, unknown };

/// The kind of a file or folder by its name and, for HDF5, its first bytes. Pipes and devices are
/// not opened.
Kind kind_of(const std::filesystem::path& file);

/// @throws InputError if the file is plainly of another kind than `wanted` (Kind::scene,
/// Kind::mesh or Kind::series), naming the kind it has and the command that takes it. A missing
/// file or an unknown kind is left to the reader.
void expect_kind(const std::filesystem::path& file, Kind wanted);

}  // namespace phyxel::app
