/// Arrays in host memory that a device copies from and to without a stop between.
#pragma once

#include <cstddef>
#include <span>
#include <utility>

#include "check.hpp"

namespace phyxel {

/// An array in pinned host memory, initially undefined. Values must not change while a copy of them
/// is in progress.
template <class T>
class PinnedArray {
 public:
  PinnedArray() = default;
  PinnedArray(const PinnedArray&) = delete;
  PinnedArray& operator=(const PinnedArray&) = delete;
  ~PinnedArray() { cudaFreeHost(data_); }

  T* data() const { return data_; }
  std::size_t size() const { return size_; }
  std::span<const T> values() const { return {data_, size_}; }
  const T& operator[](std::size_t k) const { return data_[k]; }

  /// Sets the size. Values are lost if the array has not had that size before.
  void resize(std::size_t size) {
    size_ = size;
    if (size <= capacity_) return;
    cudaFreeHost(std::exchange(data_, nullptr));
    capacity_ = 0;
    const std::size_t room = size + size / 4;
    void* memory = nullptr;
    PHYXEL_CUDA(cudaMallocHost(&memory, room * sizeof(T)));
    data_ = static_cast<T*>(memory);
    capacity_ = room;
  }

  /// Begins to copy the values of a device array on a stream.
  void begin_fetch(const DeviceArray<T>& from, cudaStream_t stream) {
    resize(from.size());
    if (size_ == 0) return;
    PHYXEL_CUDA(cudaMemcpyAsync(data_, from.data(), from.bytes(), cudaMemcpyDeviceToHost, stream));
  }
  /// Copies the values of a device array on a stream, and waits for them.
  void fetch(const DeviceArray<T>& from, cudaStream_t stream) {
    begin_fetch(from, stream);
    if (size_ > 0) PHYXEL_CUDA(cudaStreamSynchronize(stream));
  }
  /// Begins to copy the values to a device array of the same size.
  void send(const DeviceArray<T>& to, cudaStream_t stream) const {
    if (size_ == 0) return;
    PHYXEL_CUDA(cudaMemcpyAsync(to.data(), data_, to.bytes(), cudaMemcpyHostToDevice, stream));
  }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace phyxel
