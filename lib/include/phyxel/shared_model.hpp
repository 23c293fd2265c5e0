/// A model that the ranks of a program step together, so that none ever holds the whole.
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

/// How a model is cut, and what its parts exchange.
struct CutOptions {
  /// "metis", "curve", "bisection", or "auto": the one whose slowest part has least to do.
  std::string partitioner = "auto";
};
/// Names of partitioners, and "auto".
std::vector<std::string> partitioner_choices();

/// The model of a scene or, if there are several ranks, this one's share of it. It is stepped like
/// any other: `make_backend`, `step_limit`, `initial_state`, `Solver` and `diagnose` take `here()`,
/// all ranks together, and give the bits that one rank would, however the model is cut.
class SharedModel {
 public:
  /// Builds it, on the device that will step it. Lattices are made piece by piece; bodies from
  /// meshes and files are made whole by every rank, and cut. Collective.
  /// @param scene the same on all ranks
  /// @param ranks must outlive this
  /// @throws Error on every rank for what `build_model` refuses, and for cuts that cannot be
  SharedModel(const Ranks& ranks, const Scene& scene, const ChosenDevice& device,
              const CutOptions& cut = {});
  /// The same from clouds already in place, one for each body of the scene; every rank has them.
  SharedModel(const Ranks& ranks, const Scene& scene, const std::vector<Cloud>& clouds,
              const ChosenDevice& device, const CutOptions& cut = {});
  ~SharedModel();
  SharedModel(const SharedModel&) = delete;
  SharedModel& operator=(const SharedModel&) = delete;

  /// What this rank steps. A state says nothing of its ghosts: see `Model::owns`.
  const Model& here() const { return here_; }
  std::uint64_t digest() const { return digest_; }  ///< Of the whole, as `model_digest`.
  /// True if a checkpoint was written by a run of this model.
  bool wrote(const CheckpointInfo& info) const {
    return info.model_digest == (info.version < 4 ? digest_before_4_ : digest_);
  }
  /// Phyxels of each rank.
  struct Shares {
    std::int64_t fewest = 0, most = 0, most_ghosts = 0;
  };
  /// How evenly it is cut.
  const Shares& shares() const { return shares_; }
  const std::string& partitioner() const { return partitioner_; }  ///< Who cut it; "": nobody.

  /// A backend for this rank's share on its device, as the function of that name. Collective.
  /// @throws Error on every rank, except DeviceError of this rank's GPU
  std::unique_ptr<Backend> make_backend(Precision precision, int threads = 0,
                                        const std::string& transport = "auto") const;

  /// The values of the whole model's phyxels, or surfels, `begin` to `end`, on the first rank, and
  /// nothing on the others. Collective.
  /// @param here those of all phyxels or surfels of this rank, shape [n, width_of(quantity)]
  std::vector<double> gathered(Quantity quantity, std::span<const double> here, Index begin,
                               Index end) const;
  /// This rank's share of the state of a checkpoint, read so many phyxels at a time. Collective.
  /// @param checkpoint on the first rank; the others give null
  /// @throws Error on every rank if it is of another model, or damaged
  State state_of(const CheckpointReader* checkpoint,
                 Index length = ChunkedSource::usual_length) const;
  /// Of the surfels of the whole, on the first rank; nothing on the others.
  std::span<const Triangle> triangles() const;

  /// Between the ranks, for the library's own writers; there must be several.
  const RowRedistribution& exchange() const { return *exchange_; }

 private:
  void build(const Scene& scene, const std::vector<Cloud>* clouds, const CutOptions& cut);

  const Ranks& ranks_;
  ChosenDevice device_;
  Model here_;
  std::unique_ptr<const RowRedistribution> exchange_;
  std::vector<Triangle> triangles_;  // of a share's whole
  std::uint64_t digest_ = 0, digest_before_4_ = 0;
  Shares shares_;
  std::string partitioner_;
};

}  // namespace phyxel
