/// The exchange of values between owners of phyxels and those who have them as ghosts.
#pragma once

#include <vector>

#include "mpi/communicator.hpp"
#include "partition/share.hpp"

namespace phyxel {

/// By MPI, from host memory to host memory.
class Halo final : public Others {
 public:
  /// Collective: tells the owners which of their phyxels are ghosts here.
  Halo(const Communicator& ranks, const ModelShare& share);

  void add(std::span<std::int64_t> values) const override { ranks_.add(values); }
  double largest(double value) const override { return ranks_.largest(value); }
  double smallest(double value) const override { return ranks_.smallest(value); }
  int rank() const override { return ranks_.rank(); }
  int count() const override { return ranks_.size(); }
  const std::vector<Peer>& peers() const override { return peers_; }
  std::vector<std::vector<std::byte>> told(
      const std::vector<std::vector<std::byte>>& words) const override;
  bool takes_device_memory() const override { return mpi_takes_device_memory(); }
  void begin(const Bytes& outgoing, const Bytes& incoming) const override;
  void begin(const Records& records) const override;
  void finish() const override;
  Traffic traffic() const override { return traffic_; }

 private:
  const Communicator& ranks_;
  std::vector<Peer> peers_;
  struct Packed {
    std::vector<std::vector<std::byte>> outgoing, incoming;  // of each peer
  };
  std::shared_ptr<Packed> packed_ = std::make_shared<Packed>();
  mutable Records under_way_;  // to be unpacked
  mutable Traffic traffic_;
  mutable Transfers transfers_;
};

}  // namespace phyxel
