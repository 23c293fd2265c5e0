#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>

namespace phyxel {

/// Copies bytes on all threads. @param to must have the same length
inline void copy_bytes(std::span<const std::byte> from, std::span<std::byte> to) {
  constexpr std::size_t piece = std::size_t{4} << 20;
#pragma omp parallel for schedule(static)
  for (std::size_t at = 0; at < from.size(); at += piece) {
    std::memcpy(to.data() + at, from.data() + at, std::min(piece, from.size() - at));
  }
}

}  // namespace phyxel
