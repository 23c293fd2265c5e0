#include "partition/metis.hpp"

#include <fmt/format.h>
#include <metis.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "phyxel/error.hpp"

namespace phyxel {
namespace {

/// Scales weights so that their sum fits METIS's integers; each stays at least one.
std::vector<idx_t> fitted(const std::vector<std::int64_t>& weights) {
  constexpr double most = static_cast<double>(std::numeric_limits<idx_t>::max()) / 4;
  double sum = 0;
  for (const std::int64_t w : weights) sum += static_cast<double>(w);
  const double scale = sum > most ? most / sum : 1;
  std::vector<idx_t> fit;
  fit.reserve(weights.size());
  for (const std::int64_t w : weights) {
    fit.push_back(
        std::max<idx_t>(1, static_cast<idx_t>(std::llround(scale * static_cast<double>(w)))));
  }
  return fit;
}

/// Gives each empty part the lightest vertex of the heaviest part: METIS may leave parts empty if
/// there are few vertices for each.
void fill_empty_parts(const Graph& graph, int parts, std::vector<int>& part_of) {
  std::vector<std::int64_t> weight = part_weights(graph, part_of, parts);
  std::vector<Index> count(static_cast<std::size_t>(parts), 0);
  for (const int part : part_of) ++count[part];
  for (int empty = 0; empty < parts; ++empty) {
    if (count[empty] > 0) continue;
    int heaviest = -1;
    for (int p = 0; p < parts; ++p) {
      if (count[p] > 1 && (heaviest < 0 || weight[p] > weight[heaviest])) heaviest = p;
    }
    Index lightest = -1;
    for (Index v = 0; v < graph.vertices(); ++v) {
      if (part_of[v] != heaviest) continue;
      if (lightest < 0 || graph.vertex_weight[v] < graph.vertex_weight[lightest]) lightest = v;
    }
    part_of[lightest] = empty;
    weight[heaviest] -= graph.vertex_weight[lightest];
    weight[empty] += graph.vertex_weight[lightest];
    --count[heaviest];
    ++count[empty];
  }
}

double largest_weight(const Graph& graph, const std::vector<int>& part_of, int parts) {
  const std::vector<std::int64_t> weight = part_weights(graph, part_of, parts);
  return static_cast<double>(*std::max_element(weight.begin(), weight.end()));
}

void check(int outcome, const Graph& graph) {
  if (outcome == METIS_OK) return;
  if (outcome == METIS_ERROR_MEMORY) {
    throw InputError(fmt::format(
        "METIS: not enough memory for {} vertices with {} entries; allowed: groups of phyxels "
        "instead of phyxels, or the partitioners curve and bisection",
        graph.vertices(), graph.offsets.back()));
  }
  throw Error(ExitCode::bad_input, fmt::format("METIS failed with code {}", outcome));
}

}  // namespace

std::vector<int> metis_partition(const Graph& graph, int parts) {
  constexpr auto most = static_cast<Offset>(std::numeric_limits<idx_t>::max());
  if (graph.offsets.back() > most) {
    throw InputError(
        fmt::format("METIS: {} entries of {} vertices; its {}-bit indices allow {}; allowed: "
                    "groups of phyxels instead of phyxels, or the partitioners curve and bisection",
                    graph.offsets.back(), graph.vertices(), 8 * sizeof(idx_t), most));
  }
  idx_t options[METIS_NOPTIONS];
  METIS_SetDefaultOptions(options);
  options[METIS_OPTION_SEED] = 1;
  options[METIS_OPTION_UFACTOR] = 10;  // 1%
  options[METIS_OPTION_NUMBERING] = 0;
  idx_t vertices = graph.vertices(), constraints = 1, wanted = parts, cut = 0;
  std::vector<idx_t> offsets(graph.offsets.begin(), graph.offsets.end());
  std::vector<idx_t> neighbours(graph.neighbours.begin(), graph.neighbours.end());
  std::vector<idx_t> vertex_weight = fitted(graph.vertex_weight),
                     edge_weight = fitted(graph.edge_weight);
  const auto cut_by = [&](auto* method) {
    std::vector<idx_t> part_of(static_cast<std::size_t>(vertices), 0);
    const int outcome =
        method(&vertices, &constraints, offsets.data(), neighbours.data(), vertex_weight.data(),
               nullptr, edge_weight.empty() ? nullptr : edge_weight.data(), &wanted, nullptr,
               nullptr, options, &cut, part_of.data());
    check(outcome, graph);
    std::vector<int> result(part_of.begin(), part_of.end());
    fill_empty_parts(graph, parts, result);
    return result;
  };
  std::vector<int> part_of = cut_by(METIS_PartGraphKway);
  // On disconnected bodies k-way partitioning misses its tolerance; recursive bisection keeps it.
  const std::int64_t heaviest =
      *std::max_element(graph.vertex_weight.begin(), graph.vertex_weight.end());
  const double fair = 1.01 * static_cast<double>(graph.total_weight()) / parts;
  if (largest_weight(graph, part_of, parts) > fair + static_cast<double>(heaviest)) {
    std::vector<int> halved = cut_by(METIS_PartGraphRecursive);
    if (largest_weight(graph, halved, parts) < largest_weight(graph, part_of, parts)) {
      part_of = std::move(halved);
    }
  }
  return part_of;
}

}  // namespace phyxel
