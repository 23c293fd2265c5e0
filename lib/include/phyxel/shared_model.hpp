/// A model distributed over the ranks of a program.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "phyxel/checkpoint.hpp"
#include "phyxel/chunked_source.hpp"
#include "phyxel/device.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

class Ranks;
class RowRedistribution;

/// Options of the partition of a model.
struct CutOptions {
  /// Partitioner: "metis", "curve", "bisection", or "auto", the one whose slowest part costs least.
  std::string partitioner = "auto";
};
/// The names of the partitioners, and "auto".
std::vector<std::string> partitioner_choices();

/// The model of a scene or, with several ranks, this rank's share. It is stepped like any other
/// model: `make_backend`, `step_limit`, `initial_state`, `Solver` and `diagnose` take `here()`, on
/// all ranks together, and give the same bits as one rank, for any partition.
class SharedModel {
 public:
  /// Builds the model on the device that will step it. Each rank makes a piece of lattices; bodies
  /// from meshes and files are made on each rank, and cut. Collective.
  /// @param scene must be the same on all ranks
  /// @param ranks must outlive the model
  /// @throws Error on each rank for scenes that `build_model` refuses, and for impossible
  /// partitions
  SharedModel(const Ranks& ranks, const Scene& scene, const ChosenDevice& device,
              const CutOptions& cut = {});
  /// Builds the model from positioned clouds, one for each body of the scene, on each rank.
  SharedModel(const Ranks& ranks, const Scene& scene, const std::vector<Cloud>& clouds,
              const ChosenDevice& device, const CutOptions& cut = {});
  ~SharedModel();
  SharedModel(const SharedModel&) = delete;
  SharedModel& operator=(const SharedModel&) = delete;

  /// The model that this rank steps. Values of its ghosts in a state are not valid: see
  /// `Model::owns`.
  const Model& here() const { return here_; }
  std::uint64_t digest() const { return digest_; }  ///< `model_digest` of the whole model.
  /// True if a checkpoint was written by a run of this model.
  bool wrote(const CheckpointInfo& info) const {
    return info.model_digest == (info.version < 4 ? digest_before_4_ : digest_);
  }
  /// Statistics of the ranks' shares.
  struct Shares {
    std::int64_t fewest = 0, most = 0, most_ghosts = 0;
  };
  /// Statistics of the partition.
  const Shares& shares() const { return shares_; }
  const std::string& partitioner() const { return partitioner_; }  ///< "" if it is not cut.

  /// Makes the backend of this rank's share by `phyxel::make_backend`. Collective.
  /// @throws Error on every rank, except DeviceError of this rank's GPU
  std::unique_ptr<Backend> make_backend(Precision precision, int threads = 0,
                                        const std::string& transport = "auto") const;

  /// Gathers the values of phyxels, or surfels, `begin` to `end` of the whole model on the first
  /// rank; the result is empty on other ranks. Collective.
  /// @param here values of this rank's phyxels or surfels, shape [n, width_of(quantity)]
  /// @throws AgreedError for a range or a number of values that does not fit; with one rank,
  ///   InputError
  std::vector<double> gathered(Quantity quantity, std::span<const double> here, Index begin,
                               Index end) const;
  /// This rank's share of the state of a checkpoint, read in chunks. Collective.
  /// @param checkpoint the checkpoint on the first rank; null on other ranks
  /// @throws Error on each rank if the checkpoint is damaged, or belongs to another model
  State state_of(const CheckpointReader* checkpoint,
                 Index length = ChunkedSource::usual_length) const;
  /// The triangles of the whole model on the first rank; empty on other ranks.
  std::span<const Triangle> triangles() const;

  /// The redistribution between ranks, for the library's writers; requires several ranks.
  const RowRedistribution& exchange() const { return *exchange_; }

 private:
  void build(const Scene& scene, const std::vector<Cloud>* clouds, const CutOptions& cut);

  const Ranks& ranks_;
  ChosenDevice device_;
  Model here_;
  std::unique_ptr<const RowRedistribution> exchange_;
  std::vector<Triangle> triangles_;  // of the whole model, on the first rank
  std::uint64_t digest_ = 0, digest_before_4_ = 0;
  Shares shares_;
  std::string partitioner_;
};

}  // namespace phyxel
