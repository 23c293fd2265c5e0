/// A model on the ranks of the program, and what they bring together on the first.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "device_option.hpp"
#include "mpi/communicator.hpp"
#include "phyxel/model.hpp"
#include "phyxel/state.hpp"

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

  /// What this rank steps.
  const Model& here() const { return here_; }
  std::uint64_t digest() const { return digest_; }  ///< Of the whole.
  /// Phyxels of each rank.
  struct Shares {
    std::int64_t fewest = 0, most = 0, most_ghosts = 0;
  };
  const Shares& shares() const { return shares_; }
  const std::string& partitioner() const { return partitioner_; }

  /// Gives the first rank what frames and summaries are written from: the whole model without lists
  /// and moments. Collective.
  void bring_together();
  /// The whole; on the first rank, once it has been brought together.
  const Model& whole() const { return here_.share ? *whole_ : here_; }
  /// Values of all phyxels, or of all surfels, on the first rank, likewise; nothing on the others.
  template <class T>
  std::vector<T> phyxels(const std::vector<T>& local) const {
    return brought_together(local, owned_, numbers_);
  }
  template <class T>
  std::vector<T> surfels(const std::vector<T>& local) const {
    return brought_together(local, {}, surfel_numbers_);
  }
  State whole_state(const State& local) const;
  /// This rank's share of a state of the whole, whose arrays the first rank has. Collective.
  State shared_out(State whole) const;

 private:
  /// @param chosen which of `local` are sent; empty: all
  template <class T>
  std::vector<T> brought_together(const std::vector<T>& local, const std::vector<Index>& chosen,
                                  const std::vector<std::vector<Index>>& numbers) const {
    if (!here_.share) return local;
    std::vector<std::vector<T>> send(static_cast<std::size_t>(ranks().size()));
    for (const Index i : chosen) send[0].push_back(local[i]);
    if (chosen.empty()) send[0] = local;
    const std::vector<std::vector<T>> received = ranks().exchanged(send);
    std::size_t size = 0;
    for (const std::vector<Index>& of_rank : numbers) size += of_rank.size();
    std::vector<T> all(size);
    for (std::size_t r = 0; r < numbers.size(); ++r) {
      for (std::size_t k = 0; k < numbers[r].size(); ++k) all[numbers[r][k]] = received[r][k];
    }
    return all;
  }

  Model here_;
  std::vector<Surface> surfaces_;  // of a share's whole bodies, until they are brought together
  std::unique_ptr<const Model> whole_;
  std::uint64_t digest_ = 0;
  std::vector<Index> owned_;                                  // here
  std::vector<std::vector<Index>> numbers_, surfel_numbers_;  // [rank], on the first rank
  Shares shares_;
  std::string partitioner_;
};

}  // namespace phyxel::app
