/// Parser, without HDF5, of the structure of HDF5 files that Hdf5Writer makes.
///
/// Anybody can compute a digest, so a seal does not protect against crafted files, on which the
/// parser of HDF5 1.10 reads beyond its buffers. phyxel's files use a small part of the format:
/// superblock 0, groups with symbol tables, object headers 1, contiguous arrays of five number
/// types and texts of fixed length, attributes in headers. This parser reads that part, and refuses
/// everything else by name: chunks, filters, other types, soft and external links, shared messages.
///
/// Format: The HDF Group, *HDF5 File Format Specification Version 3.0*.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace phyxel {

/// An open file, read at given offsets.
class FileBytes {
 public:
  /// Opens a file. @throws InputError if it cannot be opened or is not a regular file
  explicit FileBytes(std::string name);
  ~FileBytes();
  FileBytes(const FileBytes&) = delete;
  FileBytes& operator=(const FileBytes&) = delete;

  std::uint64_t size() const { return size_; }
  const std::string& name() const { return name_; }
  /// Reads `count` bytes at the offset `at`. @throws InputError if the file ends before
  void read(std::uint64_t at, std::uint64_t count, void* to) const;
  /// Throws an InputError that names the file.
  [[noreturn]] void refuse(const std::string& why) const;

 private:
  std::string name_;
  int file_ = -1;
  std::uint64_t size_ = 0;
};

/// The value of an array or an attribute: its type, its shape and the offset of its bytes.
struct Hdf5Value {
  enum class Kind : std::uint8_t { real, integer, text };
  Kind kind = Kind::real;
  std::uint64_t width = 0;            ///< Size of one number, or of the text [bytes].
  std::vector<std::uint64_t> extent;  ///< Up to two dimensions; empty for a single value.
  std::uint64_t at = 0;         ///< Offset from the beginning of the file, which holds all bytes.
  std::uint64_t count() const;  ///< Number of numbers.
};

/// A group or an array.
struct Hdf5Object {
  bool is_group = false;
  Hdf5Value value;  ///< The value of an array; unused for a group.
  std::map<std::string, Hdf5Value> attributes;
};

/// The objects of a file by absolute path ("/VTKHDF/Points"); the root is "". Sizes are checked
/// against the file's, and no byte of the file is claimed twice, so that memory and time are
/// bounded by the size of the file. @throws InputError if Hdf5Writer would not make such a file
std::map<std::string, Hdf5Object> read_hdf5_layout(const FileBytes& file);

}  // namespace phyxel
