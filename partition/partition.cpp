#include "partition/partition.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <optional>

#include "model/space_filling_curve.hpp"
#include "partition/metis.hpp"
#include "phyxel/error.hpp"
#include "sort_unique.hpp"

namespace phyxel {
namespace {

/// Cuts an ordered list of vertices into parts of equal weight.
std::vector<int> cut_in_order(const Graph& graph, const std::vector<Index>& order, int parts) {
  std::vector<int> part_of(order.size());
  const auto n = static_cast<Index>(order.size());
  const double share = static_cast<double>(graph.total_weight()) / parts;
  double before = 0;
  int part = 0;
  Index in_part = 0;
  for (Index k = 0; k < n; ++k) {
    const auto weight = static_cast<double>(graph.vertex_weight[order[k]]);
    // A vertex belongs to the part whose share contains the middle of its weight, unless that would
    // leave this part or a later one without a vertex.
    const bool full = before + weight / 2 >= share * (part + 1) || n - k <= parts - 1 - part;
    if (in_part > 0 && part < parts - 1 && full) {
      ++part;
      in_part = 0;
    }
    part_of[order[k]] = part;
    ++in_part;
    before += weight;
  }
  return part_of;
}

class Bisection {
 public:
  Bisection(const Graph& graph, int parts) : graph_(graph), part_of_(graph.vertices(), 0) {
    std::vector<Index> all(static_cast<std::size_t>(graph.vertices()));
    std::iota(all.begin(), all.end(), 0);
    split(all.begin(), all.end(), 0, parts);
  }
  std::vector<int> result() && { return std::move(part_of_); }

 private:
  using Iterator = std::vector<Index>::iterator;

  void split(Iterator begin, Iterator end, int first_part, int parts) {
    if (parts == 1 || begin == end) {
      for (Iterator v = begin; v != end; ++v) part_of_[*v] = first_part;
      return;
    }
    const int lower = parts / 2;
    const int axis = longest_axis(begin, end);
    std::sort(begin, end, [&](Index a, Index b) {
      const double x = coordinate(a, axis), y = coordinate(b, axis);
      return x != y ? x < y : a < b;
    });
    const Iterator middle = cut_at(begin, end, lower, parts);
    split(begin, middle, first_part, lower);
    split(middle, end, first_part + lower, parts - lower);
  }
  /// The position before which the fraction `lower` / `parts` of the weight lies; both sides keep a
  /// vertex for each part if possible.
  Iterator cut_at(Iterator begin, Iterator end, int lower, int parts) const {
    double total = 0;
    for (Iterator v = begin; v != end; ++v) total += static_cast<double>(graph_.vertex_weight[*v]);
    const double wanted = total * lower / parts;
    double before = 0;
    Iterator middle = begin;
    for (; middle != end; ++middle) {
      const auto weight = static_cast<double>(graph_.vertex_weight[*middle]);
      if (before + weight / 2 >= wanted) break;
      before += weight;
    }
    const auto n = end - begin;
    const auto least = std::min<std::ptrdiff_t>(lower, n),
               most = std::max<std::ptrdiff_t>(n - (parts - lower), least);
    return begin + std::clamp(middle - begin, least, most);
  }
  int longest_axis(Iterator begin, Iterator end) const {
    int longest = 0;
    double extent = -1;
    for (int axis = 0; axis < 3; ++axis) {
      double low = coordinate(*begin, axis), high = low;
      for (Iterator v = begin; v != end; ++v) {
        low = std::min(low, coordinate(*v, axis));
        high = std::max(high, coordinate(*v, axis));
      }
      if (high - low > extent) {
        extent = high - low;
        longest = axis;
      }
    }
    return longest;
  }
  double coordinate(Index v, int axis) const {
    const Vec3d& x = graph_.centre[v];
    return axis == 0 ? x.x : axis == 1 ? x.y : x.z;
  }

  const Graph& graph_;
  std::vector<int> part_of_;
};

}  // namespace

const std::vector<std::string>& partitioner_names() {
  static const std::vector<std::string> names{"metis", "curve", "bisection"};
  return names;
}
std::string partitioner_name(Partitioner partitioner) {
  return partitioner_names()[static_cast<std::size_t>(partitioner)];
}
Partitioner partitioner_of(const std::string& name) {
  const auto& names = partitioner_names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) {
    throw InputError(fmt::format("partitioner \"{}\": unknown{}; allowed: {}", name,
                                 did_you_mean(name, names), fmt::join(names, ", ")));
  }
  return static_cast<Partitioner>(found - names.begin());
}

std::vector<int> make_partition(const Graph& graph, int parts, Partitioner partitioner) {
  if (parts < 1) throw InputError(fmt::format("{} parts: allowed: 1 or more", parts));
  const Index n = graph.vertices();
  if (parts == 1) return std::vector<int>(static_cast<std::size_t>(n), 0);
  if (partitioner == Partitioner::bisection) return Bisection(graph, parts).result();
  // With as many parts as vertices or more, METIS has no choice, and refuses.
  if (partitioner == Partitioner::metis && n > parts) return metis_partition(graph, parts);
  return cut_in_order(graph, curve_order(graph.centre, 0, n), parts);
}

PartCounts::PartCounts(int parts)
    : parts_(parts),
      words_(static_cast<std::size_t>(3 * parts + 1) +
             static_cast<std::size_t>(parts) * static_cast<std::size_t>(parts)) {}

void PartCounts::add(int part, std::int64_t own_weight,
                     std::span<const std::pair<int, std::int64_t>> others) {
  weight(part) += own_weight;
  ++vertices(part);
  others_.clear();
  for (const auto& [other, edge] : others) {
    if (other == part) continue;
    cut() += edge;
    others_.push_back(other);
  }
  sort_unique(others_);
  for (const int other : others_) {
    ++ghosts(other);
    ++needed(part, other);
  }
}

PartitionQuality PartCounts::quality() const {
  PartCounts counts = *this;
  PartitionQuality q;
  double total = 0, vertices = 0;
  for (int p = 0; p < parts_; ++p) {
    total += static_cast<double>(counts.weight(p));
    vertices += static_cast<double>(counts.vertices(p));
  }
  const double each = total / std::max(1.0, vertices), mean = total / parts_;
  q.cut = counts.cut() / 2;  // each edge was counted from both ends
  if (mean > 0) q.imbalance = -1, q.slowest = 0;
  for (int p = 0; p < parts_; ++p) {
    const auto weight = static_cast<double>(counts.weight(p));
    const std::int64_t ghosts = counts.ghosts(p);
    if (mean > 0) {
      q.imbalance = std::max(q.imbalance, weight / mean - 1);
      q.slowest =
          std::max(q.slowest, (weight + ghost_cost * each * static_cast<double>(ghosts)) / mean);
    }
    q.ghosts += ghosts;
    q.most_ghosts = std::max(q.most_ghosts, static_cast<Index>(ghosts));
    q.empty += counts.vertices(p) == 0;
    int peers = 0;
    for (int other = 0; other < parts_; ++other) peers += counts.needed(other, p) > 0;
    q.most_peers = std::max(q.most_peers, peers);
  }
  return q;
}

PartitionQuality quality_of(const Graph& graph, const std::vector<int>& part_of, int parts) {
  PartCounts counts(parts);
  std::vector<std::pair<int, std::int64_t>> others;
  for (Index v = 0; v < graph.vertices(); ++v) {
    others.clear();
    for (Offset e = graph.offsets[v]; e < graph.offsets[v + 1]; ++e) {
      others.emplace_back(part_of[graph.neighbours[e]], graph.weight_of_edge(e));
    }
    counts.add(part_of[v], graph.vertex_weight[v], others);
  }
  return counts.quality();
}

std::vector<int> ungrouped(const std::vector<int>& part_of_group, const Groups& groups) {
  std::vector<int> part_of;
  part_of.reserve(groups.of.size());
  for (const Index g : groups.of) part_of.push_back(part_of_group[g]);
  return part_of;
}

ChosenPartition choose_partition(const Graph& phyxels, const Groups* groups, int parts,
                                 const std::vector<Partitioner>& candidates) {
  const Graph coarse = groups ? grouped_graph(phyxels, *groups) : Graph{};
  std::optional<ChosenPartition> best;
  for (const Partitioner partitioner : candidates) {
    ChosenPartition made{partitioner, {}, {}};
    try {
      made.part_of = groups ? ungrouped(make_partition(coarse, parts, partitioner), *groups)
                            : make_partition(phyxels, parts, partitioner);
    } catch (const InputError&) {
      if (!best && partitioner == candidates.back()) throw;
      continue;
    }
    made.quality = quality_of(phyxels, made.part_of, parts);
    if (!best || made.quality.slowest < best->quality.slowest) best = std::move(made);
  }
  return std::move(*best);
}

}  // namespace phyxel
