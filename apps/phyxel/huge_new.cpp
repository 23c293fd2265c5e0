/// The program's arrays, all that are large, in huge pages. Of the program alone: a library leaves
/// the operator to who links it.
#include <cstdlib>
#include <new>

#include "huge_pages.hpp"

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // which have their own

void* operator new(std::size_t size) {
  for (;;) {
    void* memory =
        size >= phyxel::least_huge ? phyxel::allocate_huge(size) : std::malloc(size > 0 ? size : 1);
    if (memory) return memory;
    const std::new_handler handler = std::get_new_handler();
    if (!handler) throw std::bad_alloc();
    handler();
  }
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

#endif
