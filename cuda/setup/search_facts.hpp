/// Numbers that the kernels of a search for points leave for the host.
#pragma once

#include <cstdint>

#include "model/contact_groups.hpp"
#include "pinned.hpp"

namespace phyxel::cuda {

/// The extent of points.
struct Extent {
  Box box = no_box;  ///< Around the points [m].
  double range = 0;  ///< The largest range of the points [m].
};

/// Numbers of a search, zero as it begins.
struct SearchFacts {
  std::int64_t candidates = 0;
  Extent extent;                   ///< The extent of the candidates.
  unsigned long long entries = 0;  ///< Entries found, with or without room for them.
  // Of rows:
  std::int64_t rows = 0;            ///< Rows before they are divided into patches.
  unsigned long long divided = 0;   ///< Rows that are divided.
  unsigned long long repeated = 0;  ///< Entries that patches have more than the rows.
  // Of the points that are in rows:
  std::int64_t own = 0;    ///< Points of this rank.
  std::int64_t other = 0;  ///< Points of other ranks.
  std::int64_t tiles = 0;  ///< Tiles of the points of this rank.
};

/// The numbers in device memory, which the host reads together.
class FactsOnDevice {
 public:
  FactsOnDevice() : facts_(1, "contact") {}

  /// Sets all numbers to zero.
  void clear() const { facts_.clear(); }
  /// The numbers as kernels see them.
  SearchFacts* view() const { return facts_.data(); }
  /// Waits for the launches so far. @returns the numbers, valid until the next call
  const SearchFacts& read() {
    read_.fetch(facts_, work_stream());
    return last();
  }
  /// The numbers that have been read last.
  const SearchFacts& last() const { return read_[0]; }

 private:
  DeviceArray<SearchFacts> facts_;
  PinnedArray<SearchFacts> read_;
};

}  // namespace phyxel::cuda
