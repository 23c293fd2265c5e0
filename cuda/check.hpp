/// Errors of CUDA calls as DeviceErrors that name the request.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "phyxel/error.hpp"

namespace phyxel {

/// An error of a device whose memory is used up.
class DeviceMemoryError : public DeviceError {
 public:
  using DeviceError::DeviceError;
};

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
/// @throws DeviceMemoryError naming the purpose, the requested and the free memory
void* allocate(std::size_t bytes, const std::string& what);
/// Copies between the host and the device, and waits for the copy.
void copy(void* to, const void* from, std::size_t bytes, cudaMemcpyKind kind);
}  // namespace detail

/// Device memory for work on one stream that makes many arrays again and again. The pool keeps
/// freed blocks and gives them to later arrays at once: the order of the stream keeps the kernels
/// that still use a block apart from those that get it next. Other streams must not use the arrays,
/// except for CUDA's default stream if it synchronises with the stream of the pool.
class MemoryPool {
 public:
  explicit MemoryPool(cudaStream_t stream) : stream_(stream) {}
  MemoryPool(const MemoryPool&) = delete;
  MemoryPool& operator=(const MemoryPool&) = delete;
  /// The pool must outlive its arrays.
  ~MemoryPool();

  cudaStream_t stream() const { return stream_; }
  /// Allocates as `detail::allocate`.
  void* take(std::size_t bytes, const std::string& what);
  void give_back(void* data) noexcept;  ///< `data` must not be null.
  /// Counts a round of the work, and frees the blocks that no array has used for many rounds.
  void begin_round();
  /// Number and size of the blocks that no array uses.
  std::size_t idle_blocks() const;
  std::size_t idle_bytes() const;

 private:
  struct Block {
    void* data;
    std::int64_t round;  ///< The round in which it was given back.
  };
  void free_blocks_before(std::int64_t round);

  cudaStream_t stream_;
  std::int64_t round_ = 0;
  std::map<std::size_t, std::vector<Block>> idle_;    // by size [bytes]
  std::unordered_map<void*, std::size_t> in_arrays_;  // sizes of the blocks in use [bytes]
};

/// A scope in which the device arrays that this thread makes lie in a pool, and in which its
/// copies, its clearing of arrays and the launches of set-up go to the stream of the pool.
class PooledMemory {
 public:
  explicit PooledMemory(MemoryPool& pool);
  PooledMemory(const PooledMemory&) = delete;
  PooledMemory& operator=(const PooledMemory&) = delete;
  ~PooledMemory();
  /// The pool of the scope that this thread is in, or null.
  static MemoryPool* used();

 private:
  MemoryPool* before_;
};

/// The stream of the pool in use, or CUDA's default stream.
inline cudaStream_t work_stream() {
  const MemoryPool* const pool = PooledMemory::used();
  return pool ? pool->stream() : nullptr;
}

/// An array in device memory with RAII, initially undefined.
template <class T>
class DeviceArray {
 public:
  DeviceArray() = default;
  /// @param what name of the array for messages, e.g. "the force matrix (575 x 575)"
  DeviceArray(std::size_t count, const std::string& what)
      : count_(count), pool_(PooledMemory::used()) {
    const std::size_t bytes = count * sizeof(T);
    data_ = static_cast<T*>(pool_ ? pool_->take(bytes, what) : detail::allocate(bytes, what));
  }
  DeviceArray(DeviceArray&& other) noexcept { swap(other); }
  DeviceArray& operator=(DeviceArray&& other) noexcept {
    DeviceArray(std::move(other)).swap(*this);
    return *this;
  }
  ~DeviceArray() {
    if (!data_) return;
    if (pool_) {
      pool_->give_back(data_);
    } else {
      cudaFree(data_);
    }
  }

  T* data() const { return data_; }
  std::size_t size() const { return count_; }
  std::size_t bytes() const { return count_ * sizeof(T); }

  /// Copies size() values from the host.
  void upload(const T* from) const {
    if (count_) detail::copy(data_, from, bytes(), cudaMemcpyHostToDevice);
  }
  /// Makes the first `count` values the whole array.
  void keep_first(std::size_t count) { count_ = count; }
  /// Sets all bytes to zero, on the stream of the pool in use or on another one.
  void clear() const { clear(work_stream()); }
  void clear(cudaStream_t stream) const {
    if (count_) PHYXEL_CUDA(cudaMemsetAsync(data_, 0, bytes(), stream));
  }
  void download(T* to) const { download(to, 0, count_); }
  void download(T* to, std::size_t first, std::size_t count) const {
    if (count) detail::copy(to, data_ + first, count * sizeof(T), cudaMemcpyDeviceToHost);
  }

 private:
  void swap(DeviceArray& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(count_, other.count_);
    std::swap(pool_, other.pool_);
  }
  T* data_ = nullptr;
  std::size_t count_ = 0;
  MemoryPool* pool_ = nullptr;  // null if the array has memory of its own
};

}  // namespace phyxel
