/// The seal in front of every HDF5 file of ours.
///
/// The digest finds what was damaged or cut short; it is no shield against content made on purpose,
/// since anybody can compute one: `hdf5_layout` is. The digest sits in the file itself, as text in
/// the first 512 bytes: HDF5 calls that a user block and skips it, so that ParaView, VTK and h5py
/// read the file as any other.
///
///   phyxel sealed file 1
///   kind       checkpoint
///   bytes      123456            (behind the seal)
///   xxh3-128   0123...           (of those bytes)
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "files/atomic_file.hpp"

namespace phyxel {

/// Bytes of the seal: the smallest user block of HDF5.
inline constexpr std::size_t seal_size = 512;

/// Writes seal and content, whole or not at all; the disk must have room for both before the
/// content is asked for. @throws OutputError, and what `content` throws.
void write_sealed(const std::filesystem::path& file, const std::string& kind,
                  const Content& content, Durable durable);

/// Seals a file that was written with `seal_size` bytes left free in front. @throws OutputError.
void seal_in_place(const std::filesystem::path& file, const std::string& kind);

/// Compares the size with what the seal says, and reads nothing else.
/// @throws InputError for a file that is missing, unreadable, cut short or not ours.
void check_size(const std::filesystem::path& file);

/// Compares the digest. @returns the kind of file.
/// @throws InputError for a file that is missing, unreadable, cut short, altered or not ours.
std::string check_seal(const std::filesystem::path& file);

/// The same, for one kind only. @throws InputError also for another kind.
void check_seal(const std::filesystem::path& file, const std::string& kind);

}  // namespace phyxel
