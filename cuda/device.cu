/// Devices and the errors of CUDA calls.
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
  const bool pooled = PooledMemory::is_used();
  const cudaError_t error =
      pooled ? cudaMallocAsync(&data, bytes, cudaStreamLegacy) : cudaMalloc(&data, bytes);
  if (error == cudaErrorMemoryAllocation) {
    cudaGetLastError();
    std::size_t free = 0, total = 0;
    cudaMemGetInfo(&free, &total);
    throw DeviceError(current_device() + ": out of memory: " + what + " asks for " +
                      gigabytes(bytes) + ", " + gigabytes(free) + " of " + gigabytes(total) +
                      " are free");
  }
  check_cuda(error, pooled ? "cudaMallocAsync" : "cudaMalloc");
  return data;
}

void release(void* data, bool pooled) {
  if (pooled && data) {
    cudaFreeAsync(data, cudaStreamLegacy);
  } else {
    cudaFree(data);
  }
}

}  // namespace detail

namespace {
thread_local int pools = 0;  // `PooledMemory` in use
}

PooledMemory::PooledMemory() {
  int device = 0, has_pools = 0;
  PHYXEL_CUDA(cudaGetDevice(&device));
  PHYXEL_CUDA(cudaDeviceGetAttribute(&has_pools, cudaDevAttrMemoryPoolsSupported, device));
  is_here_ = has_pools != 0;
  if (!is_here_) return;
  cudaMemPool_t pool = nullptr;
  std::uint64_t kept = UINT64_MAX;
  PHYXEL_CUDA(cudaDeviceGetDefaultMemPool(&pool, device));
  PHYXEL_CUDA(cudaMemPoolSetAttribute(pool, cudaMemPoolAttrReleaseThreshold, &kept));
  ++pools;
}

PooledMemory::~PooledMemory() { pools -= is_here_ ? 1 : 0; }

bool PooledMemory::is_used() { return pools > 0; }

void PooledMemory::give_back() noexcept {
  int device = 0;
  cudaMemPool_t pool = nullptr;
  if (cudaGetDevice(&device) != cudaSuccess ||
      cudaDeviceGetDefaultMemPool(&pool, device) != cudaSuccess) {
    return;  // a device without pools keeps nothing
  }
  cudaDeviceSynchronize();
  cudaMemPoolTrimTo(pool, 0);
}

}  // namespace phyxel
