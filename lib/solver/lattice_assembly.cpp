/// The stiffness of the finest lattice behind a body, from that of its phyxels, cell by cell.
#include <algorithm>
#include <cmath>
#include <utility>

#include "model/lists_from_pairs.hpp"
#include "solver/body_lattices.hpp"
#include "solver/on_axes.hpp"

namespace phyxel {
namespace {

constexpr std::size_t numbers = LatticeLevel::around * 9;

}  // namespace

/// 1 along the axes along which a node moves: those along which no phyxel near it is held, so that
/// held ones stay where they are.
std::vector<Vec3d> BodyLattices::free_nodes(std::span<const Vec3d> free) const {
  constexpr float counts = 0.01F;  // hat
  const Index nodes = levels_.front().size();
  std::vector<std::int64_t> held(3 * static_cast<std::size_t>(nodes), 0);
  for (std::size_t e = 0; e < node_.size(); ++e) {
    if (hat_[e] < counts) continue;
    const Vec3d f = free[sources_[e / 8].phyxel];
    const auto at = 3 * static_cast<std::size_t>(node_[e]);
    held[at] += f.x == 0;
    held[at + 1] += f.y == 0;
    held[at + 2] += f.z == 0;
  }
  add_over_ranks(held);
  std::vector<Vec3d> found(static_cast<std::size_t>(nodes));
  for (std::size_t a = 0; a < found.size(); ++a) {
    const auto is_free = [&](std::size_t axis) { return held[3 * a + axis] == 0 ? 1.0 : 0.0; };
    found[a] = {is_free(0), is_free(1), is_free(2)};
  }
  return found;
}

void BodyLattices::find_cells() {
  const LatticeLevel& finest = levels_.front();
  std::vector<std::pair<std::uint64_t, Index>> order;
  for (std::size_t p = 0; p < sources_.size(); ++p) {
    const LatticeCell cell(finest.lattice(), sources_[p].place);
    order.emplace_back(finest.lattice().key(cell.node[0]), static_cast<Index>(p));
  }
  std::sort(order.begin(), order.end());
  const auto layers = static_cast<std::size_t>(finest.lattice().count.x);
  layer_start_.assign(layers + 1, 0);
  std::vector<std::pair<Index, Index>> of_nodes;
  for (std::size_t k = 0; k < order.size(); ++k) {
    const auto [key, p] = order[k];
    source_.push_back(p);
    if (k > 0 && order[k - 1].first == key) continue;
    const auto cell = static_cast<Index>(cell_node_.size());
    source_start_.push_back(static_cast<Offset>(k));
    const Index* nodes = &node_[8 * static_cast<std::size_t>(p)];
    std::array<Index, 8>& own = cell_node_.emplace_back();
    for (int c = 0; c < 8; ++c) {
      own[static_cast<std::size_t>(c)] = nodes[c];
      of_nodes.emplace_back(nodes[c], 8 * cell + c);
    }
    ++layer_start_[static_cast<std::size_t>(finest.lattice().node(key).x) + 1];
  }
  source_start_.push_back(static_cast<Offset>(order.size()));
  for (std::size_t l = 0; l < layers; ++l) layer_start_[l + 1] += layer_start_[l];
  group(static_cast<std::size_t>(finest.size()), of_nodes, cell_start_, cell_);
}

namespace {

constexpr std::size_t unknowns = 24;  // of a cell

/// Adds the stiffness of a phyxel to that of its cell, blocks above the diagonal alone. Values
/// times `by` are rounded to whole numbers.
void add_phyxel(const Lattice& lattice, const BodyLattices::Source& source,
                const BodyLattices::Present& present, double by, double* cell) {
  const LatticeCell at(lattice, source.place);
  Mat3d f = identity<double>();
  if (!present.gradient.empty()) f = f + present.gradient[source.phyxel];
  const Mat3d square = f * transpose(f);
  double x[unknowns];  // F ∇N
  for (std::size_t a = 0; a < 8; ++a) {
    const Vec3d turned = f * at.slope[a];
    x[3 * a] = turned.x, x[3 * a + 1] = turned.y, x[3 * a + 2] = turned.z;
  }
  const double lambda = by * source.volume * source.lambda;
  const double mu = by * source.volume * source.mu;
  for (std::size_t a = 0; a < 8; ++a) {
    for (std::size_t b = a; b < 8; ++b) {
      const double both = mu * dot(at.slope[a], at.slope[b]);
      const double hats = present.more.empty() ? 0 : by * at.hat[a] * at.hat[b];
      for (std::size_t i = 0; i < 3; ++i) {
        for (std::size_t k = 0; k < 3; ++k) {
          const int r = static_cast<int>(i), c = static_cast<int>(k);
          double value = lambda * x[3 * a + i] * x[3 * b + k] + mu * x[3 * b + i] * x[3 * a + k] +
                         both * square(r, c);
          if (hats > 0) value += hats * present.more[source.phyxel](r, c);
          cell[(3 * a + i) * unknowns + 3 * b + k] += std::rint(value);
        }
      }
    }
  }
}

}  // namespace

std::vector<double> BodyLattices::stiffness_of_cells(int layer, const Present& present,
                                                     double by) const {
  const auto at = static_cast<std::size_t>(layer);
  const Offset begin = layer_start_[at], end = layer_start_[at + 1];
  std::vector<double> all(static_cast<std::size_t>(end - begin) * unknowns * unknowns, 0);
#pragma omp parallel for schedule(dynamic, 8)
  for (Offset c = begin; c < end; ++c) {
    double* own = all.data() + static_cast<std::size_t>(c - begin) * unknowns * unknowns;
    for (Offset s = source_start_[c]; s < source_start_[c + 1]; ++s) {
      add_phyxel(levels_.front().lattice(), sources_[source_[s]], present, by, own);
    }
  }
  return all;
}

/// No entry of the stiffness of a phyxel is larger, on any rank.
double BodyLattices::largest_entry(const Present& present) const {
  const double spacing = levels_.front().lattice().spacing;
  double largest = 0;
  for (const Source& source : sources_) {
    Mat3d f = identity<double>();
    if (!present.gradient.empty()) f = f + present.gradient[source.phyxel];
    double squares = 0, more = 0;
    for (int e = 0; e < 9; ++e) {
      squares += f(e / 3, e % 3) * f(e / 3, e % 3);
      if (!present.more.empty()) more += std::abs(present.more[source.phyxel](e / 3, e % 3));
    }
    // No slope is longer than 2 over the spacing.
    const double moduli = std::abs(source.lambda) + 2 * source.mu;
    largest = std::max(largest, 4 * source.volume * moduli * squares / (spacing * spacing) + more);
  }
  return ranks_ ? ranks_->largest(largest) : largest;
}

/// Adds the stiffness of a cell to the blocks of one of its nodes.
/// @param cell its number times 8, plus the place of the node in it
void BodyLattices::add_cell(Index node, Index cell, const double* matrix,
                            std::int64_t* blocks) const {
  const LatticeLevel& finest = levels_.front();
  const Vec3<int> at = finest.node(node);
  const auto corner = static_cast<std::size_t>(cell % 8);
  for (std::size_t b = 0; b < 8; ++b) {
    const Vec3<int> other = finest.node(cell_node_[cell / 8][b]);
    const int place = LatticeLevel::place_around({other.x - at.x, other.y - at.y, other.z - at.z});
    for (std::size_t e = 0; e < 9; ++e) {
      const std::size_t r = e / 3, c = e % 3;
      const double value = corner <= b ? matrix[(3 * corner + r) * unknowns + 3 * b + c]
                                       : matrix[(3 * b + c) * unknowns + 3 * corner + r];
      blocks[static_cast<std::size_t>(place) * 9 + e] += static_cast<std::int64_t>(value);
    }
  }
}

// Layer by layer, so that the stiffness of few cells is kept at a time.
void BodyLattices::assemble(std::span<const Vec3d> free, const Present& present) {
  LatticeLevel& finest = levels_.front();
  const double largest = largest_entry(present);
  const double by = largest > 0 ? std::ldexp(1, 52) / (largest * most_) : 1;
  const std::vector<Vec3d> free_axes = free_nodes(free);
  std::vector<double> before, here;
  Index node = 0;
  for (int layer = 0; layer < finest.lattice().count.x; ++layer) {
    before.swap(here);
    here = stiffness_of_cells(layer, present, by);
    const Index begin = node;
    while (node < finest.size() && finest.node(node).x == layer) ++node;
    std::vector<std::int64_t> sums(static_cast<std::size_t>(node - begin) * numbers, 0);
#pragma omp parallel for schedule(dynamic, 16)
    for (Index a = begin; a < node; ++a) {
      std::int64_t* own = sums.data() + static_cast<std::size_t>(a - begin) * numbers;
      for (Offset n = cell_start_[a]; n < cell_start_[a + 1]; ++n) {
        const bool is_here = cell_[n] / 8 >= layer_start_[static_cast<std::size_t>(layer)];
        const auto first = static_cast<std::size_t>(is_here ? layer : layer - 1);
        const auto number = static_cast<std::size_t>(cell_[n] / 8 - layer_start_[first]);
        add_cell(a, cell_[n], &(is_here ? here : before)[number * unknowns * unknowns], own);
      }
    }
    add_over_ranks(sums);
#pragma omp parallel for schedule(static)
    for (Index a = begin; a < node; ++a) {
      const std::int64_t* own = sums.data() + static_cast<std::size_t>(a - begin) * numbers;
      for (int k = 0; k < LatticeLevel::around; ++k, own += 9) {
        const Index b = finest.near(a, k);
        if (b < 0) continue;
        Mat3d block;
        for (int e = 0; e < 9; ++e) block(e / 3, e % 3) = static_cast<double>(own[e]) / by;
        finest.set_block(a, k, on_axes(block, free_axes[a], free_axes[b]));
      }
    }
  }
}

}  // namespace phyxel
