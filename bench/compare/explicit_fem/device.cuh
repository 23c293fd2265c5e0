/// Owners of the GPU's objects, and its errors.
#pragma once

#include <cuda_runtime.h>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace fem {

/// @throws std::runtime_error if a call failed
inline void check_cuda(cudaError_t error, const char* call) {
  if (error == cudaSuccess) return;
  throw std::runtime_error(std::string(call) + ": " + cudaGetErrorString(error) + " (" +
                           cudaGetErrorName(error) + ")");
}
#define FEM_CUDA(call) ::fem::check_cuda(call, #call)

/// An array in the memory of the GPU; null if it is empty.
template <class T>
class DeviceArray {
 public:
  DeviceArray() = default;
  explicit DeviceArray(std::size_t size) {
    if (size > 0) FEM_CUDA(cudaMalloc(&data_, size * sizeof(T)));
  }
  explicit DeviceArray(const std::vector<T>& values) : DeviceArray(values.size()) { copy(values); }
  DeviceArray(DeviceArray&& other) noexcept : data_(std::exchange(other.data_, nullptr)) {}
  DeviceArray& operator=(DeviceArray&& other) noexcept {
    std::swap(data_, other.data_);
    return *this;
  }
  ~DeviceArray() { cudaFree(data_); }

  T* data() const { return data_; }
  /// Overwrites the array by as many values.
  void copy(const std::vector<T>& values) {
    if (values.empty()) return;
    FEM_CUDA(cudaMemcpy(data_, values.data(), values.size() * sizeof(T), cudaMemcpyHostToDevice));
  }

 private:
  T* data_ = nullptr;
};

class Stream {
 public:
  Stream() { FEM_CUDA(cudaStreamCreate(&stream_)); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  ~Stream() { cudaStreamDestroy(stream_); }

  cudaStream_t get() const { return stream_; }
  void wait() const { FEM_CUDA(cudaStreamSynchronize(stream_)); }

 private:
  cudaStream_t stream_{};
};

/// A recording of launches on a stream, which outlives it.
class Graph {
 public:
  /// @param launch puts the launches on the stream
  template <class Launch>
  Graph(const Stream& stream, Launch&& launch) : stream_(stream) {
    cudaGraph_t graph;
    FEM_CUDA(cudaStreamBeginCapture(stream.get(), cudaStreamCaptureModeGlobal));
    launch();
    FEM_CUDA(cudaStreamEndCapture(stream.get(), &graph));
    FEM_CUDA(cudaGraphInstantiate(&graph_, graph, 0));
    cudaGraphDestroy(graph);
  }
  Graph(const Graph&) = delete;
  Graph& operator=(const Graph&) = delete;
  ~Graph() { cudaGraphExecDestroy(graph_); }

  void launch(int times = 1) const {
    for (int i = 0; i < times; ++i) FEM_CUDA(cudaGraphLaunch(graph_, stream_.get()));
  }

 private:
  const Stream& stream_;
  cudaGraphExec_t graph_{};
};

/// Measures time on a stream.
class Stopwatch {
 public:
  explicit Stopwatch(cudaStream_t stream) : stream_(stream) {
    FEM_CUDA(cudaEventCreate(&begin_));
    FEM_CUDA(cudaEventCreate(&end_));
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;
  ~Stopwatch() {
    cudaEventDestroy(begin_);
    cudaEventDestroy(end_);
  }

  void start() { FEM_CUDA(cudaEventRecord(begin_, stream_)); }
  /// Waits for the stream, and returns the time since `start` [s].
  double stop() {
    float milliseconds = 0;
    FEM_CUDA(cudaEventRecord(end_, stream_));
    FEM_CUDA(cudaEventSynchronize(end_));
    FEM_CUDA(cudaEventElapsedTime(&milliseconds, begin_, end_));
    return milliseconds * 1e-3;
  }

 private:
  cudaStream_t stream_;
  cudaEvent_t begin_{}, end_{};
};

}  // namespace fem
