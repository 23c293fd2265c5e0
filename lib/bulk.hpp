/// Arrays whose elements have no value until they are given one: nobody writes a billion zeros
/// first, and the thread that fills a stretch is the first to touch its memory.
#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

namespace phyxel {

template <class T>
struct Unfilled : std::allocator<T> {
  // Objects of such types begin to live with their memory.
  static_assert(std::is_trivially_copy_constructible_v<T> && std::is_trivially_destructible_v<T>);
  Unfilled() = default;
  template <class Other>
  Unfilled(const Unfilled<Other>&) {}
  template <class Other>
  struct rebind {
    using other = Unfilled<Other>;
  };
  template <class U>
  void construct(U*) {}
  template <class U, class... Values>
  void construct(U* at, Values&&... values) {
    ::new (static_cast<void*>(at)) U(std::forward<Values>(values)...);
  }
};

/// Bulk<T>(n) and resize(n) leave new elements to be written.
template <class T>
using Bulk = std::vector<T, Unfilled<T>>;

/// Gives the memory back.
template <class Vector>
void release(Vector& values) {
  Vector().swap(values);
}

}  // namespace phyxel
