#include <algorithm>
#include <iterator>
#include <optional>
#include <tuple>
#include <utility>

#include "model/graded_hash.hpp"
#include "mpi/share_pipeline.hpp"
#include "parallel_sort.hpp"
#include "phyxel/error.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// A sample of own phyxels, and the groups of their neighbours: edges of the dual graph.
struct Samples {
  MigratingPhyxels phyxels;        ///< Samples, group by group.
  std::vector<Offset> offsets{0};  ///< First entry of each sample in `group`.
  std::vector<Index> group;        ///< Group of the neighbour at the other end of each edge.
  std::span<const Index> edges(std::size_t sample) const {
    return std::span(group).subspan(
        static_cast<std::size_t>(offsets[sample]),
        static_cast<std::size_t>(offsets[sample + 1] - offsets[sample]));
  }
};

Index sample_stride(const ShareSetup& setup, const WholeBodies& whole) {
  return 1 + (whole.size - 1) / setup.options.most_samples;
}

/// Finds the edges of samples by a search from all phyxels for the samples around them, since
/// samples are few.
void find_edges(const WholeBodies& whole, std::span<const MigratingPhyxel> phyxels,
                std::span<const MigratingPhyxel> samples, const GradedHash& hash,
                std::size_t first_sample, Bulk<std::pair<Index, Index>>& edges) {
  const auto reach = [&](const MigratingPhyxel& p, double other) {
    const bool pairwise = whole.bodies[static_cast<std::size_t>(p.body)].rule.pairwise();
    return pairwise ? pair_support(p.support, other) : std::max(p.support, other);
  };
#pragma omp parallel
  {
    Bulk<std::pair<Index, Index>> mine;
#pragma omp for schedule(static) nowait
    for (std::size_t k = 0; k < phyxels.size(); ++k) {
      const MigratingPhyxel& p = phyxels[k];
      hash.visit_ball(
          p.position, [&](double largest) { return reach(p, largest); },
          [&](const GradedHash::Entry& e) {
            const MigratingPhyxel& sample = samples[static_cast<std::size_t>(e.index)];
            const double h = reach(p, sample.support);
            const Vec3d apart = p.position - e.position;
            if (dot(apart, apart) < h * h && p.number != sample.number) {
              mine.emplace_back(static_cast<Index>(first_sample) + e.index, whole.group_of(p));
            }
          });
    }
#pragma omp critical
    edges.insert(edges.end(), mine.begin(), mine.end());
  }
}
/// Chooses the first phyxel of each group and some of the others; all, if there are few enough.
Samples samples_of(const ShareSetup& setup, const WholeBodies& whole, const MigratingPhyxels& own) {
  const RemotePhyxels others = remote_phyxels_within(setup, whole, own, 1);
  const std::vector<Index> which = chosen(0, static_cast<Index>(own.size()), [&](Index i) {
    return own[i].along % whole.group_size % sample_stride(setup, whole) == 0;
  });
  Samples samples;
  samples.phyxels = in_bulk(which.size(), [&](std::size_t s) { return own[which[s]]; });
  Bulk<std::pair<Index, Index>> edges;  // sample, group
  std::size_t first_sample = 0;
  for (const auto& [first, last] : ranges_of_bodies(own)) {
    const auto body = static_cast<std::size_t>(own[first].body);
    const std::span<const MigratingPhyxel> of_sampled = of_body(samples.phyxels, body);
    const auto position =
        in_bulk(of_sampled.size(), [&](std::size_t s) { return of_sampled[s].position; });
    const auto support =
        in_bulk(of_sampled.size(), [&](std::size_t s) { return of_sampled[s].support; });
    if (!of_sampled.empty()) {
      const GradedHash hash(position, support);
      find_edges(whole, std::span(own).subspan(first, last - first), of_sampled, hash, first_sample,
                 edges);
      find_edges(whole, of_body(others.phyxels, body), of_sampled, hash, first_sample, edges);
    }
    first_sample += of_sampled.size();
  }
  parallel_sort(edges);
  samples.group = tabulated(edges.size(), [&](std::size_t e) { return edges[e].second; });
  std::vector<Offset> length(samples.phyxels.size(), 0);
  for (const auto& [sample, group] : edges) ++length[sample];
  for (const Offset more : length) samples.offsets.push_back(samples.offsets.back() + more);
  return samples;
}
PartitionQuality quality_of_groups(const ShareSetup& setup, const WholeBodies& whole,
                                   const Samples& samples, const std::vector<int>& part_of) {
  PartCounts counts(setup.ranks.size());
  std::vector<std::pair<int, std::int64_t>> others;
  for (std::size_t s = 0; s < samples.phyxels.size(); ++s) {
    others.clear();
    for (const Index group : samples.edges(s)) others.emplace_back(part_of[group], 1);
    counts.add(part_of[whole.group_of(samples.phyxels[s])],
               1 + static_cast<std::int64_t>(others.size()), others);
  }
  for (std::int64_t& word : counts.words()) word *= sample_stride(setup, whole);
  setup.ranks.add(counts.words());
  return counts.quality();
}

/// A rank's groups, as they are sent to the first rank.
struct GroupRecord {
  std::int64_t weight = 0;
  Vec3d centre;
  std::int64_t edges = 0;
};
struct EdgeRecord {
  Index other = 0;
  std::int64_t weight = 0;
};

/// Makes the graph of all groups, on the first rank. An edge may be known from one end only.
Graph gathered_graph(const MpiCommunicator& ranks, const WholeBodies& whole,
                     const Samples& samples) {
  const auto each = static_cast<std::size_t>(ranks.size());
  std::vector<std::vector<GroupRecord>> records(each);
  std::vector<std::vector<EdgeRecord>> edges(each);
  std::vector<Index> crossing;
  for (std::size_t first = 0, last = 0; first < samples.phyxels.size(); first = last) {
    const Index group = whole.group_of(samples.phyxels[first]);
    crossing.clear();
    GroupRecord record;
    for (; last < samples.phyxels.size() && whole.group_of(samples.phyxels[last]) == group;
         ++last) {
      record.centre += samples.phyxels[last].position;
      const std::span<const Index> others = samples.edges(last);
      record.weight += 1 + static_cast<std::int64_t>(others.size());
      std::copy_if(others.begin(), others.end(), std::back_inserter(crossing),
                   [&](Index other) { return other != group; });
    }
    record.centre = 1.0 / static_cast<double>(last - first) * record.centre;
    std::sort(crossing.begin(), crossing.end());
    for (std::size_t k = 0; k < crossing.size(); ++k) {
      if (k == 0 || crossing[k] != crossing[k - 1]) {
        edges[0].push_back({crossing[k], 0});
        ++record.edges;
      }
      ++edges[0].back().weight;
    }
    records[0].push_back(record);
  }
  records = ranks.alltoallv(records);
  edges = ranks.alltoallv(edges);
  if (ranks.rank() > 0) return {};
  // Each rank has a contiguous range of the curve, so that its groups follow those of the rank
  // before.
  Graph graph;
  std::vector<std::tuple<Index, Index, std::int64_t>> both_ways;
  for (std::size_t r = 0; r < each; ++r) {
    std::size_t e = 0;
    for (const GroupRecord& record : records[r]) {
      const Index group = graph.vertices();
      graph.vertex_weight.push_back(record.weight);
      graph.centre.push_back(record.centre);
      for (std::int64_t k = 0; k < record.edges; ++k, ++e) {
        both_ways.emplace_back(group, edges[r][e].other, edges[r][e].weight);
        both_ways.emplace_back(edges[r][e].other, group, edges[r][e].weight);
      }
    }
  }
  parallel_sort(both_ways);
  std::size_t at = 0;
  for (Index group = 0; group < graph.vertices(); ++group) {
    for (; at < both_ways.size() && std::get<0>(both_ways[at]) == group; ++at) {
      const auto& [from, to, weight] = both_ways[at];
      if (static_cast<Offset>(graph.neighbours.size()) > graph.offsets.back() &&
          graph.neighbours.back() == to) {
        graph.edge_weight.back() += weight;
      } else {
        graph.neighbours.push_back(to);
        graph.edge_weight.push_back(weight);
      }
    }
    graph.offsets.push_back(static_cast<Offset>(graph.neighbours.size()));
  }
  return graph;
}

}  // namespace

/// Returns the new owner of each phyxel. @param own phyxels in the order of the curve
Cut partition(const ShareSetup& setup, const WholeBodies& whole, const MigratingPhyxels& own) {
  Cut cut;
  const Samples samples = samples_of(setup, whole, own);
  const Graph graph = gathered_graph(setup.ranks, whole, samples);
  const int parts = setup.ranks.size();
  std::optional<PartitionQuality> best;
  std::vector<int> part_of;
  std::string refusal;
  for (const Partitioner candidate : setup.options.candidates) {
    std::vector<int> made;
    setup.ranks.collectively([&] {
      if (setup.ranks.rank() > 0) return;
      try {
        made = make_partition(graph, parts, candidate);
      } catch (const InputError& error) {
        refusal = error.what();
      }
    });
    // METIS takes random numbers from the C library, so that only one rank runs it.
    made = setup.ranks.broadcast(made);
    if (made.empty() && whole.groups > 0) continue;
    const PartitionQuality quality = quality_of_groups(setup, whole, samples, made);
    if (best && quality.slowest >= best->slowest) continue;
    best = quality;
    part_of = std::move(made);
    cut.partitioner = candidate;
  }
  setup.ranks.collectively([&] {
    if (!best) throw InputError(refusal);
  });
  cut.quality = *best;
  cut.owner = in_bulk(own.size(), [&](std::size_t i) { return part_of[whole.group_of(own[i])]; });
  return cut;
}

}  // namespace phyxel
