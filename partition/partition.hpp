/// A graph cut into parts of equal weight: three ways behind one function. No ranks are needed.
#pragma once

#include <string>
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
  double imbalance = 0;         ///< Heaviest part over the mean, less one.
  std::int64_t cut = 0;         ///< Weight of edges between parts.
  std::int64_t ghosts = 0;      ///< Vertices that a part needs of others, over all parts.
  Index most_ghosts = 0;        ///< Of one part.
  int most_peers = 0;           ///< Parts that one part needs anything of.
  int empty = 0;                ///< Parts without vertices.
};

/// @param graph the phyxels' own, so that ghosts are phyxels whatever was cut
PartitionQuality quality_of(const Graph& graph, const std::vector<int>& part_of, int parts);

/// The part of each phyxel from that of its group.
std::vector<int> ungrouped(const std::vector<int>& part_of_group, const Groups& groups);

}  // namespace phyxel
