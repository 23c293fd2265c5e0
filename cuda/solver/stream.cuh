/// CUDA streams and events with RAII.
#pragma once

#include "check.hpp"

namespace phyxel::cuda {

/// The stream of a model's launches. It synchronises with CUDA's default stream, which copies use.
class Stream {
 public:
  Stream() { PHYXEL_CUDA(cudaStreamCreate(&stream_)); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  ~Stream() { cudaStreamDestroy(stream_); }
  cudaStream_t get() const { return stream_; }

 private:
  cudaStream_t stream_ = nullptr;
};

/// A CUDA event: a point in a stream that the host or another stream can wait for.
class Event {
 public:
  Event() { PHYXEL_CUDA(cudaEventCreateWithFlags(&event_, cudaEventDisableTiming)); }
  Event(const Event&) = delete;
  Event& operator=(const Event&) = delete;
  ~Event() { cudaEventDestroy(event_); }
  cudaEvent_t get() const { return event_; }

 private:
  cudaEvent_t event_ = nullptr;
};

}  // namespace phyxel::cuda
