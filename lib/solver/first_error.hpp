/// Exceptions of a caller's code inside OpenMP parallel regions, which exceptions may not leave.
#pragma once

#include <exception>
#include <utility>

namespace phyxel {

/// Keeps the first exception of any thread until the region has ended.
class FirstError {
 public:
  /// Returns `work()`, or a default-constructed value if it throws.
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

  /// Rethrows the caught exception, once. Call outside the region.
  void rethrow() {
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  }

 private:
  std::exception_ptr error_;
};

}  // namespace phyxel
