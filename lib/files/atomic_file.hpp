/// Files that are whole or absent, and logs that are whole lines.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>

namespace phyxel {

/// Whether data must survive a power cut before the call returns.
enum class Durable { no, yes };

/// Writes the pieces, one after the other, to `file`.tmp and renames it: `file` is the old content
/// or the new, never a part. @throws OutputError; the old file, if any, stays and no .tmp is left.
void write_whole_file(const std::filesystem::path& file,
                      std::span<const std::span<const std::byte>> pieces, Durable durable);
void write_whole_file(const std::filesystem::path& file, std::string_view text, Durable durable);

/// Renames a finished `.tmp` file into place, synced first if durable. @throws OutputError.
void move_into_place(const std::filesystem::path& temporary, const std::filesystem::path& file,
                     Durable durable);

/// Replaces what follows the first `keep` bytes of `file` by `text`, in one write. If that fails
/// the old tail is put back. @throws OutputError.
void replace_tail(const std::filesystem::path& file, std::size_t keep, std::string_view text);

/// The content of a text file of at most `limit` bytes. @throws InputError.
std::string read_text_file(const std::filesystem::path& file, std::size_t limit);

/// Makes a folder, with those above it, and proves that files can be made in it.
/// @throws InputError.
void make_writable_folder(const std::filesystem::path& folder);

}  // namespace phyxel
