/// A graph cut into parts of equal weight: three ways behind one function. No ranks are needed.
#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "partition/graph.hpp"

namespace phyxel {

enum class Partitioner {
  metis,      ///< Few edges cut: Karypis and Kumar 1998, METIS_PartGraphKway.
  curve,      ///< Equal shares of Hilbert's curve.
  bisection,  ///< Halves, again and again, across the longest side of what is left.
};

/// "metis", "curve", "bisection".
const std::vector<std::string>& partitioner_names();
std::string partitioner_name(Partitioner partitioner);
/// @throws InputError for another name
Partitioner partitioner_of(const std::string& name);

/// The part of each vertex, 0 to parts - 1. No part is empty unless there are fewer vertices than
/// parts. The same for the same graph; METIS's also depends on its version and on the C library, so
/// ranks take one's result. Not from two threads at once: METIS uses rand().
/// @throws InputError for fewer parts than one, and from METIS for graphs that its 32-bit indices
///   cannot name: allowed are groups of phyxels
std::vector<int> make_partition(const Graph& graph, int parts, Partitioner partitioner);

/// How good a partition is.
struct PartitionQuality {
  double imbalance = 0;     ///< Heaviest part over the mean, less one.
  std::int64_t cut = 0;     ///< Weight of edges between parts.
  std::int64_t ghosts = 0;  ///< Vertices that a part needs of others, over all parts.
  Index most_ghosts = 0;    ///< Of one part.
  int most_peers = 0;       ///< Parts that one part needs anything of.
  int empty = 0;            ///< Parts without vertices.
  /// What the part with most to do has to do, over the mean weight: its own vertices, and for each
  /// ghost `ghost_cost` of a vertex.
  double slowest = 1;
};
/// An estimate: what a ghost costs, which is packed, sent and unpacked twice a step, of what a
/// phyxel with its neighbours does.
inline constexpr double ghost_cost = 0.3;

/// What the quality of a partition follows from, vertex by vertex; ranks may add their words.
class PartCounts {
 public:
  explicit PartCounts(int parts);
  /// A vertex of a part, and what it shares an edge with. Once for each vertex.
  /// @param others part and weight of the edge to each
  void add(int part, std::int64_t weight, std::span<const std::pair<int, std::int64_t>> others);
  std::span<std::int64_t> words() { return words_; }
  PartitionQuality quality() const;

 private:
  std::int64_t& weight(int part) { return words_[static_cast<std::size_t>(part)]; }
  std::int64_t& ghosts(int part) { return words_[static_cast<std::size_t>(parts_ + part)]; }
  std::int64_t& vertices(int part) { return words_[static_cast<std::size_t>(2 * parts_ + part)]; }
  std::int64_t& cut() { return words_[static_cast<std::size_t>(3 * parts_)]; }
  std::int64_t& needed(int part, int by) {
    return words_[static_cast<std::size_t>(3 * parts_ + 1) +
                  static_cast<std::size_t>(by) * static_cast<std::size_t>(parts_) +
                  static_cast<std::size_t>(part)];
  }
  int parts_;
  std::vector<std::int64_t> words_;
  std::vector<int> others_;  // of the vertex that is added
};

/// @param graph the phyxels' own, so that ghosts are phyxels whatever was cut
PartitionQuality quality_of(const Graph& graph, const std::vector<int>& part_of, int parts);

/// The part of each phyxel from that of its group.
std::vector<int> ungrouped(const std::vector<int>& part_of_group, const Groups& groups);

/// A partition of phyxels, and who made it.
struct ChosenPartition {
  Partitioner partitioner = Partitioner::metis;
  std::vector<int> part_of;
  PartitionQuality quality;
};

/// The partition whose slowest part has least to do; of equals the first candidate's. Partitioners
/// that refuse the graph are passed over, unless all do.
/// @param groups that stay whole, or null
/// @param candidates at least one
/// @throws InputError as `make_partition`
ChosenPartition choose_partition(const Graph& phyxels, const Groups* groups, int parts,
                                 const std::vector<Partitioner>& candidates);

}  // namespace phyxel
