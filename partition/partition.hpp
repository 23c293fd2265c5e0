/// Partitions of a graph into parts of equal weight, by three methods.
#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include "partition/graph.hpp"

namespace phyxel {

enum class Partitioner {
  metis,      ///< Small edge cut: Karypis and Kumar 1998, METIS_PartGraphKway.
  curve,      ///< Equal sections of a Hilbert curve.
  bisection,  ///< Recursive coordinate bisection across the longest side.
};

/// The names "metis", "curve" and "bisection".
const std::vector<std::string>& partitioner_names();
std::string partitioner_name(Partitioner partitioner);
/// The partitioner of that name. @throws InputError for another name
Partitioner partitioner_of(const std::string& name);

/// The part of each vertex, 0 to parts - 1. No part is empty unless there are fewer vertices than
/// parts. The result is deterministic, but METIS's depends on its version and on the C library, so
/// that one rank partitions for all. Not thread-safe: METIS uses rand().
/// @throws InputError for fewer parts than one, and if the graph is too large for METIS's 32-bit
///   indices
std::vector<int> make_partition(const Graph& graph, int parts, Partitioner partitioner);

/// Quality measures of a partition.
struct PartitionQuality {
  double imbalance = 0;     ///< Weight of the heaviest part over the mean, minus one.
  std::int64_t cut = 0;     ///< Weight of edges between parts.
  std::int64_t ghosts = 0;  ///< Number of ghosts, summed over the parts.
  Index most_ghosts = 0;    ///< Largest number of ghosts of a part.
  int most_peers = 0;       ///< Largest number of parts that a part receives from.
  int empty = 0;            ///< Number of parts without vertices.
  /// Largest cost of a part over the mean weight: the weight of its vertices, and `ghost_cost` of a
  /// mean vertex for each ghost.
  double slowest = 1;
};
/// Estimated cost of a ghost, which is packed, sent and unpacked twice a step, relative to that of
/// a phyxel with its neighbours.
inline constexpr double ghost_cost = 0.3;

/// Counts from which the quality of a partition follows, accumulated vertex by vertex; the counts
/// of several ranks may be added.
class PartCounts {
 public:
  explicit PartCounts(int parts);
  /// Adds a vertex of a part; called once for each vertex.
  /// @param others part of the other end and weight of each of the vertex's edges
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
  std::vector<int> others_;  // parts of the neighbours of the vertex being added
};

/// The quality of a partition.
/// @param graph the dual graph of phyxels, so that ghosts are phyxels even if groups were cut
PartitionQuality quality_of(const Graph& graph, const std::vector<int>& part_of, int parts);

/// The part of each phyxel, from that of its group.
std::vector<int> ungrouped(const std::vector<int>& part_of_group, const Groups& groups);

/// A partition of phyxels and the partitioner that made it.
struct ChosenPartition {
  Partitioner partitioner = Partitioner::metis;
  std::vector<int> part_of;
  PartitionQuality quality;
};

/// The partition with the smallest `slowest` among the candidates; of equals, the first.
/// Partitioners that refuse the graph are skipped, unless all do.
/// @param groups groups that are not cut, or null
/// @param candidates at least one
/// @throws InputError as `make_partition`
ChosenPartition choose_partition(const Graph& phyxels, const Groups* groups, int parts,
                                 const std::vector<Partitioner>& candidates);

}  // namespace phyxel
