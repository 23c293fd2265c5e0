/// The halo exchange with records that kernels pack and unpack.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <utility>

#include "solver/packed_transports.cuh"

namespace phyxel::cuda {

template <class Records>
__global__ void pack(const __grid_constant__ Records records, const Index* place, int count,
                     typename Records::Value* packed) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k < count) packed[k] = records.get(static_cast<std::size_t>(place[k]));
}
template <class Records>
__global__ void unpack(const __grid_constant__ Records records, const Index* place, int count,
                       const typename Records::Value* packed) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k < count) records.set(static_cast<std::size_t>(place[k]), packed[k]);
}

/// Packs the records of a share for its peers, and unpacks those of ghosts.
template <class Model>
class PackedExchange {
 public:
  PackedExchange(const Model& model, const PeerLists& send, const PeerLists& receive)
      : m_(model),
        send_(send),
        receive_(receive),
        transport_(std::make_unique<HostTransport>(*model.share()->transport, send, receive)) {}

  /// Sets the transport. Call between exchanges.
  void send_by(std::unique_ptr<PackedTransport> transport) {
    transport_ = std::move(transport);
    bytes_each_ = 0;
  }
  template <class Records>
  void begin(const Records& records) {
    using Value = typename Records::Value;
    reserve(sizeof(Value));
    m_.launch_each("pack", pack<Records>, send_.count(), records, send_.on_device.data(),
                   send_.count(), reinterpret_cast<Value*>(packed_.data()));
    // The transport has a stream of its own, which begins after all records have been packed.
    PHYXEL_CUDA(cudaEventRecord(packed_now_.get(), m_.stream()));
    PHYXEL_CUDA(cudaStreamWaitEvent(transport_->queue(), packed_now_.get()));
    transport_->begin(packed_.data(), arrived_.data(), sizeof(Value));
  }
  template <class Records>
  void finish(const Records& records) {
    using Value = typename Records::Value;
    transport_->finish(arrived_.data(), sizeof(Value));
    PHYXEL_CUDA(cudaEventRecord(arrived_now_.get(), transport_->queue()));
    PHYXEL_CUDA(cudaStreamWaitEvent(m_.stream(), arrived_now_.get()));
    m_.launch_each("unpack", unpack<Records>, receive_.count(), records, receive_.on_device.data(),
                   receive_.count(), reinterpret_cast<const Value*>(arrived_.data()));
  }
  std::string describe() const { return transport_->describe(); }
  std::size_t bytes() const { return packed_.bytes() + arrived_.bytes(); }

 private:
  /// Allocates the buffers. Call between exchanges.
  void reserve(std::size_t bytes_each) {
    if (bytes_each <= bytes_each_) return;
    m_.wait();
    bytes_each_ = bytes_each;
    packed_ = {send_.places.size() * bytes_each, "what other ranks get"};
    arrived_ = {receive_.places.size() * bytes_each, "what other ranks send"};
    transport_->reserve(packed_.size(), arrived_.size());
  }

  const Model& m_;
  const PeerLists &send_, &receive_;
  std::unique_ptr<PackedTransport> transport_;
  std::size_t bytes_each_ = 0;
  DeviceArray<std::byte> packed_, arrived_;
  Event packed_now_, arrived_now_;
};

}  // namespace phyxel::cuda
