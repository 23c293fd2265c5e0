/// Transports of packed records between ranks: MPI from host memory, CUDA-aware MPI, and NCCL.
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "check.hpp"
#include "phyxel/share.hpp"
#include "setup/primitives.cuh"
#include "solver/nccl.hpp"
#include "solver/stream.cuh"

namespace phyxel::cuda {

/// Page-locked host memory, which copies to and from the device need not stage.
class PinnedBytes {
 public:
  PinnedBytes() = default;
  PinnedBytes(const PinnedBytes&) = delete;
  PinnedBytes& operator=(const PinnedBytes&) = delete;
  ~PinnedBytes() { release(); }
  std::byte* data() const { return data_; }
  void reserve(std::size_t bytes) {
    if (bytes <= size_) return;
    release();
    void* memory = nullptr;
    PHYXEL_CUDA(cudaMallocHost(&memory, bytes));
    data_ = static_cast<std::byte*>(memory);
    size_ = bytes;
  }

 private:
  void release() {
    if (data_) cudaFreeHost(std::exchange(data_, nullptr));
    size_ = 0;
  }
  std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

/// The tile slots of each peer's records, one peer after the other.
class PeerLists {
 public:
  PeerLists(const std::vector<HaloPlan::Peer>& peers, std::vector<Index> HaloPlan::Peer::*list,
            const std::vector<Index>& place_of) {
    for (const HaloPlan::Peer& peer : peers) {
      for (const Index i : peer.*list) places.push_back(place_of[i]);
      counts.push_back((peer.*list).size());
    }
    on_device = sent(places, "places that ranks exchange");
  }
  int count() const { return static_cast<int>(places.size()); }
  /// The bytes of each peer in `memory`.
  HaloTransport::PeerBytes in(std::byte* memory, std::size_t bytes_each) const {
    HaloTransport::PeerBytes bytes;
    for (const std::size_t count : counts) {
      bytes.emplace_back(memory, count * bytes_each);
      memory += count * bytes_each;
    }
    return bytes;
  }

  std::vector<Index> places;
  std::vector<std::size_t> counts;
  DeviceArray<Index> on_device;
};

/// Exchanges packed records with other ranks, in a stream of its own.
class PackedTransport {
 public:
  virtual ~PackedTransport() = default;
  virtual void reserve(std::size_t outgoing, std::size_t incoming) = 0;
  /// Starts an exchange. @param bytes_each size of a record [bytes]
  virtual void begin(std::byte* packed, std::byte* arrived, std::size_t bytes_each) = 0;
  /// Makes work queued from now on see `arrived` filled.
  virtual void finish(std::byte* arrived, std::size_t bytes_each) = 0;
  virtual std::string describe() const = 0;
  cudaStream_t queue() const { return queue_.get(); }

 private:
  Stream queue_;
};

/// Transport by MPI through host memory.
class HostTransport final : public PackedTransport {
 public:
  HostTransport(HaloTransport& halo, const PeerLists& send, const PeerLists& receive)
      : halo_(halo), send_(send), receive_(receive) {}

  void reserve(std::size_t outgoing, std::size_t incoming) override {
    outgoing_.reserve(outgoing);
    incoming_.reserve(incoming);
  }
  void begin(std::byte* packed, std::byte*, std::size_t bytes_each) override {
    copy(outgoing_.data(), packed, send_.places.size() * bytes_each, cudaMemcpyDeviceToHost);
  }
  void finish(std::byte* arrived, std::size_t bytes_each) override {
    PHYXEL_CUDA(cudaStreamSynchronize(queue()));
    halo_.start(send_.in(outgoing_.data(), bytes_each), receive_.in(incoming_.data(), bytes_each));
    halo_.finish();
    copy(arrived, incoming_.data(), receive_.places.size() * bytes_each, cudaMemcpyHostToDevice);
  }
  std::string describe() const override { return "host memory and MPI"; }

 private:
  void copy(std::byte* to, const std::byte* from, std::size_t bytes, cudaMemcpyKind kind) const {
    if (bytes > 0) PHYXEL_CUDA(cudaMemcpyAsync(to, from, bytes, kind, queue()));
  }

  HaloTransport& halo_;
  const PeerLists &send_, &receive_;
  PinnedBytes outgoing_, incoming_;
};

/// Transport by CUDA-aware MPI, from device memory.
class MpiTransport final : public PackedTransport {
 public:
  MpiTransport(HaloTransport& halo, const PeerLists& send, const PeerLists& receive)
      : halo_(halo), send_(send), receive_(receive) {}

  void reserve(std::size_t, std::size_t) override {}
  void begin(std::byte* packed, std::byte*, std::size_t) override { packed_ = packed; }
  void finish(std::byte* arrived, std::size_t bytes_each) override {
    PHYXEL_CUDA(cudaStreamSynchronize(queue()));
    halo_.start(send_.in(packed_, bytes_each), receive_.in(arrived, bytes_each));
    halo_.finish();
  }
  std::string describe() const override { return "CUDA-aware MPI"; }

 private:
  HaloTransport& halo_;
  const PeerLists &send_, &receive_;
  std::byte* packed_ = nullptr;
};

/// Transport by NCCL; the host only queues.
class NcclTransport final : public PackedTransport {
 public:
  /// Connects the ranks. Collective. @throws DeviceError
  NcclTransport(const Share& share, const NcclRanks::Name& name, const PeerLists& send,
                const PeerLists& receive)
      : plan_(*share.halo),
        ranks_(name, share.communicator->rank(), share.communicator->size()),
        send_(send),
        receive_(receive) {}

  void reserve(std::size_t, std::size_t) override {}
  void begin(std::byte* packed, std::byte* arrived, std::size_t bytes_each) override {
    ranks_.exchange(messages(send_.in(packed, bytes_each)),
                    messages(receive_.in(arrived, bytes_each)), queue());
  }
  void finish(std::byte*, std::size_t) override {}
  std::string describe() const override { return "NCCL " + nccl_version(); }

 private:
  std::vector<NcclRanks::Message> messages(const HaloTransport::PeerBytes& of_peers) const {
    std::vector<NcclRanks::Message> messages;
    for (std::size_t p = 0; p < of_peers.size(); ++p) {
      messages.push_back({plan_.peers[p].rank, of_peers[p]});
    }
    return messages;
  }

  const HaloPlan& plan_;
  NcclRanks ranks_;
  const PeerLists &send_, &receive_;
};

}  // namespace phyxel::cuda
