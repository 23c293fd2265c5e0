/// The halo exchange over MPI: the plan and its transport.
#pragma once

#include <memory>
#include <vector>

#include "mpi/communicator.hpp"
#include "partition/share.hpp"

namespace phyxel {

/// Makes the halo plan of a share: requests the ghosts from their owners, which thus learn the
/// ranks to send them to. Collective.
/// @param owner the rank that owns each phyxel of the share, shape [n]
/// @param global_id of each phyxel of the share, shape [n]
HaloPlan make_halo_plan(const MpiCommunicator& ranks, const std::vector<int>& owner,
                        const std::vector<Index>& global_id);

/// Sends values by MPI, from memory of the host or, with a CUDA-aware MPI, of a GPU.
class MpiHaloTransport final : public HaloTransport {
 public:
  MpiHaloTransport(const MpiCommunicator& ranks, std::shared_ptr<const HaloPlan> plan);

  void start(const Records& records) override;
  void start(const PeerBytes& outgoing, const PeerBytes& incoming) override;
  void progress() override;
  void finish() override;
  bool takes_device_memory() const override { return mpi_takes_device_memory(); }
  Traffic traffic() const override { return traffic_; }

 private:
  /// The packed values of each peer.
  struct Packed {
    std::vector<std::vector<std::byte>> outgoing, incoming;
  };
  std::shared_ptr<const HaloPlan> plan_;
  std::shared_ptr<Packed> packed_ = std::make_shared<Packed>();
  Records under_way_;  // records to unpack; none if their base is null
  Traffic traffic_;
  Transfers transfers_;
};

/// Connects a share with the other ranks: makes its halo plan and transport. Collective.
/// @param ranks must outlive the share
void connect(const MpiCommunicator& ranks, ModelShare& made);
/// The model of a connected share.
Model model_of(ModelShare&& made);

}  // namespace phyxel
