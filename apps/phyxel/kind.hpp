/// Kinds of input files, so that a command can name the right command for a wrong kind.
#pragma once

#include <filesystem>
#include <initializer_list>

namespace phyxel::app {

enum class Kind { missing, folder, scene, mesh, series, hdf5, table, unknown };

/// The kind of a file or folder, from its name and, for HDF5, its first bytes. Pipes and devices
/// are not opened.
Kind kind_of(const std::filesystem::path& file);

/// Checks and returns the kind of a command's input file. Missing files and unknown kinds pass, and
/// are left to the reader.
/// @throws InputError if the kind is known and not among `wanted`, naming the kind, the command
/// that
///   takes it, and the allowed kinds
Kind expect_kind(const std::filesystem::path& file, std::initializer_list<Kind> wanted);

}  // namespace phyxel::app
