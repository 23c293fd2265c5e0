/// What kind of file a command was given, so that the wrong one is answered with what to do.
#pragma once

#include <filesystem>
#include <initializer_list>

namespace phyxel::app {

enum class Kind { missing, folder, scene, mesh, series, hdf5, table, unknown };

/// The kind of a file or folder by its name and, for HDF5, its first bytes. Pipes and devices are
/// not opened.
Kind kind_of(const std::filesystem::path& file);

/// The kind of a command's input file, checked.
/// @throws InputError if the file is plainly of none of the kinds `wanted`, naming the kind it has,
/// the command that takes it, and what is allowed. A missing file or an unknown kind is left to the
/// reader.
Kind expect_kind(const std::filesystem::path& file, std::initializer_list<Kind> wanted);

}  // namespace phyxel::app
