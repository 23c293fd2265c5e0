/// Memory into which HDF5 writes a file, sparse where arrays are written later.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

namespace phyxel {

/// The bytes of a file in memory; pages that were never written take no memory.
class SparseBytes {
 public:
  std::uint64_t size() const { return size_; }
  /// Truncates the file, or extends it by zeros.
  void resize(std::uint64_t size);
  void write(std::uint64_t at, std::span<const std::byte> bytes);
  /// Reads bytes at an offset; bytes that were never written, and those after the end, are zero.
  void read(std::uint64_t at, std::span<std::byte> bytes) const;

 private:
  std::uint64_t size_ = 0;
  std::map<std::uint64_t, std::vector<std::byte>> pages_;  // by page number
};

/// An HDF5 file access list (`hid_t`) whose files are `bytes`, which must outlive them.
std::int64_t memory_access_list(SparseBytes& bytes);

}  // namespace phyxel
