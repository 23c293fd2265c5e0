/// CUDA calls that fail become a DeviceError which says what was asked.
#pragma once

#include <cuda_runtime_api.h>

#include <cstddef>
#include <string>
#include <utility>

namespace phyxel {

/// @throws DeviceError naming `call` and the device.
void check_cuda(cudaError_t error, const char* call);
#define PHYXEL_CUDA(call) ::phyxel::check_cuda(call, #call)

/// One kernel launch, for messages.
struct Launch {
  const char* kernel = "no kernel yet";
  unsigned blocks = 0, threads = 0;
  std::string subject;  ///< e.g. "body \"dino\", 575 phyxels".
  std::string describe() const;
};

/// To be called right after a launch: what CUDA refuses at once. With PHYXEL_CUDA_SYNC=1 in the
/// environment it waits for the kernel, so that a fault inside names its own launch.
/// @throws DeviceError
void check_launch(const Launch& launch);
/// Whether `check_launch` waits, which launches that are only recorded do not survive.
bool launches_are_waited_for();

/// Waits for everything launched. @throws DeviceError naming the last launch.
void wait_for_device(const Launch& last);

namespace detail {
/// Never returns nullptr for `bytes` > 0. @throws DeviceError: how much was asked for what, how
/// much there is.
void* allocate(std::size_t bytes, const std::string& what);
}  // namespace detail

/// Device memory that is freed with its owner. Contents start undefined.
template <class T>
class DeviceArray {
 public:
  DeviceArray() = default;
  /// @param what for the message when memory runs out, e.g. "the force matrix (575 x 575)".
  DeviceArray(std::size_t count, const std::string& what)
      : data_(static_cast<T*>(detail::allocate(count * sizeof(T), what))), count_(count) {}
  DeviceArray(DeviceArray&& other) noexcept { swap(other); }
  DeviceArray& operator=(DeviceArray&& other) noexcept {
    DeviceArray(std::move(other)).swap(*this);
    return *this;
  }
  ~DeviceArray() { cudaFree(data_); }

  T* data() const { return data_; }
  std::size_t size() const { return count_; }
  std::size_t bytes() const { return count_ * sizeof(T); }

  /// `from` holds size() values.
  void upload(const T* from) const {
    if (count_) PHYXEL_CUDA(cudaMemcpy(data_, from, bytes(), cudaMemcpyHostToDevice));
  }
  /// All bits zero.
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
  }
  T* data_ = nullptr;
  std::size_t count_ = 0;
};

}  // namespace phyxel
