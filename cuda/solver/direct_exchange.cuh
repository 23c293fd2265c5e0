/// Exchanges by stores into the memory of other ranks' GPUs, which CUDA IPC opens.
#pragma once

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "solver/device_model.cuh"
#include "solver/fused_halo.cuh"
#include "solver/packed_transports.cuh"

namespace phyxel::cuda {

/// Memory of another rank, opened by CUDA IPC.
class OpenedMemory {
 public:
  explicit OpenedMemory(const cudaIpcMemHandle_t& handle) {
    PHYXEL_CUDA(cudaIpcOpenMemHandle(&data_, handle, cudaIpcMemLazyEnablePeerAccess));
  }
  OpenedMemory(OpenedMemory&& other) noexcept : data_(std::exchange(other.data_, nullptr)) {}
  OpenedMemory& operator=(OpenedMemory&&) = delete;
  ~OpenedMemory() {
    if (data_) cudaIpcCloseMemHandle(data_);
  }
  void* data() const { return data_; }

 private:
  void* data_ = nullptr;
};

/// Exchanges by stores into the memory of other ranks' GPUs.
template <class Real, class StateReal>
class DirectExchange {
  using Model = DeviceModel<Real, StateReal>;

 public:
  /// Collective. @throws DeviceError if memory cannot be shared or opened; on this rank alone, and
  /// after all collective calls
  DirectExchange(const Model& model, const PeerLists& receive) : m_(model) {
    const std::size_t count = m_.share()->halo->peers.size();
    std::vector<std::vector<std::byte>> words(count);
    std::string trouble;
    try {
      make_flags(count);
      words = invitations(receive, count);
    } catch (const DeviceError& error) {
      trouble = error.what();
    }
    const std::vector<std::vector<std::byte>> received = exchanged_with_peers(std::move(words));
    if (!trouble.empty()) throw DeviceError(trouble);
    open(received);
  }

  void begin(Sent what) const {
    if (what == Sent::displacements) {
      store(m_.fields().points, points_.data(), what);
    } else if (m_.closed()) {
      store(m_.closed_stresses(), closed_stresses_.data(), what);
    } else {
      store(m_.fields().stresses, stresses_.data(), what);
    }
  }
  void finish(Sent what) const {
    if (signals_[0].peers == 0) return;
    wait_for_peers<<<1, warp_size, 0, m_.stream()>>>(signals_[static_cast<int>(what)]);
    m_.launched("wait_for_peers", 1, warp_size);
  }
  /// The halo exchange inside pass 1, if passes do the exchange (`can_fuse`).
  /// @tparam Records the records to send: `Stresses`, or `ClosedStresses` with closed gradients
  template <class Records>
  FusedHalo<Records> of_pass_1(bool waits) const {
    if constexpr (std::is_same_v<Records, ClosedStresses<Real>>) {
      return fused(Sent::displacements, Sent::stresses, m_.closed_stresses(), closed_stresses_,
                   waits);
    } else {
      return fused(Sent::displacements, Sent::stresses, m_.fields().stresses, stresses_, waits);
    }
  }
  /// The halo exchange inside pass 2.
  FusedHalo<Points<Real>> of_pass_2(bool waits) const {
    return fused(Sent::stresses, Sent::displacements, m_.fields().points, points_, waits);
  }
  /// True if a pass can do the exchange: it must have a block that signals the peers, and its
  /// waiting blocks must not keep another rank's kernels from running, which they may where MPS
  /// runs kernels of several ranks on one GPU at once.
  bool can_fuse() const {
    int shared_at_once = 0;
    PHYXEL_CUDA(cudaDeviceGetAttribute(&shared_at_once, cudaDevAttrMpsEnabled, m_.device().index));
    return m_.boundary_tiles() > 0 && shared_at_once == 0;
  }
  /// Closes the memory of other ranks, which they may free once all ranks have called this.
  void close() { opened_.clear(); }
  double waited_seconds() const {
    m_.wait();
    double sum = 0;
    for (const unsigned long long ns : fetched(waited_)) sum += 1e-9 * static_cast<double>(ns);
    return sum;
  }
  std::size_t bytes() const {
    return flags_.bytes() + counters_.bytes() + copies_.bytes() + points_.bytes() +
           stresses_.bytes() + closed_stresses_.bytes() + first_.bytes();
  }

 private:
  template <class Records>
  FusedHalo<Records> fused(Sent awaited, Sent told, const Records& own,
                           const DeviceArray<Records>& peers, bool waits) const {
    return {signals_[static_cast<int>(awaited)],
            signals_[static_cast<int>(told)],
            m_.boundary_tiles(),
            first_.data(),
            copies_.data(),
            own,
            peers.data(),
            waits};
  }
  /// Data that a peer needs to store records here. The tile slots of these records follow it.
  struct Invitation {
    cudaIpcMemHandle_t points, stresses, closing_stresses, flags;  ///< Third: if closed.
    std::uint64_t places;
    std::int32_t flag, of_flags;  ///< Index of the peer's flag within a kind, and flags per kind.
  };

  void make_flags(std::size_t count) {
    // CUDA shares memory by whole pages.
    flags_ = {shared_page / sizeof(unsigned) + kinds_sent * count, "flags of ranks"};
    counters_ = {3 * kinds_sent, "counts of exchanges"};
    waited_ = {kinds_sent, "waiting times"};
    flags_.clear();
    counters_.clear();
    waited_.clear();
    PHYXEL_CUDA(cudaDeviceSynchronize());  // before any peer raises a flag
  }
  std::vector<std::vector<std::byte>> invitations(const PeerLists& receive,
                                                  std::size_t count) const {
    std::vector<std::vector<std::byte>> words(count);
    std::size_t first = 0;
    for (std::size_t p = 0; p < count; ++p) {
      Invitation invitation{};
      PHYXEL_CUDA(cudaIpcGetMemHandle(&invitation.points, m_.points_memory()));
      PHYXEL_CUDA(cudaIpcGetMemHandle(&invitation.stresses, m_.stresses_memory()));
      if (m_.closed()) {
        PHYXEL_CUDA(
            cudaIpcGetMemHandle(&invitation.closing_stresses, m_.closing_stresses_memory()));
      }
      PHYXEL_CUDA(cudaIpcGetMemHandle(&invitation.flags, flags_.data()));
      invitation.places = m_.places();
      invitation.flag = static_cast<std::int32_t>(p);
      invitation.of_flags = static_cast<std::int32_t>(count);
      const std::size_t places = receive.counts[p] * sizeof(Index);
      words[p].resize(sizeof(Invitation) + places);
      std::memcpy(words[p].data(), &invitation, sizeof(Invitation));
      if (places) std::memcpy(words[p].data() + sizeof(Invitation), &receive.places[first], places);
      first += receive.counts[p];
    }
    return words;
  }
  /// Sends words[p] to peer p. @returns the bytes received from each peer
  std::vector<std::vector<std::byte>> exchanged_with_peers(
      std::vector<std::vector<std::byte>> words) const {
    const std::vector<HaloPlan::Peer>& peers = m_.share()->halo->peers;
    const Communicator& ranks = *m_.share()->communicator;
    std::vector<std::vector<std::byte>> of_ranks(static_cast<std::size_t>(ranks.size()));
    for (std::size_t p = 0; p < peers.size(); ++p) of_ranks[peers[p].rank] = std::move(words[p]);
    of_ranks = ranks.alltoallv(of_ranks);
    for (std::size_t p = 0; p < peers.size(); ++p) words[p] = std::move(of_ranks[peers[p].rank]);
    return words;
  }
  void open(const std::vector<std::vector<std::byte>>& received) {
    const std::vector<HaloPlan::Peer>& peers = m_.share()->halo->peers;
    std::vector<Points<Real>> points;
    std::vector<Stresses<Real>> stresses;
    std::vector<ClosedStresses<Real>> closed_stresses;
    std::vector<unsigned*> their_flags[kinds_sent];
    std::vector<RemoteCopy> copies;
    for (std::size_t p = 0; p < peers.size(); ++p) {
      if (received[p].size() < sizeof(Invitation)) {
        throw DeviceError("rank " + std::to_string(peers[p].rank) + " cannot share its memory");
      }
      Invitation invitation;
      std::memcpy(&invitation, received[p].data(), sizeof(Invitation));
      std::vector<Index> there(peers[p].send.size());
      if (!there.empty()) {
        std::memcpy(there.data(), received[p].data() + sizeof(Invitation),
                    there.size() * sizeof(Index));
      }
      for (std::size_t k = 0; k < there.size(); ++k) {
        copies.push_back({m_.tiling().place[peers[p].send[k]], there[k], static_cast<int>(p)});
      }
      const auto opened = [&](const cudaIpcMemHandle_t& handle) {
        return opened_.emplace_back(handle).data();
      };
      const auto places = static_cast<std::size_t>(invitation.places);
      points.push_back(Points<Real>::in(opened(invitation.points), places));
      stresses.push_back(Stresses<Real>::in(opened(invitation.stresses), places));
      if (m_.closed()) {
        closed_stresses.push_back(
            {stresses.back(),
             ClosingStresses<Real>::in(opened(invitation.closing_stresses), places)});
      }
      auto* at = static_cast<unsigned*>(opened(invitation.flags));
      for (int kind = 0; kind < kinds_sent; ++kind) {
        their_flags[kind].push_back(at + kind * invitation.of_flags + invitation.flag);
      }
    }
    points_ = sent(points, "peers");
    stresses_ = sent(stresses, "peers");
    closed_stresses_ = sent(closed_stresses, "peers");
    put_copies(std::move(copies));
    for (int kind = 0; kind < kinds_sent; ++kind) {
      their_flags_[kind] = sent(their_flags[kind], "peers");
      unsigned* const counter = counters_.data() + 3 * kind;
      signals_[kind] = {their_flags_[kind].data(),
                        flags_.data() + static_cast<std::size_t>(kind) * peers.size(),
                        static_cast<int>(peers.size()),
                        counter,
                        counter + 1,
                        counter + 2,
                        waited_.data() + kind};
    }
  }
  /// Stores the copies in the order of tile slots, so that those of a tile are contiguous.
  void put_copies(std::vector<RemoteCopy> copies) {
    std::stable_sort(copies.begin(), copies.end(),
                     [](const RemoteCopy& a, const RemoteCopy& b) { return a.here < b.here; });
    std::vector<Index> first;
    std::size_t k = 0;
    for (Index tile = 0; tile <= m_.boundary_tiles(); ++tile) {
      while (k < copies.size() && copies[k].here < tile * tile_size) ++k;
      first.push_back(static_cast<Index>(k));
    }
    first_ = sent(first, "what other ranks get");
    copies_ = sent(copies, "what other ranks get");
  }
  template <class Records>
  void store(const Records& own, const Records* peers, Sent what) const {
    const Signals& signals = signals_[static_cast<int>(what)];
    if (signals.peers == 0) return;
    const auto count = static_cast<int>(copies_.size());
    const unsigned blocks = std::clamp(blocks_for(count), 1U, 4U * m_.device().multiprocessors);
    store_at_peers<Records>
        <<<blocks, tile_size, 0, m_.stream()>>>(own, peers, copies_.data(), count, signals);
    m_.launched("store_at_peers", blocks, tile_size);
  }

  const Model& m_;
  DeviceArray<unsigned> flags_, counters_;
  DeviceArray<unsigned long long> waited_;
  DeviceArray<RemoteCopy> copies_;
  DeviceArray<Index> first_;  // first copy of each boundary tile
  DeviceArray<Points<Real>> points_;
  DeviceArray<Stresses<Real>> stresses_;
  DeviceArray<ClosedStresses<Real>> closed_stresses_;  // with closed gradients
  DeviceArray<unsigned*> their_flags_[kinds_sent];
  Signals signals_[kinds_sent]{};
  std::vector<OpenedMemory> opened_;
};

}  // namespace phyxel::cuda
