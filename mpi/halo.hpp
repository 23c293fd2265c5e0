/// The exchange of values between owners of phyxels and those who have them as ghosts.
#pragma once

#include <vector>

#include "mpi/communicator.hpp"
#include "partition/share.hpp"

namespace phyxel {

/// On CPU ranks, by MPI.
class Halo final : public Others {
 public:
  /// Collective: tells the owners which of their phyxels are ghosts here.
  Halo(const Communicator& ranks, const ModelShare& share);

  void add(std::span<std::int64_t> values) const override { ranks_.add(values); }
  double largest(double value) const override { return ranks_.largest(value); }
  double smallest(double value) const override { return ranks_.smallest(value); }
  void begin(const Records& records) const override;
  void finish() const override;
  Traffic traffic() const override { return traffic_; }

 private:
  /// Phyxels here that one other rank gets, or that come from it; both sides have them in the order
  /// of their numbers in the whole model.
  struct Peer {
    int rank = 0;
    std::vector<Index> send, receive;
    mutable std::vector<std::byte> outgoing, incoming;
  };
  const Communicator& ranks_;
  std::vector<Peer> peers_;
  mutable Records under_way_;
  mutable Traffic traffic_;
  mutable Transfers transfers_;
};

/// This rank's share of a model, connected to the others. Collective.
Model connected(const Communicator& ranks, ModelShare share);

}  // namespace phyxel
