/// Errors of CUDA calls as DeviceErrors that name the request.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <string>
#include <utility>

namespace phyxel {

/// Checks the result of a call. @throws DeviceError naming `call` and the device
void check_cuda(cudaError_t error, const char* call);
#define PHYXEL_CUDA(call) ::phyxel::check_cuda(call, #call)

/// Description of a kernel launch, for messages.
struct Launch {
  const char* kernel = "no kernel yet";
  unsigned blocks = 0, threads = 0;
  std::string subject;  ///< Data of the launch, e.g. "body \"dino\", 575 phyxels".
  std::string describe() const;
};

/// Checks, right after a launch, that CUDA has accepted it. With PHYXEL_CUDA_SYNC=1 in the
/// environment, the check waits for the kernel, so that a fault is attributed to its launch.
/// @throws DeviceError
void check_launch(const Launch& launch);
/// True if `check_launch` waits, which is not possible while launches are recorded into a graph.
bool launches_are_waited_for();

/// Waits for all launches. @throws DeviceError naming the last launch
void wait_for_device(const Launch& last);

namespace detail {
/// Allocates device memory; the result is not null for `bytes` > 0.
/// @throws DeviceError naming the purpose, the requested and the free memory
void* allocate(std::size_t bytes, const std::string& what);
/// Frees it. @param pooled true if a `PooledMemory` existed when it was allocated
void release(void* data, bool pooled);
}  // namespace detail

/// A scope whose device arrays of this thread lie in a memory pool, which keeps freed memory: for
/// work that makes many arrays again and again. Such an array must not be used by streams that do
/// not synchronise with CUDA's default stream, nor by other processes.
class PooledMemory {
 public:
  PooledMemory();
  PooledMemory(const PooledMemory&) = delete;
  PooledMemory& operator=(const PooledMemory&) = delete;
  ~PooledMemory();
  /// True if one exists in this thread.
  static bool is_used();
  /// Returns the memory that the pool keeps, but for what is in use, to the device.
  static void give_back() noexcept;

 private:
  bool is_here_ = false;  // the device has pools
};

/// An array in device memory with RAII, initially undefined.
template <class T>
class DeviceArray {
 public:
  DeviceArray() = default;
  /// @param what name of the array for messages, e.g. "the force matrix (575 x 575)"
  DeviceArray(std::size_t count, const std::string& what)
      : data_(static_cast<T*>(detail::allocate(count * sizeof(T), what))),
        count_(count),
        pooled_(PooledMemory::is_used()) {}
  DeviceArray(DeviceArray&& other) noexcept { swap(other); }
  DeviceArray& operator=(DeviceArray&& other) noexcept {
    DeviceArray(std::move(other)).swap(*this);
    return *this;
  }
  ~DeviceArray() { detail::release(data_, pooled_); }

  T* data() const { return data_; }
  std::size_t size() const { return count_; }
  std::size_t bytes() const { return count_ * sizeof(T); }

  /// Copies size() values from the host.
  void upload(const T* from) const {
    if (count_) PHYXEL_CUDA(cudaMemcpy(data_, from, bytes(), cudaMemcpyHostToDevice));
  }
  /// Sets all bytes to zero.
  void clear(cudaStream_t stream = nullptr) const {
    if (count_) PHYXEL_CUDA(cudaMemsetAsync(data_, 0, bytes(), stream));
  }
  void download(T* to) const { download(to, 0, count_); }
  void download(T* to, std::size_t first, std::size_t count) const {
    if (count)
      PHYXEL_CUDA(cudaMemcpy(to, data_ + first, count * sizeof(T), cudaMemcpyDeviceToHost));
  }

 private:
  void swap(DeviceArray& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(count_, other.count_);
    std::swap(pooled_, other.pooled_);
  }
  T* data_ = nullptr;
  std::size_t count_ = 0;
  bool pooled_ = false;
};

}  // namespace phyxel
