/// The structure of an HDF5 file as Hdf5Writer makes it, read without HDF5.
///
/// Anybody can compute a digest, so a seal is no shield, and the parser of HDF5 1.10 reads beyond
/// its buffers on crafted files. Files of ours use a small part of the format: superblock 0, groups
/// with symbol tables, object headers 1, contiguous arrays of five types of numbers and texts of
/// fixed length, attributes in headers. That part is read here, and everything else is refused by
/// name: chunks, filters, other types, soft and external links, shared messages.
///
/// Format: The HDF Group, *HDF5 File Format Specification Version 3.0*.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace phyxel {

/// Bytes of an open file, read at their places.
class FileBytes {
 public:
  /// @throws InputError if the file cannot be opened or is no regular file.
  explicit FileBytes(std::string name);
  ~FileBytes();
  FileBytes(const FileBytes&) = delete;
  FileBytes& operator=(const FileBytes&) = delete;

  std::uint64_t size() const { return size_; }
  const std::string& name() const { return name_; }
  /// @throws InputError if the file ends before.
  void read(std::uint64_t at, std::uint64_t count, void* to) const;
  /// An InputError that names the file.
  [[noreturn]] void refuse(const std::string& why) const;

 private:
  std::string name_;
  int file_ = -1;
  std::uint64_t size_ = 0;
};

/// The value of an array or of an attribute: its type, its shape and where its bytes lie.
struct Hdf5Value {
  enum class Kind : std::uint8_t { real, integer, text };
  Kind kind = Kind::real;
  std::uint64_t width = 0;            ///< Bytes of one number, or of the text.
  std::vector<std::uint64_t> extent;  ///< At most two; empty for a single value.
  std::uint64_t at = 0;               ///< From the beginning of the file; all bytes lie in it.
  std::uint64_t count() const;        ///< Of numbers.
};

/// A group or an array.
struct Hdf5Object {
  bool is_group = false;
  Hdf5Value value;  ///< Of an array.
  std::map<std::string, Hdf5Value> attributes;
};

/// All objects of the file by their absolute paths ("/VTKHDF/Points"); the root is "". All sizes
/// are checked against the file's, and no byte of the file is claimed twice, so that memory and
/// time are bounded by the size of the file. @throws InputError for a file that Hdf5Writer does not
/// make.
std::map<std::string, Hdf5Object> read_hdf5_layout(const FileBytes& file);

}  // namespace phyxel
