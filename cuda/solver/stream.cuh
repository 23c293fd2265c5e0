/// CUDA's streams and events, which end with their owners.
#pragma once

#include "check.hpp"

namespace phyxel::cuda {

/// The queue of a model's launches. It waits for what goes through CUDA's default queue, copies
/// above all, and that waits for it.
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

/// A point in a queue of launches that can be waited for.
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
