/// The halo exchange between GPUs: sends values of phyxels from the ranks that own them to those
/// that have them as ghosts.
///
/// There are two transports. *Direct*: the kernels of a step store records in the memory of other
/// ranks' GPUs and raise a flag there, for which the kernels of those ranks wait (fused_halo.cuh);
/// the host takes no part. *Packed*: a kernel packs records, which NCCL, a CUDA-aware MPI, or MPI
/// from host memory transfers. `begin` and `finish` only queue work of the device, so that kernels
/// launched in between overlap with the transfer.
///
/// No acknowledgement is needed before a receive buffer is reused: a rank sends stresses only after
/// it has received displacements, which their owner sends after it has read the stresses of the
/// previous step, and likewise for displacements. Functions that leave this order (`upload`) need a
/// barrier on the host first.
#pragma once

#include <array>
#include <cstring>
#include <exception>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "solver/cuda_backend.hpp"
#include "solver/direct_exchange.cuh"
#include "solver/packed_exchange.cuh"

namespace phyxel::cuda {

/// The halo exchanges of one share.
template <class Real, class StateReal>
class DeviceHalo {
  using Model = DeviceModel<Real, StateReal>;

 public:
  /// Opens a transport. Collective. @throws DeviceError on all ranks if `wanted` is not available
  /// on one
  DeviceHalo(const Model& model, Transport wanted)
      : m_(model),
        send_(m_.share()->halo->peers, &HaloPlan::Peer::send, model.tiling().place),
        receive_(m_.share()->halo->peers, &HaloPlan::Peer::receive, model.tiling().place),
        packed_(model, send_, receive_) {
    if (wanted == Transport::automatic || wanted == Transport::direct) {
      open_direct(wanted == Transport::direct);
    }
    const bool any = wanted == Transport::automatic && !direct_;
    const bool nccl = (any || wanted == Transport::nccl) && open_nccl(!any);
    if (wanted == Transport::mpi || (any && !nccl)) open_mpi(!any);
  }
  DeviceHalo(const DeviceHalo&) = delete;
  DeviceHalo& operator=(const DeviceHalo&) = delete;
  /// Collective, unless an exception is in flight, which may concern this rank alone.
  ~DeviceHalo() {
    if (std::uncaught_exceptions() == 0) close();
  }

  /// Begins to send values. Kernels may be launched at once, except those that change the sent
  /// values.
  void begin(Sent what) const {
    under_way_[static_cast<int>(what)] = true;
    if (direct_) return direct_->begin(what);
    with_records(what, [&](const auto& records) { packed_.begin(records); });
  }
  /// Makes kernels launched from now on see the values of ghosts. Does nothing if no exchange is in
  /// progress.
  void finish(Sent what) const {
    if (!std::exchange(under_way_[static_cast<int>(what)], false)) return;
    if (direct_) return direct_->finish(what);
    with_records(what, [&](const auto& records) { packed_.finish(records); });
  }
  /// The exchange for passes that receive one kind of value and send the other themselves; null if
  /// passes leave the exchange to `begin` and `finish`.
  const DirectExchange<Real, StateReal>* fused() const {
    return direct_ && direct_->can_fuse() ? direct_.get() : nullptr;
  }
  /// Such a pass is about to be launched. @returns whether it waits
  bool begin_fused_pass(Sent awaited, Sent told) const {
    under_way_[static_cast<int>(told)] = true;
    return std::exchange(under_way_[static_cast<int>(awaited)], false);
  }
  bool is_under_way(Sent what) const { return under_way_[static_cast<int>(what)]; }
  /// Exchanges other values, and waits for them.
  template <class Records>
  void exchange(const Records& records) const {
    packed_.begin(records);
    packed_.finish(records);
  }

  bool is_direct() const { return direct_ != nullptr; }
  /// Counts steps of graphs, which do not call `begin`, for `traffic`.
  void count_steps(int steps) const {
    bytes_sent_ +=
        static_cast<std::int64_t>(send_.places.size()) * steps *
        ((m_.closed() ? ClosedStresses<Real>::bytes : Stresses<Real>::bytes) + Points<Real>::bytes);
  }
  std::string describe() const {
    return direct_ ? "stores into other GPUs' memory (CUDA IPC)" : packed_.describe();
  }
  Traffic traffic() const {
    return {bytes_sent_,
            direct_ ? direct_->waited_seconds() : halo().traffic().seconds - seconds_before_};
  }
  std::size_t bytes() const {
    return send_.on_device.bytes() + receive_.on_device.bytes() + packed_.bytes() +
           (direct_ ? direct_->bytes() : 0);
  }

 private:
  /// Calls visit(records) with the records that an exchange sends.
  template <class Visit>
  void with_records(Sent what, Visit&& visit) const {
    if (what == Sent::displacements) {
      visit(m_.fields().points);
    } else if (m_.closed()) {
      visit(m_.closed_stresses());
    } else {
      visit(m_.fields().stresses);
    }
  }
  const Communicator& ranks() const { return *m_.share()->communicator; }
  HaloTransport& halo() const { return *m_.share()->transport; }
  /// Waits until no rank has memory open, so that it can be freed.
  void close() {
    if (direct_) direct_->close();
    ranks().largest(0);
  }
  void open_direct(bool insist) {
    std::string trouble;
    const std::vector<HaloPlan::Peer>& peers = m_.share()->halo->peers;
    bool one_host = true;
    for (const HaloPlan::Peer& peer : peers) one_host = one_host && peer.same_host;
    // All ranks use the same transport.
    if (ranks().smallest(one_host) > 0) {
      try {
        direct_ = std::make_unique<DirectExchange<Real, StateReal>>(m_, receive_);
      } catch (const DeviceError& error) {
        trouble = error.what();
        cudaGetLastError();  // clears the error, which is reported below
      }
    } else {
      trouble = "ranks of several hosts";
    }
    if (ranks().smallest(direct_ != nullptr) > 0) return;
    close();
    direct_.reset();
    if (!insist) return;
    if (trouble.empty()) trouble = "another rank's memory cannot be opened";
    refuse("direct", trouble, "nccl, mpi, host, auto");
  }
  /// Throws on all ranks, of which perhaps one alone has the reason.
  [[noreturn]] static void refuse(const char* transport, const std::string& why,
                                  const char* allowed) {
    throw AgreedError(ExitCode::device_failed, std::string("transport ") + transport + ": " + why +
                                                   "; allowed here: " + allowed);
  }
  /// True if every rank has a GPU of its own. Collective.
  bool gpus_differ() const {
    cudaDeviceProp properties;
    PHYXEL_CUDA(cudaGetDeviceProperties(&properties, m_.device().index));
    std::array<std::int64_t, 2> own;
    static_assert(sizeof own == sizeof properties.uuid);
    std::memcpy(own.data(), &properties.uuid, sizeof own);
    std::vector<std::int64_t> words(2 * static_cast<std::size_t>(ranks().size()), 0);
    const auto at = 2 * static_cast<std::size_t>(ranks().rank());
    std::copy(own.begin(), own.end(), words.begin() + static_cast<std::ptrdiff_t>(at));
    ranks().add(words);
    std::set<std::pair<std::int64_t, std::int64_t>> gpus;
    for (std::size_t k = 0; k < words.size(); k += 2) gpus.emplace(words[k], words[k + 1]);
    return static_cast<int>(gpus.size()) == ranks().size();
  }
  void open_mpi(bool insist) {
    if (ranks().smallest(halo().takes_device_memory()) > 0) {
      packed_.send_by(std::make_unique<MpiTransport>(halo(), send_, receive_));
    } else if (insist) {
      refuse("mpi", "this MPI is not CUDA-aware", "direct, nccl, host, auto");
    }
  }
  /// Connects the ranks by NCCL, with a name that one rank makes. @returns true if exchanges use
  /// NCCL
  bool open_nccl(bool insist) {
    std::string trouble;
    NcclRanks::Name name{};
    const auto agree = [&](bool fine) { return ranks().smallest(fine) > 0; };
    const auto attempt = [&](auto&& work) {
      try {
        work();
      } catch (const DeviceError& error) {
        trouble = error.what();
      }
      return agree(trouble.empty());
    };
    // NCCL may hang if ranks share a GPU.
    const bool apart = gpus_differ();
    const bool named = attempt([&] {
      if (!has_nccl()) throw DeviceError(nccl_version());
      if (!apart) throw DeviceError("ranks share a GPU");
      if (ranks().rank() == 0) name = NcclRanks::make_name();
    });
    if (named) {
      ranks().add(name);
      std::unique_ptr<PackedTransport> transport;
      if (attempt([&] {
            transport = std::make_unique<NcclTransport>(*m_.share(), name, send_, receive_);
          })) {
        packed_.send_by(std::move(transport));
        return true;
      }
      transport.release();  // leaked: ending it is collective, and not all ranks have it
    }
    if (!insist) return false;
    if (trouble.empty()) trouble = "another rank cannot use NCCL";
    refuse("nccl", trouble, "direct, mpi, host, auto");
  }

  const Model& m_;
  PeerLists send_, receive_;
  mutable PackedExchange<Model> packed_;
  std::unique_ptr<DirectExchange<Real, StateReal>> direct_;
  mutable bool under_way_[kinds_sent]{};
  mutable std::int64_t bytes_sent_ = 0;
  double seconds_before_ = halo().traffic().seconds;  ///< Of the set-up: left out of `traffic` [s].
};

}  // namespace phyxel::cuda
