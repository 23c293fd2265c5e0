/// Large arrays in pages of 2 MiB, where Linux gives them on request: scattered reads of a step by
/// CPUs then find the few entries that a processor has for pages, and memory is first touched five
/// hundred times less often.
#pragma once

#include <cstddef>
#include <cstdlib>
#include <new>
#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace phyxel {

inline constexpr std::size_t huge_page = std::size_t{2} << 20;
/// Arrays from this size on begin at a huge page [bytes].
inline constexpr std::size_t least_huge = 2 * huge_page;

/// Null if there is none. To be freed by std::free.
inline void* allocate_huge(std::size_t bytes) {
  void* memory = std::aligned_alloc(huge_page, (bytes + huge_page - 1) / huge_page * huge_page);
#if defined(__linux__)
  if (memory) madvise(memory, bytes, MADV_HUGEPAGE);  // if it is refused, small pages will do
#endif
  return memory;
}

}  // namespace phyxel
