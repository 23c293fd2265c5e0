/// A model on the ranks of the program.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "device_option.hpp"
#include "mpi/communicator.hpp"
#include "mpi/stretch_exchange.hpp"
#include "phyxel/checkpoint.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"
#include "setup.hpp"

namespace phyxel::app {

/// The ranks of this program.
const Communicator& ranks();
/// For main(): who they are. Until then there is one. Ranks of one host share its cores from then
/// on, unless someone has bound them or has said how many threads each takes.
void set_ranks(const Communicator& ranks);
/// @throws AgreedError if it is not the same number on all ranks. Collective.
void require_alike(std::uint64_t value, const char* what);

/// What exchanges have cost the rank that had most. Collective.
Traffic most_traffic(const Backend& backend);

/// Names of partitioners, and "auto".
std::vector<std::string> partitioner_choices();

/// How a model is cut, and what its parts exchange.
struct CutOptions {
  /// "metis", "curve", "bisection", or "auto": the one whose slowest part has least to do.
  std::string partitioner = "auto";
  int rings = 1;  ///< See `Share`.
};

/// The model of a scene, or this rank's share of it.
class Ensemble {
 public:
  /// Builds it on the device that will step it, if there is one rank. Collective.
  Ensemble(const Scene& scene, const ChosenDevice& device, const CutOptions& cut);
  Ensemble(const Ensemble&) = delete;
  Ensemble& operator=(const Ensemble&) = delete;

  /// What this rank steps.
  const Model& here() const { return here_; }
  std::uint64_t digest() const { return digest_; }  ///< Of the whole.
  /// Phyxels of each rank.
  struct Shares {
    std::int64_t fewest = 0, most = 0, most_ghosts = 0;
  };
  const Shares& shares() const { return shares_; }
  const std::string& partitioner() const { return partitioner_; }

  const BoundarySize& boundary() const { return boundary_; }  ///< Of the whole.
  /// Of the whole, on the first rank.
  std::span<const Triangle> triangles() const;
  /// Between the ranks, if there are several.
  const StretchExchange& exchange() const { return *exchange_; }

  /// This rank's share of the state of a checkpoint, which comes in stretches. Collective.
  /// @param checkpoint on the first rank
  State state_of(const CheckpointReader* checkpoint, Index length) const;

 private:
  Model here_;
  std::unique_ptr<const StretchExchange> exchange_;
  std::vector<Triangle> triangles_;  // of a share's whole
  std::uint64_t digest_ = 0;
  BoundarySize boundary_;
  Shares shares_;
  std::string partitioner_;
};

}  // namespace phyxel::app
