/// Atomic replacement of files, and logs that only ever hold complete lines.
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

/// Durability of a write: with `yes`, data survive a power cut once the call has returned.
enum class Durable { no, yes };

/// A file being written: to `file`.tmp, which is then renamed, so that `file` has its old content
/// or its new, never a part. If it is not finished, the old file, if any, stays and the .tmp is
/// removed. If `file` is a symbolic link, its target is replaced and the link stays; a link with
/// the name of the .tmp is removed, never followed.
class NewFile {
 public:
  /// Creates the .tmp and allocates `size` bytes on the disk.
  /// @throws OutputError, also if the disk has no room
  /// @throws InputError if a folder, device, FIFO or socket has that name
  NewFile(const std::filesystem::path& file, std::uint64_t size);
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  /// Writes bytes at an offset. @throws OutputError
  void write(std::uint64_t at, std::span<const std::byte> bytes);
  /// Makes what has been written visible to other processes and hosts. @throws OutputError
  void sync();
  /// Reads a range of the .tmp piece by piece, including what other processes have written.
  /// @throws OutputError
  void read(std::uint64_t at, std::uint64_t count,
            const std::function<void(std::span<const std::byte>)>& take);
  const std::filesystem::path& temporary() const { return temporary_; }
  /// Renames the .tmp to the file's name. @throws OutputError
  void finish(Durable durable);

 private:
  [[noreturn]] void fail(int error);

  std::filesystem::path file_, temporary_;
  std::uint64_t size_;
  int fd_ = -1;
};

/// The content of a file: a known number of bytes, produced in order.
struct Content {
  using Sink = std::function<void(std::span<const std::byte>)>;
  struct Piece {
    std::uint64_t bytes = 0;
    std::function<void(const Sink&)> produce;  ///< Null if `write_collectively` writes the piece.
    bool is_layout = false;                    ///< True for the part that locates the other pieces.
  };
  std::uint64_t size = 0;
  std::vector<Piece> pieces;
  /// Writes the pieces without `produce` into a file whose layout has been written; it may change
  /// the layout. Null if there are no such pieces.
  std::function<void(const std::filesystem::path& file)> write_collectively;
};

/// Kind of output: a regular file only, or also a stream (FIFO, character device).
enum class Output { file, file_or_stream };

/// True if `file` is a FIFO or a character device, after following links.
bool is_stream(const std::filesystem::path& file);

/// Checks that a file may be written; an existing regular file only if `overwrite` is true.
/// @throws InputError with the reason
void check_output_file(const std::filesystem::path& file, bool overwrite, Output output);

/// Writes a file atomically; a FIFO or a character device is written to directly.
/// @throws OutputError and InputError, as `NewFile`
void write_whole_file(const std::filesystem::path& file, std::string_view text, Durable durable);

/// Checks that a path is a regular file, after following links: a reader could wait for ever on
/// other kinds, or read without end.
/// @param wanted the kind of file that is allowed, for the message
/// @throws InputError if it is not a regular file
void require_regular_file(const std::filesystem::path& file, const char* wanted = "a regular file");

/// Flushes a file or folder to the disk. @throws OutputError
void sync_file(const std::filesystem::path& file);

/// Replaces the bytes after the first `keep` of `file` by `text`, in one write. If that fails, the
/// old tail is restored. @throws OutputError
void replace_tail(const std::filesystem::path& file, std::size_t keep, std::string_view text);

/// The content of a text file of at most `limit` bytes. @throws InputError
std::string read_text_file(const std::filesystem::path& file, std::size_t limit);

/// Creates a folder and its parents, and checks by a trial that files can be created in it.
/// @throws InputError
void make_writable_folder(const std::filesystem::path& folder);

}  // namespace phyxel
