/// Devices, their memory, and the errors of CUDA calls.
#include <algorithm>
#include <bit>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "check.hpp"
#include "device.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

constexpr const char* sync_hint = "; PHYXEL_CUDA_SYNC=1 in the environment tells which one failed";

/// A kernel for the query whether the device can run this program.
__global__ void probe() {}

std::string version_text(int version) {
  return std::to_string(version / 1000) + "." + std::to_string(version % 1000 / 10);
}

std::string gigabytes(std::size_t bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g GB", static_cast<double>(bytes) * 1e-9);
  return text;
}

std::string reason(cudaError_t error) {
  return std::string(cudaGetErrorString(error)) + " (" + cudaGetErrorName(error) + ")";
}

Device describe_device(int index) {
  cudaDeviceProp p{};
  PHYXEL_CUDA(cudaGetDeviceProperties(&p, index));
  return {index, p.name, p.major, p.minor, p.multiProcessorCount, p.totalGlobalMem};
}

std::string current_device() {
  int index = 0;
  cudaDeviceProp p{};
  if (cudaGetDevice(&index) != cudaSuccess || cudaGetDeviceProperties(&p, index) != cudaSuccess) {
    return "the GPU";
  }
  return "GPU " + std::to_string(index) + ", " + p.name;
}

/// The reason why there are no devices; "" if there are some.
std::string why_no_device(int* count) {
  const cudaError_t error = cudaGetDeviceCount(count);
  if (error == cudaSuccess && *count > 0) return "";
  if (error == cudaErrorInsufficientDriver) {
    int driver = 0;
    cudaDriverGetVersion(&driver);
    if (driver == 0) return "no NVIDIA driver is loaded on this machine";
    return "the NVIDIA driver supports CUDA " + version_text(driver) +
           ", this program needs CUDA " + version_text(CUDART_VERSION) +
           ": a newer driver, or a build with an older toolkit";
  }
  if (error == cudaSuccess || error == cudaErrorNoDevice) {
    const char* visible = std::getenv("CUDA_VISIBLE_DEVICES");
    return "no CUDA device was found" +
           (visible ? " (CUDA_VISIBLE_DEVICES is \"" + std::string(visible) + "\")"
                    : std::string());
  }
  return "the CUDA devices could not be listed: " + reason(error);
}

}  // namespace

std::vector<Device> cuda_devices(std::string* why) {
  int count = 0;
  const std::string none = why_no_device(&count);
  if (why) *why = none;
  std::vector<Device> devices;
  if (!none.empty()) return devices;
  for (int i = 0; i < count; ++i) devices.push_back(describe_device(i));
  return devices;
}

Device use_cuda_device(int index) {
  std::string why;
  const std::vector<Device> devices = cuda_devices(&why);
  if (devices.empty()) throw DeviceError(why + "; allowed: the CPU");
  if (index < 0 || index >= static_cast<int>(devices.size())) {
    throw DeviceError("CUDA device " + std::to_string(index) + ": there is none; allowed 0 to " +
                      std::to_string(devices.size() - 1));
  }
  PHYXEL_CUDA(cudaSetDevice(index));
  cudaFuncAttributes attributes{};
  const cudaError_t error = cudaFuncGetAttributes(&attributes, probe);
  if (error == cudaErrorNoKernelImageForDevice || error == cudaErrorInvalidDeviceFunction) {
    cudaGetLastError();  // clears the error, which is the answer of the query
    throw DeviceError("this program holds no kernels for " + devices[index].describe() +
                      ", only for the architectures " PHYXEL_CUDA_ARCHITECTURES
                      ": build it with -DCMAKE_CUDA_ARCHITECTURES=" +
                      std::to_string(devices[index].major * 10 + devices[index].minor));
  }
  check_cuda(error, "cudaFuncGetAttributes");
  return devices[index];
}

bool cuda_peers(int from, int to) {
  int can = 0;
  PHYXEL_CUDA(cudaDeviceCanAccessPeer(&can, from, to));
  return can != 0;
}

std::size_t cuda_free_memory() {
  std::size_t free = 0, total = 0;
  PHYXEL_CUDA(cudaMemGetInfo(&free, &total));
  return free;
}

std::size_t cuda_measured_allocation(std::size_t bytes, const std::string& what) {
  const std::size_t before = cuda_free_memory();
  const DeviceArray<char> array(bytes, what);
  return before - cuda_free_memory();
}

double cuda_copy_bandwidth() {
  const std::size_t bytes = std::min(std::size_t{1} << 30, cuda_free_memory() / 4);
  const DeviceArray<char> from(bytes, "a copy"), to(bytes, "a copy");
  cudaEvent_t start, end;
  PHYXEL_CUDA(cudaEventCreate(&start));
  PHYXEL_CUDA(cudaEventCreate(&end));
  PHYXEL_CUDA(cudaMemset(from.data(), 0, bytes));
  float best = HUGE_VALF;
  for (int repeat = 0; repeat < 5; ++repeat) {
    PHYXEL_CUDA(cudaEventRecord(start));
    PHYXEL_CUDA(cudaMemcpyAsync(to.data(), from.data(), bytes, cudaMemcpyDeviceToDevice));
    PHYXEL_CUDA(cudaEventRecord(end));
    PHYXEL_CUDA(cudaEventSynchronize(end));
    float milliseconds = 0;
    PHYXEL_CUDA(cudaEventElapsedTime(&milliseconds, start, end));
    best = std::min(best, milliseconds);
  }
  cudaEventDestroy(start);
  cudaEventDestroy(end);
  return 2e3 * static_cast<double>(bytes) / best;
}

std::string cuda_version() {
  int driver = 0;
  cudaDriverGetVersion(&driver);
  return "CUDA " + version_text(CUDART_VERSION) + ", " +
         (driver ? "driver for " + version_text(driver) : std::string("no driver"));
}

void check_cuda(cudaError_t error, const char* call) {
  if (error == cudaSuccess) return;
  cudaGetLastError();
  throw DeviceError(current_device() + ": " + call + " failed: " + reason(error));
}

std::string Launch::describe() const {
  return std::string(kernel) + "<<<" + std::to_string(blocks) + ", " + std::to_string(threads) +
         ">>> (" + subject + ")";
}

void check_launch(const Launch& launch) {
  cudaError_t error = cudaGetLastError();
  if (error != cudaSuccess) {
    // A refused launch leaves the device usable; a fault in an earlier kernel does not, and shows
    // at a later call.
    if (const cudaError_t earlier = cudaDeviceSynchronize()) {
      throw DeviceError(current_device() + ": a kernel launched before " + launch.describe() +
                        " failed: " + reason(earlier) + sync_hint);
    }
    throw DeviceError(current_device() + ": " + launch.describe() +
                      " could not be launched: " + reason(error));
  }
  if (!launches_are_waited_for()) return;
  error = cudaDeviceSynchronize();
  if (error != cudaSuccess) {
    throw DeviceError(current_device() + ": " + launch.describe() + " failed: " + reason(error));
  }
}

bool launches_are_waited_for() {
  static const bool wait = [] {
    const char* value = std::getenv("PHYXEL_CUDA_SYNC");
    return value && std::strcmp(value, "0") != 0;
  }();
  return wait;
}

void wait_for_device(const Launch& last) {
  const cudaError_t error = cudaDeviceSynchronize();
  if (error == cudaSuccess) return;
  throw DeviceError(current_device() + ": a kernel failed: " + reason(error) +
                    "; the last launch was " + last.describe() + sync_hint);
}

namespace detail {

void* allocate(std::size_t bytes, const std::string& what) {
  if (bytes == 0) return nullptr;
  void* data = nullptr;
  const cudaError_t error = cudaMalloc(&data, bytes);
  if (error == cudaErrorMemoryAllocation) {
    cudaGetLastError();
    std::size_t free = 0, total = 0;
    cudaMemGetInfo(&free, &total);
    throw DeviceMemoryError(current_device() + ": out of memory: " + what + " asks for " +
                            gigabytes(bytes) + ", " + gigabytes(free) + " of " + gigabytes(total) +
                            " are free");
  }
  check_cuda(error, "cudaMalloc");
  return data;
}

void copy(void* to, const void* from, std::size_t bytes, cudaMemcpyKind kind) {
  const cudaStream_t stream = work_stream();
  if (!stream) {
    PHYXEL_CUDA(cudaMemcpy(to, from, bytes, kind));
    return;
  }
  PHYXEL_CUDA(cudaMemcpyAsync(to, from, bytes, kind, stream));
  PHYXEL_CUDA(cudaStreamSynchronize(stream));
}

}  // namespace detail

namespace {

thread_local MemoryPool* pool_in_use = nullptr;

/// The size of a block for an array: one of four in each octave, so that arrays whose sizes differ
/// a little from round to round get the same blocks.
std::size_t block_size(std::size_t bytes) {
  constexpr std::size_t least = 512;
  if (bytes <= least) return least;
  const std::size_t quarter = std::bit_ceil(bytes) / 8;
  return (bytes + quarter - 1) / quarter * quarter;
}

}  // namespace

MemoryPool::~MemoryPool() { free_blocks_before(round_ + 1); }

void* MemoryPool::take(std::size_t bytes, const std::string& what) {
  if (bytes == 0) return nullptr;
  const std::size_t size = block_size(bytes);
  void* data = nullptr;
  if (std::vector<Block>& blocks = idle_[size]; !blocks.empty()) {
    data = blocks.back().data;
    blocks.pop_back();
  } else {
    try {
      data = detail::allocate(size, what);
    } catch (const DeviceError&) {
      free_blocks_before(round_ + 1);
      data = detail::allocate(size, what);
    }
  }
  in_arrays_[data] = size;
  return data;
}

void MemoryPool::give_back(void* data) noexcept {
  const auto block = in_arrays_.find(data);
  idle_[block->second].push_back({data, round_});
  in_arrays_.erase(block);
}

void MemoryPool::begin_round() {
  constexpr std::int64_t kept_rounds = 32;
  free_blocks_before(++round_ - kept_rounds);
}

std::size_t MemoryPool::idle_blocks() const {
  std::size_t count = 0;
  for (const auto& [size, blocks] : idle_) count += blocks.size();
  return count;
}

std::size_t MemoryPool::idle_bytes() const {
  std::size_t bytes = 0;
  for (const auto& [size, blocks] : idle_) bytes += size * blocks.size();
  return bytes;
}

// Blocks are taken from the back of a list, so that those at its front have been idle for long.
// Freeing waits for the kernels that use a block.
void MemoryPool::free_blocks_before(std::int64_t round) {
  for (auto& [size, blocks] : idle_) {
    const auto end = std::find_if(blocks.begin(), blocks.end(),
                                  [&](const Block& block) { return block.round >= round; });
    std::for_each(blocks.begin(), end, [](const Block& block) { cudaFree(block.data); });
    blocks.erase(blocks.begin(), end);
  }
}

PooledMemory::PooledMemory(MemoryPool& pool) : before_(std::exchange(pool_in_use, &pool)) {}

PooledMemory::~PooledMemory() { pool_in_use = before_; }

MemoryPool* PooledMemory::used() { return pool_in_use; }

}  // namespace phyxel
