/// Memory that HDF5 writes a file into, with room for arrays that are not in it yet.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

namespace phyxel {

/// Bytes of a file of which most have never been written, and take no memory.
class SparseBytes {
 public:
  std::uint64_t size() const { return size_; }
  /// Cuts, or grows by zeros.
  void resize(std::uint64_t size);
  void write(std::uint64_t at, std::span<const std::byte> bytes);
  /// Zeros where nothing was written, and behind the end.
  void read(std::uint64_t at, std::span<std::byte> bytes) const;

 private:
  std::uint64_t size_ = 0;
  std::map<std::uint64_t, std::vector<std::byte>> pages_;  // by number
};

/// A file access list of HDF5 (`hid_t`) whose files are these bytes, which must outlive them.
std::int64_t memory_access_list(SparseBytes& bytes);

}  // namespace phyxel
