/// Operator new with huge pages for large arrays. It belongs to the program: a library must leave
/// the operator to its users.
#include <cstdlib>
#include <new>

#include "huge_pages.hpp"

// Sanitizers replace the operator; clang reports them as features.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define PHYXEL_OWN_NEW 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || \
    __has_feature(memory_sanitizer)
#define PHYXEL_OWN_NEW 0
#endif
#endif
#ifndef PHYXEL_OWN_NEW

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
