/// Arrays with uninitialised elements: a billion zeros need not be written first, and the thread
/// that fills a range is the first to touch its memory.
#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

namespace phyxel {

template <class T>
struct Unfilled : std::allocator<T> {
  // The lifetime of objects of such types begins with their memory.
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

/// A vector whose constructor and resize leave new elements uninitialised.
template <class T>
using Bulk = std::vector<T, Unfilled<T>>;

/// Releases the memory of a vector.
template <class Vector>
void release(Vector& values) {
  Vector().swap(values);
}

}  // namespace phyxel
