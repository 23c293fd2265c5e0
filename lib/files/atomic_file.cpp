#include "files/atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "phyxel/error.hpp"

namespace phyxel {
namespace {

namespace fs = std::filesystem;

std::string reason(int error) { return std::error_code(error, std::generic_category()).message(); }

[[noreturn]] void fail(const fs::path& file, const char* what, int error) {
  throw OutputError(fmt::format("{}: {}: {}", file.string(), what, reason(error)));
}

/// The kind of a file that is not regular, for messages; null for a regular file.
const char* irregular(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISCHR(mode)) return "a character device";
  if (S_ISBLK(mode)) return "a block device";
  if (S_ISFIFO(mode)) return "a FIFO";
  if (S_ISSOCK(mode)) return "a socket";
  return S_ISREG(mode) ? nullptr : "not a regular file";
}

/// True for a FIFO or a character device, which can be written to but not replaced.
bool is_stream(mode_t mode) { return S_ISCHR(mode) || S_ISFIFO(mode); }

/// Gets the status of a path, following links. @returns false if it does not exist.
/// @throws InputError for a dangling link
bool found(const fs::path& file, struct stat* status) {
  if (::stat(file.c_str(), status) == 0) return true;
  const int error = errno;
  if (::lstat(file.c_str(), status) != 0) return false;
  throw InputError(fmt::format("{}: is a dangling link ({}); allowed: a file or a new name",
                               file.string(), reason(error)));
}

/// The regular file, existing or not, that writing to `file` replaces: the target of any links, so
/// that these stay. @throws InputError if it exists and is not a regular file
fs::path replaced_file(const fs::path& file) {
  struct stat status {};
  if (!found(file, &status)) return file;
  if (const char* what = irregular(status.st_mode)) {
    throw InputError(
        fmt::format("{}: is {}, which is not replaced; allowed: a regular file or a "
                    "new name",
                    file.string(), what));
  }
  std::error_code error;
  const fs::path target = fs::canonical(file, error);
  return error ? file : target;
}

/// A file descriptor with RAII.
class Descriptor {
 public:
  Descriptor(const fs::path& file, int flags)
      : fd_(::open(file.c_str(), flags | O_CLOEXEC, 0666)) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }
  /// Closes the descriptor, which may report an error that writing did not (NFS, quotas).
  int close() {
    const int result = ::close(fd_);
    fd_ = -1;
    return result;
  }

 private:
  int fd_;
};

/// Writes bytes at an offset. @returns 0, or the error number of the write that failed
int write_all(int fd, std::span<const std::byte> bytes, off_t at) {
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(fd, bytes.data(), bytes.size(), at);
    if (written < 0) {
      if (errno == EINTR) continue;
      return errno;
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    at += written;
  }
  return 0;
}

/// Writes bytes at the current position. @returns 0, or the error number
int write_on(int fd, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      return errno;
    }
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

void sync_folder(const fs::path& file) {
  const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  const Descriptor descriptor(folder, O_RDONLY | O_DIRECTORY);
  // Some file systems cannot sync a folder, and the error is ignored.
  if (descriptor.get() >= 0) ::fsync(descriptor.get());
}

}  // namespace

NewFile::NewFile(const fs::path& file, std::uint64_t size)
    : file_(replaced_file(file)), temporary_(file_.string() + ".tmp"), size_(size) {
  // The .tmp of a killed program is removed first, so that a link of that name is not followed.
  constexpr int flags = O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC;
  fd_ = ::open(temporary_.c_str(), flags, 0666);
  if (fd_ < 0 && errno == EEXIST && ::unlink(temporary_.c_str()) == 0) {
    fd_ = ::open(temporary_.c_str(), flags, 0666);
  }
  if (fd_ < 0) phyxel::fail(file_, "cannot be written", errno);
  if (size == 0) return;
  int failed = 0;
  do {
    failed = ::fallocate(fd_, 0, 0, static_cast<off_t>(size));
  } while (failed != 0 && errno == EINTR);
  if (failed == 0) return;
  // Where the file system does not support fallocate, a full disk shows when writing.
  // (posix_fallocate would write a byte into every block there.)
  for (const int error : {ENOSPC, EDQUOT, EFBIG, EIO}) {
    if (errno == error) fail(error);
  }
}

NewFile::~NewFile() {
  if (fd_ < 0) return;
  ::close(fd_);
  ::unlink(temporary_.c_str());
}

void NewFile::fail(int error) {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
  ::unlink(temporary_.c_str());
  phyxel::fail(file_, fmt::format("{} bytes could not be written", size_).c_str(), error);
}

void NewFile::write(std::uint64_t at, std::span<const std::byte> bytes) {
  if (const int error = write_all(fd_, bytes, static_cast<off_t>(at))) fail(error);
}

void NewFile::sync() {
  if (::fsync(fd_) != 0) fail(errno);
}

void NewFile::read(std::uint64_t at, std::uint64_t count,
                   const std::function<void(std::span<const std::byte>)>& take) {
  // Opened again: network file systems then revalidate what other hosts have written.
  const Descriptor others(temporary_, O_RDONLY);
  if (others.get() < 0) fail(errno);
  std::vector<std::byte> some(std::min<std::uint64_t>(count, std::uint64_t{16} << 20));
  for (const std::uint64_t end = at + count; at < end;) {
    const ssize_t got =
        ::pread(others.get(), some.data(), std::min<std::uint64_t>(some.size(), end - at),
                static_cast<off_t>(at));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) fail(got < 0 ? errno : EIO);
    take({some.data(), static_cast<std::size_t>(got)});
    at += static_cast<std::uint64_t>(got);
  }
}

void NewFile::finish(Durable durable) {
  if (durable == Durable::yes && ::fsync(fd_) != 0) fail(errno);
  // Closing may report an error that writing did not (NFS, quotas).
  if (::close(std::exchange(fd_, -1)) != 0) fail(errno);
  if (::rename(temporary_.c_str(), file_.c_str()) != 0) {
    const int error = errno;
    ::unlink(temporary_.c_str());
    phyxel::fail(file_, "cannot be written", error);
  }
  if (durable == Durable::yes) sync_folder(file_);
}

bool is_stream(const fs::path& file) {
  struct stat status {};
  return ::stat(file.c_str(), &status) == 0 && is_stream(status.st_mode);
}

void check_output_file(const fs::path& file, bool overwrite, Output output) {
  struct stat status {};
  if (!found(file, &status)) return;
  if (output == Output::file_or_stream && is_stream(status.st_mode)) return;
  replaced_file(file);
  if (overwrite) return;
  throw InputError(fmt::format("{}: exists already and is kept; allowed: another file, or --force",
                               file.string()));
}

void write_whole_file(const fs::path& file, std::string_view text, Durable durable) {
  if (is_stream(file)) {
    Descriptor stream(file, O_WRONLY | O_NOCTTY);
    const int error = stream.get() < 0 ? errno : write_on(stream.get(), bytes_of(text));
    if (error != 0) fail(file, "cannot be written", error);
    if (stream.close() != 0) fail(file, "cannot be written", errno);
    return;
  }
  NewFile out(file, text.size());
  out.write(0, bytes_of(text));
  out.finish(durable);
}

void sync_file(const fs::path& file) {
  const Descriptor descriptor(file, O_RDONLY);
  if (descriptor.get() < 0 || ::fsync(descriptor.get()) != 0) {
    // Some file systems cannot sync a folder.
    if (descriptor.get() >= 0 && errno == EINVAL) return;
    fail(file, "cannot be flushed to the disk", errno);
  }
}

void replace_tail(const fs::path& file, std::size_t keep, std::string_view text) {
  Descriptor descriptor(file, O_RDWR);
  struct stat status {};
  if (descriptor.get() < 0 || ::fstat(descriptor.get(), &status) != 0) {
    fail(file, "cannot be written", errno);
  }
  const auto size = static_cast<std::size_t>(status.st_size);
  if (size < keep) {
    throw OutputError(
        fmt::format("{}: has {} bytes where this run wrote at least {}: something else "
                    "has changed it",
                    file.string(), size, keep));
  }
  std::string tail(size - keep, '\0');
  if (::pread(descriptor.get(), tail.data(), tail.size(), static_cast<off_t>(keep)) !=
      static_cast<ssize_t>(tail.size())) {
    fail(file, "cannot be read back", errno);
  }
  int error = write_all(descriptor.get(), bytes_of(text), static_cast<off_t>(keep));
  if (error == 0 && ::ftruncate(descriptor.get(), static_cast<off_t>(keep + text.size())) != 0) {
    error = errno;
  }
  if (error != 0) {
    // The old tail fits the blocks that the file has already, so this works on a full disk.
    write_all(descriptor.get(), bytes_of(tail), static_cast<off_t>(keep));
    [[maybe_unused]] const int cut = ::ftruncate(descriptor.get(), static_cast<off_t>(size));
    fail(file, "cannot be written", error);
  }
  if (descriptor.close() != 0) fail(file, "cannot be written", errno);
}

void require_regular_file(const fs::path& file, const char* wanted) {
  struct stat status {};
  if (!found(file, &status)) {
    const std::string why =
        errno == ENOENT || errno == ENOTDIR ? "no such file" : "cannot be read: " + reason(errno);
    throw InputError(fmt::format("{}: {}", file.string(), why));
  }
  if (const char* what = irregular(status.st_mode)) {
    throw InputError(fmt::format("{}: is {}; allowed: {}", file.string(), what, wanted));
  }
}

std::string read_text_file(const fs::path& file, std::size_t limit) {
  require_regular_file(file);
  const Descriptor descriptor(file, O_RDONLY | O_NONBLOCK);
  if (descriptor.get() < 0) {
    throw InputError(fmt::format("{}: cannot be read: {}", file.string(), reason(errno)));
  }
  std::string text;
  char buffer[65536];
  while (true) {
    const ssize_t got = ::read(descriptor.get(), buffer, sizeof buffer);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0)
      throw InputError(fmt::format("{}: cannot be read: {}", file.string(), reason(errno)));
    if (got == 0) return text;
    text.append(buffer, static_cast<std::size_t>(got));
    if (text.size() > limit) {
      throw InputError(
          fmt::format("{}: more than {} bytes: too large for such a file", file.string(), limit));
    }
  }
}

void make_writable_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (!fs::is_directory(folder)) {
    throw InputError(fmt::format("{}: the output folder cannot be created: {}", folder.string(),
                                 error ? error.message() : "a file of that name exists"));
  }
  const fs::path probe = folder / fmt::format(".phyxel_probe_{}", ::getpid());
  const Descriptor descriptor(probe, O_WRONLY | O_CREAT | O_EXCL);
  if (descriptor.get() < 0) {
    throw InputError(fmt::format("{}: no file can be created in the output folder: {}",
                                 folder.string(), reason(errno)));
  }
  ::unlink(probe.c_str());
}

}  // namespace phyxel
