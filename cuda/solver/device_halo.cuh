/// What GPUs send each other: values of phyxels, from the ranks that own them to those that have
/// them as ghosts.
///
/// Two ways. *Direct*: kernels store the records where the other ranks' kernels read them and raise
/// a flag there, for which those wait (peers.cuh); the passes of a step do so themselves. The host
/// takes no part. *Packed*: a kernel packs, and NCCL, an MPI that takes the device's memory, or the
/// host and MPI carry, for which each time `begin` and `finish` only queue what the device does, so
/// that what is launched in between overlaps.
///
/// Nothing says that an array may be written again, because the order of a step says it: who sends
/// stresses has received displacements, which their owner sends after it has read the stresses of
/// the step before; and the other way round. Whoever leaves that order (`upload`) has to meet the
/// others on the host first.
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
#include "solver/device_model.cuh"
#include "solver/nccl.hpp"
#include "solver/peers.cuh"

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

/// Host memory that copies to and from the device need not stage.
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

/// Where each peer's records are, one peer after the other.
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

/// Brings packed records to other ranks and theirs here, in a queue of its own.
class PackedTransport {
 public:
  virtual ~PackedTransport() = default;
  virtual void reserve(std::size_t outgoing, std::size_t incoming) = 0;
  /// @param bytes_each of a record
  virtual void begin(std::byte* packed, std::byte* arrived, std::size_t bytes_each) = 0;
  /// What is queued from now on finds `arrived` filled.
  virtual void finish(std::byte* arrived, std::size_t bytes_each) = 0;
  virtual std::string describe() const = 0;
  cudaStream_t queue() const { return queue_.get(); }

 private:
  Stream queue_;
};

/// Through host memory, by MPI.
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

/// By MPI, which gets the device's memory itself.
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

/// By NCCL; the host only queues.
class NcclTransport final : public PackedTransport {
 public:
  /// Collective. @throws DeviceError
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

/// Exchanges of records that are packed here and unpacked there.
template <class Model>
class PackedExchange {
 public:
  PackedExchange(const Model& model, const PeerLists& send, const PeerLists& receive)
      : m_(model),
        send_(send),
        receive_(receive),
        transport_(std::make_unique<HostTransport>(*model.share()->transport, send, receive)) {}

  /// From now on, between exchanges.
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
    // What carries has a queue of its own; it begins when all before has been packed.
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
  /// Only between exchanges: nothing is under way.
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

/// Memory of another rank, opened here.
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
  ///   after all that is collective
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
    if (what == Sent::stresses) {
      store(m_.fields().stresses, stresses_.data(), what);
    } else {
      store(m_.fields().points, points_.data(), what);
    }
  }
  void finish(Sent what) const {
    if (signals_[0].peers == 0) return;
    wait_for_peers<<<1, warp_size, 0, m_.stream()>>>(signals_[static_cast<int>(what)]);
    m_.launched("wait_for_peers", 1, warp_size);
  }
  /// For passes that exchange by themselves. Only if `tiles_meet`.
  Meeting<Stresses<Real>> meeting_of_pass_1(bool waits) const {
    return meeting(Sent::displacements, Sent::stresses, m_.fields().stresses, stresses_, waits);
  }
  Meeting<Points<Real>> meeting_of_pass_2(bool waits) const {
    return meeting(Sent::stresses, Sent::displacements, m_.fields().points, points_, waits);
  }
  /// Whether there is a block to tell the peers, and none that waits keeps another rank's from
  /// running: MPS lets kernels of several ranks share the GPU at once, without turns.
  bool tiles_meet() const {
    int shared_at_once = 0;
    PHYXEL_CUDA(cudaDeviceGetAttribute(&shared_at_once, cudaDevAttrMpsEnabled, m_.device().index));
    return m_.boundary_tiles() > 0 && shared_at_once == 0;
  }
  /// Other ranks' memory is no longer used here, and may be freed once all have done this.
  void close() { opened_.clear(); }
  double waited_seconds() const {
    m_.wait();
    double sum = 0;
    for (const unsigned long long ns : fetched(waited_)) sum += 1e-9 * static_cast<double>(ns);
    return sum;
  }
  std::size_t bytes() const {
    return flags_.bytes() + counters_.bytes() + crossings_.bytes() + points_.bytes() +
           stresses_.bytes() + first_.bytes();
  }

 private:
  template <class Records>
  Meeting<Records> meeting(Sent awaited, Sent told, const Records& own,
                           const DeviceArray<Records>& peers, bool waits) const {
    return {signals_[static_cast<int>(awaited)],
            signals_[static_cast<int>(told)],
            m_.boundary_tiles(),
            first_.data(),
            crossings_.data(),
            own,
            peers.data(),
            waits};
  }
  /// What a peer needs to store here; then the places of what it sends.
  struct Invitation {
    cudaIpcMemHandle_t points, stresses, flags;
    std::uint64_t places;
    std::int32_t flag, of_flags;  ///< Its own among those of a kind, and how many those are.
  };

  void make_flags(std::size_t count) {
    // A whole page of the device, as all memory that is shared: CUDA shares no less.
    flags_ = {shared_page / sizeof(unsigned) + kinds_sent * count, "flags of ranks"};
    counters_ = {3 * kinds_sent, "counts of exchanges"};
    waited_ = {kinds_sent, "waiting times"};
    flags_.clear();
    counters_.clear();
    waited_.clear();
    PHYXEL_CUDA(cudaDeviceSynchronize());  // before anyone may raise a flag
  }
  std::vector<std::vector<std::byte>> invitations(const PeerLists& receive,
                                                  std::size_t count) const {
    std::vector<std::vector<std::byte>> words(count);
    std::size_t first = 0;
    for (std::size_t p = 0; p < count; ++p) {
      Invitation invitation{};
      PHYXEL_CUDA(cudaIpcGetMemHandle(&invitation.points, m_.points_memory()));
      PHYXEL_CUDA(cudaIpcGetMemHandle(&invitation.stresses, m_.stresses_memory()));
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
    std::vector<unsigned*> their_flags[kinds_sent];
    std::vector<Crossing> crossings;
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
        crossings.push_back({m_.tiling().place[peers[p].send[k]], there[k], static_cast<int>(p)});
      }
      const auto opened = [&](const cudaIpcMemHandle_t& handle) {
        return opened_.emplace_back(handle).data();
      };
      const auto places = static_cast<std::size_t>(invitation.places);
      points.push_back(Points<Real>::in(opened(invitation.points), places));
      stresses.push_back(Stresses<Real>::in(opened(invitation.stresses), places));
      auto* at = static_cast<unsigned*>(opened(invitation.flags));
      for (int kind = 0; kind < kinds_sent; ++kind) {
        their_flags[kind].push_back(at + kind * invitation.of_flags + invitation.flag);
      }
    }
    points_ = sent(points, "peers");
    stresses_ = sent(stresses, "peers");
    send_crossings(std::move(crossings));
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
  /// By place, so that each tile knows its own.
  void send_crossings(std::vector<Crossing> crossings) {
    std::stable_sort(crossings.begin(), crossings.end(),
                     [](const Crossing& a, const Crossing& b) { return a.here < b.here; });
    std::vector<Index> first;
    std::size_t k = 0;
    for (Index tile = 0; tile <= m_.boundary_tiles(); ++tile) {
      while (k < crossings.size() && crossings[k].here < tile * tile_size) ++k;
      first.push_back(static_cast<Index>(k));
    }
    first_ = sent(first, "what other ranks get");
    crossings_ = sent(crossings, "what other ranks get");
  }
  template <class Records>
  void store(const Records& own, const Records* peers, Sent what) const {
    const Signals& signals = signals_[static_cast<int>(what)];
    if (signals.peers == 0) return;
    const auto count = static_cast<int>(crossings_.size());
    const unsigned blocks = std::clamp(blocks_for(count), 1U, 4U * m_.device().multiprocessors);
    store_at_peers<Records>
        <<<blocks, tile_size, 0, m_.stream()>>>(own, peers, crossings_.data(), count, signals);
    m_.launched("store_at_peers", blocks, tile_size);
  }

  const Model& m_;
  DeviceArray<unsigned> flags_, counters_;
  DeviceArray<unsigned long long> waited_;
  DeviceArray<Crossing> crossings_;
  DeviceArray<Index> first_;  // of each boundary tile
  DeviceArray<Points<Real>> points_;
  DeviceArray<Stresses<Real>> stresses_;
  DeviceArray<unsigned*> their_flags_[kinds_sent];
  Signals signals_[kinds_sent]{};
  std::vector<OpenedMemory> opened_;
};

/// The exchanges of one share.
template <class Real, class StateReal>
class DeviceHalo {
  using Model = DeviceModel<Real, StateReal>;

 public:
  /// Collective. @throws DeviceError on all ranks if `wanted` cannot be had on one
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
  /// Collective, unless an error is on its way, which may be of this rank alone.
  ~DeviceHalo() {
    if (std::uncaught_exceptions() == 0) close();
  }

  /// What follows on the device may be launched at once, except for what changes what is sent.
  void begin(Sent what) const {
    under_way_[static_cast<int>(what)] = true;
    if (direct_) {
      direct_->begin(what);
    } else if (what == Sent::stresses) {
      packed_.begin(m_.fields().stresses);
    } else {
      packed_.begin(m_.fields().points);
    }
  }
  /// What is launched from now on sees ghosts' values. Nothing happens if nothing is under way.
  void finish(Sent what) const {
    if (!std::exchange(under_way_[static_cast<int>(what)], false)) return;
    if (direct_) {
      direct_->finish(what);
    } else if (what == Sent::stresses) {
      packed_.finish(m_.fields().stresses);
    } else {
      packed_.finish(m_.fields().points);
    }
  }
  /// What a pass has to do that takes in one kind of value and sends the other by itself, as all
  /// do or none; null if the exchange stands outside.
  const DirectExchange<Real, StateReal>* in_passes() const {
    return direct_ && direct_->tiles_meet() ? direct_.get() : nullptr;
  }
  /// Such a pass is about to be launched. @returns whether it waits
  bool pass_meets(Sent awaited, Sent told) const {
    under_way_[static_cast<int>(told)] = true;
    return std::exchange(under_way_[static_cast<int>(awaited)], false);
  }
  bool is_under_way(Sent what) const { return under_way_[static_cast<int>(what)]; }
  /// Other values, at once.
  template <class Records>
  void exchange(const Records& records) const {
    packed_.begin(records);
    packed_.finish(records);
  }

  bool is_direct() const { return direct_ != nullptr; }
  /// For `traffic`: graphs pass `begin` by.
  void count_steps(int steps) const {
    bytes_sent_ += static_cast<std::int64_t>(send_.places.size()) * steps *
                   (Stresses<Real>::bytes + Points<Real>::bytes);
  }
  std::string describe() const {
    return direct_ ? "stores into other GPUs' memory (CUDA IPC)" : packed_.describe();
  }
  Traffic traffic() const {
    return {bytes_sent_, direct_ ? direct_->waited_seconds() : halo().traffic().seconds};
  }
  std::size_t bytes() const {
    return send_.on_device.bytes() + receive_.on_device.bytes() + packed_.bytes() +
           (direct_ ? direct_->bytes() : 0);
  }

 private:
  const Communicator& ranks() const { return *m_.share()->communicator; }
  HaloTransport& halo() const { return *m_.share()->transport; }
  /// Memory is freed when nobody has it open.
  void close() {
    if (direct_) direct_->close();
    ranks().largest(0);
  }
  void open_direct(bool insist) {
    std::string trouble;
    const std::vector<HaloPlan::Peer>& peers = m_.share()->halo->peers;
    bool one_host = true;
    for (const HaloPlan::Peer& peer : peers) one_host = one_host && peer.same_host;
    // All ranks take the same way.
    if (ranks().smallest(one_host) > 0) {
      try {
        direct_ = std::make_unique<DirectExchange<Real, StateReal>>(m_, receive_);
      } catch (const DeviceError& error) {
        trouble = error.what();
        cudaGetLastError();  // it is told of below
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
  /// All ranks know, though maybe one of them alone knows why.
  [[noreturn]] static void refuse(const char* transport, const std::string& why,
                                  const char* allowed) {
    throw AgreedError(ExitCode::device_failed, std::string("transport ") + transport + ": " + why +
                                                   "; allowed here: " + allowed);
  }
  /// Collective.
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
  /// One rank names the ranks, for all. @returns whether exchanges go by it
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
    // Where ranks share a GPU, NCCL may wait for ever.
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
      transport.release();  // to end it would be collective, and not all ranks have it
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
};

}  // namespace phyxel::cuda
