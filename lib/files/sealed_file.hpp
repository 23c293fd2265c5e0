/// The seal in front of phyxel's HDF5 files.
///
/// The digest reveals damaged and truncated files. It does not protect against crafted content,
/// since anybody can compute one; `hdf5_layout` does. The seal is text in the first 512 bytes of
/// the file, a user block in HDF5's terms, which ParaView, VTK and h5py skip.
///
///   phyxel sealed file 1
///   kind       checkpoint
///   bytes      123456            (number of bytes behind the seal)
///   xxh3-128   0123...           (digest of those bytes)
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "files/atomic_file.hpp"

namespace phyxel {

/// Size of the seal [bytes]: the smallest user block of HDF5.
inline constexpr std::size_t seal_size = 512;

/// Writes seal and content atomically, after allocating disk space for both.
/// @throws OutputError, and what `content` throws
void write_sealed(const std::filesystem::path& file, const std::string& kind,
                  const Content& content, Durable durable);

/// Seals a file that was written with `seal_size` bytes left free in front. @throws OutputError
void seal_in_place(const std::filesystem::path& file, const std::string& kind);

/// Compares the file's size with the seal's, without reading the content.
/// @throws InputError for a file that is missing, unreadable, truncated or not sealed by phyxel
void check_size(const std::filesystem::path& file);

/// Verifies the digest. @returns the kind of file
/// @throws InputError for a file that is missing, unreadable, truncated, altered or not sealed by
///   phyxel
std::string check_seal(const std::filesystem::path& file);

/// Verifies the digest and the kind of file. @throws InputError, also for another kind
void check_seal(const std::filesystem::path& file, const std::string& kind);

}  // namespace phyxel
