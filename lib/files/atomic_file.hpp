/// Files that are whole or absent, and logs that are whole lines.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace phyxel {

/// Whether data must survive a power cut before the call returns.
enum class Durable { no, yes };

/// A file on its way: written to `file`.tmp and renamed, so that `file` is the old content or the
/// new, never a part. If it is not finished, the old file, if any, stays and no .tmp is left. Where
/// `file` is a link, the file that it leads to is replaced and the link stays; a link that is in
/// the place of the .tmp is removed, never followed.
class NewFile {
 public:
  /// Takes `size` bytes of the disk. @throws OutputError, also if they are not there; InputError if
  /// a folder, device, FIFO or socket has that name.
  NewFile(const std::filesystem::path& file, std::uint64_t size);
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  /// @throws OutputError.
  void write(std::uint64_t at, std::span<const std::byte> bytes);
  /// What is written by now is there for others. @throws OutputError.
  void sync();
  /// Some of what is there by now, of whoever's writing, piece by piece. @throws OutputError.
  void read(std::uint64_t at, std::uint64_t count,
            const std::function<void(std::span<const std::byte>)>& take);
  const std::filesystem::path& temporary() const { return temporary_; }
  /// Renames it. @throws OutputError.
  void finish(Durable durable);

 private:
  [[noreturn]] void fail(int error);

  std::filesystem::path file_, temporary_;
  std::uint64_t size_;
  int fd_ = -1;
};

/// Bytes of known number, handed over from the first to the last.
struct Content {
  using Sink = std::function<void(std::span<const std::byte>)>;
  struct Piece {
    std::uint64_t bytes = 0;
    std::function<void(const Sink&)> produce;  ///< Null: comes by `write_collectively`.
    bool is_layout = false;                    ///< What tells where all else is.
  };
  std::uint64_t size = 0;
  std::vector<Piece> pieces;
  /// Puts pieces into a file whose layout is there, which it may change; null: there are none.
  std::function<void(const std::filesystem::path& file)> write_collectively;
};

/// What a program can write to: regular files only, or streams (FIFOs, character devices) as well.
enum class Output { file, file_or_stream };

/// True if a FIFO or a character device has that name, behind any links.
bool is_stream(const std::filesystem::path& file);

/// Checks before any work is done that a file may be written: an existing regular file only if
/// `overwrite` is true. @throws InputError with the reason
void check_output_file(const std::filesystem::path& file, bool overwrite, Output output);

/// Writes a file, whole or not at all; a FIFO or character device is written to and stays what it
/// is.
/// @throws OutputError and InputError, as `NewFile`.
void write_whole_file(const std::filesystem::path& file, std::string_view text, Durable durable);

/// Refuses at once what a reader could wait on for ever, or would not end. Links are followed.
/// @param wanted what is allowed, for the message
/// @throws InputError unless the file is a regular one.
void require_regular_file(const std::filesystem::path& file, const char* wanted = "a regular file");

/// Brings a file or folder to the disk. @throws OutputError
void sync_file(const std::filesystem::path& file);

/// Replaces what follows the first `keep` bytes of `file` by `text`, in one write. If that fails
/// the old tail is put back. @throws OutputError.
void replace_tail(const std::filesystem::path& file, std::size_t keep, std::string_view text);

/// The content of a text file of at most `limit` bytes. @throws InputError.
std::string read_text_file(const std::filesystem::path& file, std::size_t limit);

/// Makes a folder, with those above it, and proves that files can be made in it.
/// @throws InputError.
void make_writable_folder(const std::filesystem::path& folder);

}  // namespace phyxel
