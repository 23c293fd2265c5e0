/// Exceptions of a caller's code inside parallel regions, which may not leave them.
#pragma once

#include <exception>
#include <utility>

namespace phyxel {

/// Keeps the first exception that any thread met, until the region has ended.
class FirstError {
 public:
  /// `work()`, or a value of its type made of nothing if it throws.
  template <class Work>
  auto caught(Work&& work) noexcept -> decltype(work()) {
    try {
      return work();
    } catch (...) {
#pragma omp critical(phyxel_first_error)
      if (!error_) error_ = std::current_exception();
    }
    return {};
  }

  /// Outside the region. @throws what was caught, once
  void rethrow() {
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  }

 private:
  std::exception_ptr error_;
};

}  // namespace phyxel
