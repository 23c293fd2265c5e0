#include "mpi/build_share.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <optional>
#include <tuple>
#include <utility>

#include "exact_sum.hpp"
#include "model/assembly.hpp"
#include "model/cell_grid.hpp"
#include "model/cloud_piece.hpp"
#include "model/host_memory.hpp"
#include "model/neighbour_search.hpp"
#include "model/share_surveyor.hpp"
#include "model/space_filling_curve.hpp"
#include "model/spatial_hash.hpp"
#include "mpi/halo_transport.hpp"
#include "mpi/spread.hpp"
#include "parallel_sort.hpp"
#include "partition/share.hpp"
#include "scene/scene_error.hpp"
#include "shapes/lattice_shapes.hpp"
#include "stage.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// A little more than asked for, so that rounding leaves nothing out.
constexpr double margin = 1 + 1e-9;

/// @param digest of the whole cloud, if this rank has it
using Pieces = std::function<CloudPiece(std::size_t body, std::uint64_t& digest)>;

/// What all ranks know of a body.
struct Body {
  Index size = 0;   ///< Phyxels.
  Index base = 0;   ///< Number of its first one in the whole model.
  Index group = 0;  ///< Of its first one.
  Index tile = 0;
  Vec3d origin;
  bool kernel_volumes = false;
  std::vector<std::string> regions;  ///< Names; those used have the first bits.
  std::size_t used_regions = 0;
  double reach = 0;  ///< The largest support [m].
};

/// Own phyxels and those around: `whole` where `share_of` is concerned. Lists, unless they are left
/// to a device, are whole for own phyxels, and for all that are their neighbours.
struct Local {
  SpreadPhyxels phyxels;
  std::vector<int> owner;
  Model model;
  std::vector<Around> around;  ///< [body]
};

class Builder {
 public:
  Builder(const MpiCommunicator& ranks, const Scene& scene, const ShareOptions& options)
      : ranks_(ranks), scene_(scene), options_(options), bodies_(scene.bodies.size()) {}

  BuiltShare build(const Pieces& piece) {
    SpreadPhyxels own = in_stage("making phyxels", [&] { return make_pieces(piece); });
    boxes_ = boxes_of(ranks_, own, bodies_.size());
    count_bodies();
    own = in_stage("ordering along the curve", [&] {
      return spread_along_curve(ranks_, std::move(own), sizes(), boxes_, group_size_);
    });
    in_stage("spacings", [&] { find_spacings(own); });
    find_supports(own);
    Bulk<int> owner = in_stage("partition", [&] { return partition(own); });
    own = in_stage("sending to owners",
                   [&] { return sent_to_owners(ranks_, std::move(own), std::move(owner)); });
    Local local = in_stage("lists", [&] { return surroundings_of(std::move(own)); });
    in_stage("masses, moments, boundary, surfels", [&] { finish(local); });
    return in_stage("share", [&] { return share_out_of(local); });
  }

 private:
  std::vector<Index> sizes() const {
    std::vector<Index> sizes;
    for (const Body& body : bodies_) sizes.push_back(body.size);
    return sizes;
  }
  bool owns(const Local& local, std::size_t i) const { return local.owner[i] == ranks_.rank(); }

  // --- phyxels, as they are made -----------------------------------------------------------------

  SpreadPhyxels make_pieces(const Pieces& piece) {
    SpreadPhyxels own;
    surfaces_.resize(bodies_.size());
    std::vector<std::int64_t> with_volumes(bodies_.size());
    struct Origin {
      std::size_t body;
      Vec3d at;
    };
    std::vector<Origin> origins;
    std::uint64_t digest = 0;  // of what each rank has made or read for itself
    ranks_.together([&] {
      validate(scene_);
      for (std::size_t b = 0; b < bodies_.size(); ++b) {
        CloudPiece made = piece(b, digest);
        Cloud& cloud = made.cloud;
        if (!cloud.position.empty()) {
          naming(scene_.bodies[b], [&] { check_cloud(scene_.bodies[b], cloud); });
        }
        Body& body = bodies_[b];
        body.size = made.whole;
        with_volumes[b] = !cloud.volume.empty();
        if (made.first == 0 && !cloud.position.empty()) origins.push_back({b, cloud.position[0]});
        const std::vector<std::uint32_t> bits = region_bits(b, cloud);
        const std::size_t before = own.size(), more = cloud.position.size();
        own.resize(before + more);
#pragma omp parallel for schedule(static)
        for (std::size_t i = 0; i < more; ++i) {
          own[before + i] = {.position = cloud.position[i],
                             .volume = cloud.volume.empty() ? 0 : cloud.volume[i],
                             .body = static_cast<Index>(b),
                             .number = made.first + static_cast<Index>(i),
                             .regions = bits.empty() ? 0 : bits[i]};
        }
        surfaces_[b] = std::move(cloud.surface);
        for (std::string& warning : cloud.warnings) warnings_.push_back(std::move(warning));
      }
    });
    const auto alike = static_cast<std::int64_t>(digest);
    if (ranks_.smallest(alike) != ranks_.largest(alike)) {
      throw AgreedError(ExitCode::bad_input,
                        "the ranks have different bodies: allowed are the same files for all, on a "
                        "file system that all see");
    }
    ranks_.add(with_volumes);
    for (const Origin& origin : ranks_.gathered(std::span(std::as_const(origins)))) {
      bodies_[origin.body].origin = origin.at;
    }
    ranks_.together([&] {
      for (std::size_t b = 0; b < bodies_.size(); ++b) {
        check_terms(scene_.bodies[b]);
        if (scene_.bodies[b].closure > 0) {
          throw InputError(fmt::format(
              "{}: body \"{}\" has closed gradients (closure = {:g}), which one rank has to find: "
              "allowed are one rank, or closure = 0",
              scene_.bodies[b].where, scene_.bodies[b].name, scene_.bodies[b].closure));
        }
        if (!scene_.bodies[b].inclusions.empty()) {
          throw InputError(fmt::format(
              "{}: body \"{}\" has inclusions, which ranks cannot share: allowed is one rank",
              scene_.bodies[b].inclusions[0].select.where, scene_.bodies[b].name));
        }
        bodies_[b].kernel_volumes = wants_kernel_volumes(scene_.bodies[b], with_volumes[b] > 0,
                                                         static_cast<std::size_t>(bodies_[b].size));
      }
    });
    return own;
  }

  /// Of each phyxel of a piece; empty if the scene names no region.
  std::vector<std::uint32_t> region_bits(std::size_t b, const Cloud& cloud) {
    Body& body = bodies_[b];
    std::vector<std::uint32_t> bits;
    for (const Selection* selection : selections_of(scene_.bodies[b])) {
      if (!selection->region) continue;
      const auto found = cloud.regions.find(*selection->region);
      // One that is not there is refused once phyxels are chosen.
      if (found == cloud.regions.end() ||
          std::count(body.regions.begin(), body.regions.end(), found->first) > 0) {
        continue;
      }
      if (body.regions.size() == 32) {
        throw InputError(fmt::format(
            "{}: body \"{}\" has more than 32 regions that are fixed, moved or loaded: allowed "
            "are 32 where several ranks share it",
            selection->where, scene_.bodies[b].name));
      }
      bits.resize(cloud.position.size(), 0);
      for (const Index i : found->second) bits[i] |= std::uint32_t{1} << body.regions.size();
      body.regions.push_back(found->first);
    }
    body.used_regions = body.regions.size();
    for (const auto& [name, members] : cloud.regions) {
      if (std::count(body.regions.begin(), body.regions.end(), name) == 0) {
        body.regions.push_back(name);
      }
    }
    return bits;
  }

  /// Numbers, groups and tiles of bodies.
  void count_bodies() {
    Offset size = 0;
    for (const Body& body : bodies_) size += body.size;
    // At any time, with lists: those around and the copy that a share is included.
    ranks_.together([&] {
      require_host_memory("the scene", static_cast<double>(size),
                          (options_.surveyor ? 280.0 : 1700.0) / ranks_.size());
      std::int64_t places = 0;  // in tiles, of which bodies fill whole ones
      for (const Body& body : bodies_) places += count_of(body.size, options_.tile) * options_.tile;
      if (places > std::numeric_limits<Index>::max()) {
        throw InputError(fmt::format("the bodies fill {} places in tiles of {}: allowed are {}",
                                     places, options_.tile, std::numeric_limits<Index>::max()));
      }
    });
    const Index group = group_size(static_cast<Index>(size));
    Body next;
    for (Body& body : bodies_) {
      body.base = next.base;
      body.group = next.group;
      body.tile = next.tile;
      next.base += body.size;
      next.group += static_cast<Index>(count_of(body.size, group));
      next.tile += static_cast<Index>(count_of(body.size, options_.tile));
    }
    groups_ = next.group;
    group_size_ = group;
    size_ = static_cast<Index>(size);
  }
  /// Pieces of a length that hold `size`; none of no length.
  static std::int64_t count_of(std::int64_t size, std::int64_t length) {
    return length > 0 ? (size + length - 1) / length : 0;
  }
  Index group_size(Index size) const {
    const Index tile = std::max(1, options_.tile);
    const std::int64_t tiles = count_of(size, tile);
    return tile * std::max(1, static_cast<Index>(count_of(tiles, options_.most_groups)));
  }

  // --- supports ----------------------------------------------------------------------------------

  /// Asks farther and farther around until the nearest are there for sure.
  void find_spacings(SpreadPhyxels& own) {
    const std::size_t n = bodies_.size();
    const auto wants = [&](std::size_t b) {
      return !scene_.bodies[b].neighbourhood.radius || bodies_[b].kernel_volumes;
    };
    std::vector<double> reach(n, 0);
    bool any = false;
    for (std::size_t b = 0; b < n; ++b) {
      if (!wants(b) || bodies_[b].size < 2) continue;
      any = true;
      // Of evenly spread phyxels that would be half as far again as is needed.
      reach[b] = roomy_cell_size(boxes_[b].low, boxes_[b].high,
                                 static_cast<std::size_t>(bodies_[b].size)) *
                 1.6 * std::cbrt(scene_.bodies[b].neighbourhood.nearest / 10.0);
    }
    if (!any) return;
    for (;;) {
      const OthersPhyxels others = others_around(ranks_, own, reach, boxes_);
      std::vector<double> needed(n, 0);
      for (const auto& [first, last] : stretches_of_bodies(own)) {
        const auto b = static_cast<std::size_t>(own[first].body);
        if (!wants(b)) continue;
        const std::span<SpreadPhyxel> here = std::span(own).subspan(first, last - first);
        const std::span<const SpreadPhyxel> there = of_body(others.phyxels, b);
        const std::size_t size = here.size() + there.size();
        const Bulk<Vec3d> position = in_bulk(size, [&](std::size_t k) {
          return (k < here.size() ? here[k] : there[k - here.size()]).position;
        });
        const int nearest = scene_.bodies[b].neighbourhood.nearest;
        Bulk<double> farthest = in_bulk(size, [](std::size_t) { return 0.0; });
        const std::vector<double> spacing =
            options_.surveyor ? options_.surveyor->mean_spacing(position, nearest, farthest.data())
                              : mean_spacing(position, nearest, farthest.data());
        const auto enough = std::min<Index>(nearest + 1, bodies_[b].size);
        const bool too_few = static_cast<Index>(size) < enough;
        double most = 0;
#pragma omp parallel for schedule(static) reduction(max : most)
        for (std::size_t k = 0; k < here.size(); ++k) {
          here[k].spacing = spacing[k];
          most = std::max(most, too_few ? 2 * reach[b] + 1e-300 : farthest[k] * margin);
        }
        needed[b] = most;
      }
      needed = largest_of(ranks_, needed);
      bool done = true;
      for (std::size_t b = 0; b < n; ++b) {
        if (needed[b] <= reach[b]) continue;
        reach[b] = needed[b];
        done = false;
      }
      if (done) return;
    }
  }

  void find_supports(SpreadPhyxels& own) {
    std::vector<Bulk<double>> spacings(bodies_.size());
    const auto rule = [&](std::size_t b) -> const NeighbourhoodRule& {
      return scene_.bodies[b].neighbourhood;
    };
    const auto spacings_of = [&](std::size_t first, std::size_t last) {
      return in_bulk(last - first, [&](std::size_t k) { return own[first + k].spacing; });
    };
    const auto stretches = stretches_of_bodies(own);
    for (const auto& [first, last] : stretches) {
      const auto b = static_cast<std::size_t>(own[first].body);
      if (rule(b).radius || rule(b).support != NeighbourhoodRule::Support::uniform) continue;
      spacings[b] = spacings_of(first, last);
    }
    const std::vector<double> medians = medians_of(ranks_, spacings);
    std::vector<double> reach(bodies_.size(), 0);
    for (const auto& [first, last] : stretches) {
      const auto b = static_cast<std::size_t>(own[first].body);
      const std::vector<double> support =
          support_radii(spacings_of(first, last), rule(b), medians[b]);
      const std::size_t begin = first;  // for clang, whose OpenMP takes no bindings
      double most = 0;
#pragma omp parallel for schedule(static) reduction(max : most)
      for (std::size_t k = 0; k < support.size(); ++k) {
        own[begin + k].support = support[k];
        most = std::max(most, support[k]);
      }
      reach[b] = most;
    }
    reach = largest_of(ranks_, reach);
    for (std::size_t b = 0; b < bodies_.size(); ++b) bodies_[b].reach = reach[b];
  }

  // --- lists -------------------------------------------------------------------------------------

  OthersPhyxels others_within(const SpreadPhyxels& own, double supports) const {
    std::vector<double> reach;
    for (const Body& body : bodies_) reach.push_back(supports * margin * body.reach);
    return others_around(ranks_, own, reach, boxes_);
  }

  /// Those of one body, of phyxels that are in the order of bodies.
  static std::span<const SpreadPhyxel> of_body(const SpreadPhyxels& phyxels, std::size_t b) {
    const auto first_from = [&](std::size_t body) {
      return std::partition_point(phyxels.begin(), phyxels.end(), [&](const SpreadPhyxel& p) {
        return static_cast<std::size_t>(p.body) < body;
      });
    };
    return {first_from(b), first_from(b + 1)};
  }

  template <class T>
  static std::span<const typename T::value_type> of_part(const T& values, const Part& part) {
    return std::span(values).subspan(static_cast<std::size_t>(part.begin),
                                     static_cast<std::size_t>(part.end - part.begin));
  }

  /// As far as the neighbours of the last ghosts, and the carriers of surfels.
  Local surroundings_of(SpreadPhyxels own) const {
    Surrounded all = surrounded(ranks_, own, others_within(own, options_.rings + 1));
    release(own);
    Local local{std::move(all.phyxels), std::move(all.owner), {}};
    Model& m = local.model;
    ranks_.together([&] {
      m.position =
          tabulated(local.phyxels.size(), [&](std::size_t k) { return local.phyxels[k].position; });
      m.neighbourhood.support =
          tabulated(local.phyxels.size(), [&](std::size_t k) { return local.phyxels[k].support; });
      m.parts.resize(bodies_.size());
      for (std::size_t b = 0; b < bodies_.size(); ++b) m.parts[b].body = static_cast<Index>(b);
      for (const auto& [first, last] : stretches_of_bodies(local.phyxels)) {
        Part& part = m.parts[static_cast<std::size_t>(local.phyxels[first].body)];
        part.begin = static_cast<Index>(first);
        part.end = static_cast<Index>(last);
      }
      Index before = 0;
      for (std::size_t b = 0; b < bodies_.size(); ++b) {
        Part& part = m.parts[b];
        if (part.begin == part.end) part.begin = part.end = before;  // nobody is here
        before = part.end;
        const NeighbourhoodRule& rule = scene_.bodies[b].neighbourhood;
        if (options_.surveyor) {
          if (rule.one_sided()) m.neighbourhood.symmetric = false;
          continue;
        }
        const Neighbourhood hood = neighbours_within(of_part(m.position, part),
                                                     {m.neighbourhood.support.begin() + part.begin,
                                                      m.neighbourhood.support.begin() + part.end},
                                                     rule);
        append_lists(m.neighbourhood, hood, part.begin);
        std::copy(hood.support.begin(), hood.support.end(),
                  m.neighbourhood.support.begin() + part.begin);
      }
    });
    return local;
  }

  // --- parts -------------------------------------------------------------------------------------

  Index group_of(const SpreadPhyxel& p) const {
    return bodies_[p.body].group + p.along / group_size_;
  }

  /// Own phyxels that stand for all, and with whom they share edges.
  struct Samples {
    SpreadPhyxels phyxels;           ///< Of one group after the other.
    std::vector<Offset> offsets{0};  ///< In `group`, of each sample.
    std::vector<Index> group;        ///< Of who is at the other end of each edge.
    std::span<const Index> edges(std::size_t sample) const {
      return std::span(group).subspan(
          static_cast<std::size_t>(offsets[sample]),
          static_cast<std::size_t>(offsets[sample + 1] - offsets[sample]));
    }
  };

  /// The owner of each own phyxel. @param own along the curve
  Bulk<int> partition(const SpreadPhyxels& own) {
    const Samples samples = samples_of(own);
    const Graph graph = gathered_graph(samples);
    const int parts = ranks_.size();
    std::optional<PartitionQuality> best;
    std::vector<int> part_of;
    std::string refusal;
    for (const Partitioner candidate : options_.candidates) {
      std::vector<int> made;
      ranks_.together([&] {
        if (ranks_.rank() > 0) return;
        try {
          made = make_partition(graph, parts, candidate);
        } catch (const InputError& error) {
          refusal = error.what();
        }
      });
      // METIS takes random numbers from the C library: one rank's answer serves all.
      made = ranks_.broadcast(made);
      if (made.empty() && groups_ > 0) continue;
      const PartitionQuality quality = quality_of_groups(samples, made);
      if (best && quality.slowest >= best->slowest) continue;
      best = quality;
      part_of = std::move(made);
      partitioner_ = candidate;
    }
    ranks_.together([&] {
      if (!best) throw InputError(refusal);
    });
    quality_ = *best;
    return in_bulk(own.size(), [&](std::size_t i) { return part_of[group_of(own[i])]; });
  }

  /// Of each group the first, and then some: all if there are not too many.
  Samples samples_of(const SpreadPhyxels& own) const {
    const OthersPhyxels others = others_within(own, 1);
    const std::vector<Index> which = chosen(0, static_cast<Index>(own.size()), [&](Index i) {
      return own[i].along % group_size_ % sample_stride() == 0;
    });
    Samples samples;
    samples.phyxels = in_bulk(which.size(), [&](std::size_t s) { return own[which[s]]; });
    Bulk<std::pair<Index, Index>> edges;  // sample, group
    std::size_t first_sample = 0;
    for (const auto& [first, last] : stretches_of_bodies(own)) {
      const auto body = static_cast<std::size_t>(own[first].body);
      const std::span<const SpreadPhyxel> of_sampled = of_body(samples.phyxels, body);
      const auto position =
          in_bulk(of_sampled.size(), [&](std::size_t s) { return of_sampled[s].position; });
      const auto support =
          in_bulk(of_sampled.size(), [&](std::size_t s) { return of_sampled[s].support; });
      if (!of_sampled.empty()) {
        const SpatialHash hash(position, median_of(support));
        const double largest = *std::max_element(support.begin(), support.end());
        find_edges(std::span(own).subspan(first, last - first), of_sampled, hash, largest,
                   first_sample, edges);
        find_edges(of_body(others.phyxels, body), of_sampled, hash, largest, first_sample, edges);
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
  /// What samples share with so many phyxels, each of which looks for the samples around it: they
  /// are few.
  void find_edges(std::span<const SpreadPhyxel> phyxels, std::span<const SpreadPhyxel> samples,
                  const SpatialHash& hash, double largest, std::size_t first_sample,
                  Bulk<std::pair<Index, Index>>& edges) const {
#pragma omp parallel
    {
      Bulk<std::pair<Index, Index>> mine;
#pragma omp for schedule(static) nowait
      for (std::size_t k = 0; k < phyxels.size(); ++k) {
        const SpreadPhyxel& p = phyxels[k];
        const int rings = rings_within(std::max(p.support, largest), hash.cell_size());
        hash.visit_near(p.position, rings, [&](const SpatialHash::Entry& e) {
          const SpreadPhyxel& sample = samples[static_cast<std::size_t>(e.index)];
          const double h = std::max(p.support, sample.support);
          const Vec3d apart = p.position - e.position;
          if (dot(apart, apart) < h * h && p.number != sample.number) {
            mine.emplace_back(static_cast<Index>(first_sample) + e.index, group_of(p));
          }
        });
      }
#pragma omp critical
      edges.insert(edges.end(), mine.begin(), mine.end());
    }
  }
  Index sample_stride() const { return 1 + (size_ - 1) / options_.most_samples; }

  PartitionQuality quality_of_groups(const Samples& samples,
                                     const std::vector<int>& part_of) const {
    PartCounts counts(ranks_.size());
    std::vector<std::pair<int, std::int64_t>> others;
    for (std::size_t s = 0; s < samples.phyxels.size(); ++s) {
      others.clear();
      for (const Index group : samples.edges(s)) others.emplace_back(part_of[group], 1);
      counts.add(part_of[group_of(samples.phyxels[s])],
                 1 + static_cast<std::int64_t>(others.size()), others);
    }
    for (std::int64_t& word : counts.words()) word *= sample_stride();
    ranks_.add(counts.words());
    return counts.quality();
  }

  /// What own groups are, as the first rank gets to know it.
  struct GroupRecord {
    std::int64_t weight = 0;
    Vec3d centre;
    std::int64_t edges = 0;
  };
  struct EdgeRecord {
    Index other = 0;
    std::int64_t weight = 0;
  };

  /// Of all groups, on the first rank. An edge may have been seen by one end only.
  Graph gathered_graph(const Samples& samples) const {
    const auto each = static_cast<std::size_t>(ranks_.size());
    std::vector<std::vector<GroupRecord>> records(each);
    std::vector<std::vector<EdgeRecord>> edges(each);
    std::vector<Index> crossing;
    for (std::size_t first = 0, last = 0; first < samples.phyxels.size(); first = last) {
      const Index group = group_of(samples.phyxels[first]);
      crossing.clear();
      GroupRecord record;
      for (; last < samples.phyxels.size() && group_of(samples.phyxels[last]) == group; ++last) {
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
    records = ranks_.alltoallv(records);
    edges = ranks_.alltoallv(edges);
    if (ranks_.rank() > 0) return {};
    // Ranks have stretches of the curve, so that their groups follow each other.
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

  // --- the model around own phyxels --------------------------------------------------------------

  /// Over all ranks, in place.
  void total(const std::vector<ExactSum*>& sums) const {
    std::vector<std::int64_t> words;
    for (ExactSum* sum : sums) {
      const std::span<std::int64_t> ready = sum->ready();
      words.insert(words.end(), ready.begin(), ready.end());
    }
    ranks_.add(words);
    const std::int64_t* from = words.data();
    for (ExactSum* sum : sums) {
      std::copy_n(from, ExactSum::words, sum->ready().begin());
      from += ExactSum::words;
    }
  }

  void finish(Local& local) {
    Model& m = local.model;
    m.gravity = scene_.gravity;
    find_moments(m);
    ranks_.together([&] {
      for (std::size_t b = 0; b < bodies_.size(); ++b) look_around(local, b);
    });
    find_masses(local);
    describe_parts(local);
    add_boundary(local);
    gather_degenerate(local);
    add_surfels(local);
    std::size_t surfels = 0;
    for (const Surface& surface : surfaces_) surfels += surface.position.size();
    m.warnings = warnings_;
    add_warnings(m, surfels);
  }

  static void extend(std::vector<double>& values, std::vector<double>&& more) {
    if (values.empty()) {
      values = std::move(more);
    } else {
      values.insert(values.end(), more.begin(), more.end());
    }
  }
  static std::vector<double> values_of(const Local& local, const Part& part,
                                       double SpreadPhyxel::*value) {
    return tabulated(static_cast<std::size_t>(part.end - part.begin), [&](std::size_t k) {
      return local.phyxels[static_cast<std::size_t>(part.begin) + k].*value;
    });
  }

  void look_around(Local& local, std::size_t b) const {
    Model& m = local.model;
    const Part& part = m.parts[b];
    const std::vector<double> spacing = bodies_[b].kernel_volumes
                                            ? values_of(local, part, &SpreadPhyxel::spacing)
                                            : std::vector<double>();
    const auto own =
        in_bulk(static_cast<std::size_t>(part.end - part.begin), [&](std::size_t k) -> char {
          return owns(local, static_cast<std::size_t>(part.begin) + k);
        });
    if (options_.surveyor) {
      Around& around = local.around.emplace_back(options_.surveyor->around(
          of_part(m.position, part), of_part(m.neighbourhood.support, part), spacing, own,
          scene_.bodies[b].neighbourhood.one_sided()));
      append(m.degenerate, around.degenerate, part.begin);
      return;
    }
    const Neighbourhood& hood = m.neighbourhood;
    Around& around = local.around.emplace_back(around_by_lists(hood, part.begin, own));
    if (bodies_[b].kernel_volumes) {
      around.kernel_sum = kernel_sums(m.position, hood, spacing, part.begin);
    }
  }

  /// Of own phyxels. Others' follow from sums that only their owners have, if they are the
  /// kernel's.
  void find_masses(Local& local) const {
    Model& m = local.model;
    std::vector<ExactSum> sums(bodies_.size());
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      if (!bodies_[b].kernel_volumes) continue;
      const Part& part = m.parts[b];
      sums[b] = added_up<ExactSum>(part.begin, part.end, [&](ExactSum& sum, Index i) {
        if (!owns(local, static_cast<std::size_t>(i))) return;
        sum.add(local.around[b].kernel_sum[i - part.begin]);
      });
    }
    std::vector<ExactSum*> all;
    for (ExactSum& sum : sums) all.push_back(&sum);
    total(all);
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const Part& part = m.parts[b];
      const double density = scene_.bodies[b].material.density;
      Masses masses =
          bodies_[b].kernel_volumes
              ? kernel_masses(values_of(local, part, &SpreadPhyxel::spacing),
                              local.around[b].kernel_sum, sums[b].value() / bodies_[b].size,
                              density)
              : geometric_masses(values_of(local, part, &SpreadPhyxel::volume), density);
      extend(m.mass, std::move(masses.mass));
      extend(m.volume, std::move(masses.volume));
    }
  }

  void describe_parts(Local& local) const {
    Model& m = local.model;
    std::vector<BodySums> sums(bodies_.size());
    std::vector<ListLengths> lists(bodies_.size());
    std::vector<ExactSum*> all;
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const BodyRequest& request = scene_.bodies[b];
      Part& part = m.parts[b];
      part.name = request.name;
      part.material = request.material;
      part.material.hourglass = hourglass_of(request);
      part.neighbourhood = in_words(request.neighbourhood);
      part.kernel_volumes = bodies_[b].kernel_volumes;
      part.size = bodies_[b].size;
      part.surfels = static_cast<Index>(surfaces_[b].position.size());
      part.origin = bodies_[b].origin;
      part.farthest = boxes_[b].farthest();
      sums[b] = added_up<BodySums>(part.begin, part.end, [&](BodySums& sum, Index i) {
        if (owns(local, static_cast<std::size_t>(i))) {
          sum.add(m.mass[i], m.volume[i], m.position[i]);
        }
      });
      Offset pairs = 0;
      Index fewest = bodies_[b].size, most = 0;
#pragma omp parallel for schedule(static) reduction(+ : pairs) reduction(min : fewest) \
    reduction(max : most)
      for (Index i = part.begin; i < part.end; ++i) {
        if (!owns(local, static_cast<std::size_t>(i))) continue;
        const Index length = local.around[b].length[i - part.begin];
        pairs += length;
        fewest = std::min(fewest, length);
        most = std::max(most, length);
      }
      lists[b] = {pairs, fewest, most};
      BodySums& s = sums[b];
      all.insert(all.end(), {&s.mass, &s.volume, &s.moment.x, &s.moment.y, &s.moment.z});
    }
    total(all);
    const std::vector<ListLengths> of_ranks = ranks_.gathered(std::span(std::as_const(lists)));
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      Part& part = m.parts[b];
      sums[b].tell(part);
      part.lists.fewest = bodies_[b].size;
      for (std::size_t k = b; k < of_ranks.size(); k += bodies_.size()) {
        part.lists.pairs += of_ranks[k].pairs;
        part.lists.fewest = std::min(part.lists.fewest, of_ranks[k].fewest);
        part.lists.most = std::max(part.lists.most, of_ranks[k].most);
      }
    }
  }

  void add_boundary(Local& local) const {
    Model& m = local.model;
    std::vector<BoundaryChoice> choices(bodies_.size());
    std::vector<std::int64_t> counts;
    std::vector<ExactSum> masses;
    ranks_.together([&] {
      for (std::size_t b = 0; b < bodies_.size(); ++b) {
        if (selections_of(scene_.bodies[b]).empty()) continue;
        const Part& part = m.parts[b];
        const std::span<const SpreadPhyxel> here = of_part(local.phyxels, part);
        Cloud cloud;
        cloud.position = tabulated(here.size(), [&](std::size_t k) { return here[k].position; });
        auto number = tabulated(here.size(), [&](std::size_t k) { return here[k].number; });
        for (const std::string& name : bodies_[b].regions) cloud.regions[name];
        for (std::size_t r = 0; r < bodies_[b].used_regions; ++r) {
          std::vector<Index>& region = cloud.regions[bodies_[b].regions[r]];
          for (std::size_t k = 0; k < here.size(); ++k) {
            if (here[k].regions >> r & 1) region.push_back(static_cast<Index>(k));
          }
        }
        BoundaryChoice& choice = choices[b];
        // No phyxel here: an empty list of numbers would mean all.
        if (number.empty()) number.push_back(bodies_[b].size);
        choice = naming(scene_.bodies[b], [&] {
          return choose_boundary(scene_.bodies[b], cloud, number, bodies_[b].size);
        });
        BoundaryChoice own = choice;
        for (std::vector<Index>& chosen : own.chosen) {
          std::erase_if(chosen, [&](Index i) {
            return !owns(local, static_cast<std::size_t>(part.begin + i));
          });
        }
        for (const std::int64_t count : own.counts()) counts.push_back(count);
        for (const ExactSum& mass : own.loaded_masses(m, part.begin)) masses.push_back(mass);
      }
    });
    ranks_.add(counts);
    std::vector<ExactSum*> sums;
    for (ExactSum& mass : masses) sums.push_back(&mass);
    total(sums);
    ranks_.together([&] {
      auto count = counts.begin();
      auto mass = masses.begin();
      for (std::size_t b = 0; b < bodies_.size(); ++b) {
        const BodyRequest& request = scene_.bodies[b];
        const auto entries = static_cast<std::ptrdiff_t>(choices[b].chosen.size());
        naming(request, [&] {
          choices[b].refuse_empty(request, {count, count + entries}, boxes_[b]);
        });
        count += entries;
        std::vector<double> loaded;
        for (std::size_t l = 0; l < request.loads.size(); ++l) loaded.push_back((mass++)->value());
        naming(request, [&] { choices[b].add_to(m, request, m.parts[b].begin, loaded); });
      }
    });
  }

  /// Of own phyxels, by their numbers in the whole; then of all ranks.
  void gather_degenerate(Local& local) const {
    Degenerate& d = local.model.degenerate;
    for (std::vector<Index>* kind : {&d.isolated, &d.collinear, &d.coplanar, &d.coincident}) {
      std::vector<Index> own;
      for (const Index i : *kind) {
        if (owns(local, static_cast<std::size_t>(i))) own.push_back(number_of(local, i));
      }
      *kind = ranks_.gathered(std::span(std::as_const(own)));
      std::sort(kind->begin(), kind->end());
    }
  }
  Index number_of(const Local& local, Index i) const {
    return bodies_[local.phyxels[i].body].base + local.phyxels[i].number;
  }

  /// Surfels that this rank moves.
  void add_surfels(Local& local) {
    Model& m = local.model;
    Index base = 0;
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const Surface& surface = surfaces_[b];
      Part& part = m.parts[b];
      const auto all = static_cast<Index>(surface.position.size());
      part.surfel_begin = static_cast<Index>(surfel_number_.size());
      if (all > 0) {
        const auto size = static_cast<std::size_t>(part.end - part.begin);
        const auto begin = static_cast<std::size_t>(part.begin);
        const std::span<const Vec3d> position = std::span(m.position).subspan(begin, size);
        Csr rows = phyxels_reaching(surface.position, position,
                                    std::span(m.neighbourhood.support).subspan(begin, size));
        // Who has a surfel's first carrier knows all of them.
        std::vector<char> here(static_cast<std::size_t>(all), 0);
        std::int64_t found = 0;
        for (Index s = 0; s < all; ++s) {
          here[s] = rows.length(s) > 0 &&
                    owns(local, begin + static_cast<std::size_t>(rows.row(s).front()));
          found += here[s];
        }
        const std::vector<Index> nearest =
            ranks_.sum(found) < all ? carriers_of_unreached(local, b, here) : std::vector<Index>();
        for (Index s = 0; s < all; ++s) {
          const bool lone = !nearest.empty() && nearest[s] >= 0;
          if (!here[s] && !lone) continue;
          surfel_number_.push_back(base + s);
          m.surfels.position.push_back(surface.position[s]);
          m.surfels.normal.push_back(surface.normal[s]);
          if (lone) m.surfels.carriers.indices.push_back(nearest[s]);
          if (!lone) {
            for (const Index i : rows.row(s)) {
              m.surfels.carriers.indices.push_back(part.begin + i);
            }
          }
          m.surfels.carriers.offsets.push_back(
              static_cast<Offset>(m.surfels.carriers.indices.size()));
        }
      }
      part.surfel_end = static_cast<Index>(surfel_number_.size());
      base += all;
    }
  }

  /// For surfels beyond every support, of which the nearest phyxel is here: that phyxel; else -1.
  std::vector<Index> carriers_of_unreached(Local& local, std::size_t b,
                                           const std::vector<char>& here) const {
    const Surface& surface = surfaces_[b];
    const Part& part = local.model.parts[b];
    std::vector<std::int64_t> reached(here.begin(), here.end());
    ranks_.add(reached);
    std::vector<Vec3d> own;
    std::vector<Index> own_at;
    for (Index i = part.begin; i < part.end; ++i) {
      if (!owns(local, static_cast<std::size_t>(i))) continue;
      own.push_back(local.phyxels[i].position);
      own_at.push_back(i);
    }
    struct Nearest {
      double squared;
      std::int64_t number;  ///< In the whole model.
      bool operator<(const Nearest& other) const {
        return squared != other.squared ? squared < other.squared : number < other.number;
      }
    };
    std::vector<Index> unreached;
    for (std::size_t s = 0; s < reached.size(); ++s) {
      if (reached[s] == 0) unreached.push_back(static_cast<Index>(s));
    }
    std::vector<Index> at(unreached.size());
    std::vector<Nearest> nearest(unreached.size());
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t u = 0; u < unreached.size(); ++u) {
      const auto [squared, k] = nearest_to(surface.position[unreached[u]], own);
      at[u] = k < 0 ? -1 : own_at[k];
      nearest[u] = {squared, k < 0 ? INT64_MAX : number_of(local, own_at[k])};
    }
    local.model.surfels.unreached += static_cast<Index>(unreached.size());
    const std::vector<Nearest> of_ranks = ranks_.gathered(std::span(std::as_const(nearest)));
    std::vector<Index> carriers(reached.size(), -1);
    for (std::size_t u = 0; u < unreached.size(); ++u) {
      bool first = at[u] >= 0;
      for (std::size_t k = u; k < of_ranks.size(); k += unreached.size()) {
        if (of_ranks[k] < nearest[u]) first = false;
      }
      if (first) carriers[unreached[u]] = at[u];
    }
    return carriers;
  }

  // --- the share ---------------------------------------------------------------------------------

  /// Calls visit(j) for all that i needs, or that need i; some twice.
  template <class Visit>
  static void visit_edges(const Neighbourhood& hood, Index i, Visit&& visit) {
    for (const Index j : hood.neighbours.row(i)) visit(j);
    if (hood.symmetric) return;
    for (const Index j : hood.inverse().row(i)) visit(j);
  }

  /// What the ring needs, and what needs the ring, that is not there yet.
  static std::vector<Index> around_ring(const Local& local, const PartHalo& plan) {
    std::vector<char> seen(local.phyxels.size(), 0);
    for (const Index i : plan.owned) seen[i] = 1;
    for (const Index i : plan.rings[0]) seen[i] = 1;
    std::vector<Index> ring;
    for (const Index i : plan.rings[0]) {
      visit_edges(local.model.neighbourhood, i, [&](Index j) {
        if (!std::exchange(seen[j], 1)) ring.push_back(j);
      });
    }
    std::sort(ring.begin(), ring.end());
    return ring;
  }

  BuiltShare share_out_of(Local& local) {
    PartHalo plan;
    plan.part = ranks_.rank();
    const auto n = static_cast<Index>(local.phyxels.size());
    const auto own = [&](Index i) { return owns(local, static_cast<std::size_t>(i)); };
    plan.owned = chosen(0, n, own);
    std::vector<Index>& ring = plan.rings.emplace_back();
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const Part& part = local.model.parts[b];
      const std::vector<Index> needed = chosen(part.begin, part.end, [&](Index i) {
        return !own(i) && local.around[b].needed[i - part.begin];
      });
      ring.insert(ring.end(), needed.begin(), needed.end());
    }
    if (options_.rings == 2) plan.rings.push_back(around_ring(local, plan));
    ModelShare made = share_of(local.model, plan, local.owner);
    Share& share = made.share;
    std::vector<Index> place = own_places(local, share);
    share.whole = size_;
    share.number = tabulated(share.number.size(),
                             [&](std::size_t k) { return number_of(local, share.number[k]); });
    for (Index& surfel : share.surfel_number) surfel = surfel_number_[surfel];
    connect(ranks_, made);
    const auto from_owners = [&](auto& values) {
      constexpr std::size_t bytes = sizeof(values[0]);
      share.transport->start(Records{reinterpret_cast<std::byte*>(values.data()), bytes, bytes});
      share.transport->finish();
    };
    if (options_.tile > 0) {
      from_owners(place);
      share.place = std::move(place);
    }
    from_owners(made.model.mass);
    from_owners(made.model.volume);
    return {model_of(std::move(made)), partitioner_, quality_, std::move(surfaces_)};
  }

  /// Where own phyxels of a share are in the whole model's tiles.
  /// @param share its numbers are those of `local`
  std::vector<Index> own_places(const Local& local, const Share& share) const {
    std::vector<Index> place(share.number.size(), -1);
    if (options_.tile == 0) return place;
    const auto phyxel = [&](Index k) -> const SpreadPhyxel& {
      return local.phyxels[share.number[k]];
    };
    // body, along, which of the share
    const std::vector<Index> owned =
        chosen(0, static_cast<Index>(place.size()), [&](Index k) { return share.owned[k]; });
    auto sorted = in_bulk(owned.size(), [&](std::size_t k) {
      const SpreadPhyxel& p = phyxel(owned[k]);
      return std::tuple(p.body, p.along, owned[k]);
    });
    parallel_sort(sorted);
    auto own = in_bulk(sorted.size(), [&](std::size_t k) { return std::get<2>(sorted[k]); });
    const auto tile_of = [&](std::size_t k) {
      return bodies_[std::get<0>(sorted[k])].tile + std::get<1>(sorted[k]) / options_.tile;
    };
    const auto n = static_cast<Index>(own.size());
    std::vector<Index> begin = chosen(0, n, [&](Index k) {  // of each tile
      const auto at = static_cast<std::size_t>(k);
      return at == 0 || tile_of(at) != tile_of(at - 1);
    });
    begin.push_back(n);
#pragma omp parallel for schedule(dynamic, 64)
    for (std::size_t t = 0; t < begin.size() - 1; ++t) {
      const auto first = static_cast<std::size_t>(begin[t]);
      const auto last = static_cast<std::size_t>(begin[t + 1]);
      order_in_tile(std::span(own).subspan(first, last - first), [&](Index k) {
        const Index i = share.number[k], b = phyxel(k).body;
        return local.around[b].length[i - local.model.parts[b].begin];
      });
      for (std::size_t k = first; k < last; ++k) {
        place[own[k]] = tile_of(first) * options_.tile + static_cast<Index>(k - first);
      }
    }
    return place;
  }

  const MpiCommunicator& ranks_;
  const Scene& scene_;
  const ShareOptions& options_;
  std::vector<Body> bodies_;
  std::vector<Box> boxes_;
  std::vector<Surface> surfaces_;
  Index size_ = 0;  // of the whole
  Index groups_ = 0, group_size_ = 1;
  Partitioner partitioner_ = Partitioner::metis;
  PartitionQuality quality_;
  std::vector<std::string> warnings_;  // of the clouds, which every rank makes: alike on all
  std::vector<Index> surfel_number_;   // of the surfels that this rank moves, in the whole model
};

/// Bodies begin on one rank after the other, so that small ones are not all the first one's.
Piece piece_of(const MpiCommunicator& ranks, std::size_t body) {
  const auto size = static_cast<std::size_t>(ranks.size());
  return {static_cast<int>((static_cast<std::size_t>(ranks.rank()) + body) % size), ranks.size()};
}

}  // namespace

BuiltShare build_share(const MpiCommunicator& ranks, const Scene& scene,
                       const ShareOptions& options) {
  // Copies of a body follow one another; making one serves them all.
  const BodySource* made = nullptr;
  Cloud rest;
  const auto piece_of_source = [&](const BodyRequest& request, Piece piece, std::uint64_t& digest) {
    CloudPiece cut;
    if (const auto lattice = lattice_of(request.source, piece)) {
      cut = make_lattice_shape(*lattice, piece);
    } else {
      if (!made || !(*made == request.source)) {
        rest = rest_cloud(request.source);
        digest = 31 * digest + cloud_digest(rest);
      }
      made = &request.source;
      cut = cut_piece(rest, piece);
      cut.cloud.warnings = std::exchange(rest.warnings, {});  // once for all copies
    }
    place(cut.cloud, request);
    return cut;
  };
  return naming(scene, [&] {
    return Builder(ranks, scene, options).build([&](std::size_t b, std::uint64_t& digest) {
      const BodyRequest& request = scene.bodies[b];
      return naming(request, [&] { return piece_of_source(request, piece_of(ranks, b), digest); });
    });
  });
}

BuiltShare build_share(const MpiCommunicator& ranks, const Scene& scene,
                       const std::vector<Cloud>& clouds, const ShareOptions& options) {
  return naming(scene, [&] {
    if (clouds.size() != scene.bodies.size()) {
      throw AgreedError(ExitCode::bad_input,
                        fmt::format("{} clouds for a scene of {} bodies: one each is allowed",
                                    clouds.size(), scene.bodies.size()));
    }
    return Builder(ranks, scene, options).build([&](std::size_t b, std::uint64_t& digest) {
      digest = 31 * digest + cloud_digest(clouds[b]);
      CloudPiece cut = cut_piece(clouds[b], piece_of(ranks, b));
      cut.cloud.warnings = clouds[b].warnings;
      return cut;
    });
  });
}

}  // namespace phyxel
