#include "solver/body_lattices.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "model/lists_from_pairs.hpp"
#include "rank_exchange.hpp"

namespace phyxel {
namespace {

constexpr Index most_coarsest = 100;   // nodes
constexpr double whole_hat = 1 << 16;  // quanta of a hat of 1

/// The lattice of twice a spacing in a box.
Lattice finest_lattice(const Box& box, double spacing) {
  const double h = 2 * spacing;
  const auto nodes = [&](double extent) {
    return std::max(2, static_cast<int>(std::ceil(extent / h - 1e-6)) + 1);
  };
  const Vec3d extent = box.high - box.low;
  return {box.low, h, {nodes(extent.x), nodes(extent.y), nodes(extent.z)}};
}

/// Keys of all ranks, ascending, each once. Collective on a share.
std::vector<std::uint64_t> of_all_ranks(const Communicator* ranks,
                                        std::vector<std::uint64_t> keys) {
  const auto make_unique = [&] {
    std::sort(keys.begin(), keys.end());
    keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  };
  make_unique();
  if (!ranks) return keys;
  const auto all = exchanged(*ranks, std::vector(static_cast<std::size_t>(ranks->size()), keys));
  keys.clear();
  for (const std::vector<std::uint64_t>& some : all) {
    keys.insert(keys.end(), some.begin(), some.end());
  }
  make_unique();
  return keys;
}

}  // namespace

BodyLattices::BodyLattices(const Communicator* ranks, const Box& box, double spacing,
                           std::vector<Source> sources)
    : ranks_(ranks), sources_(std::move(sources)) {
  const Lattice lattice = finest_lattice(box, spacing);
  std::vector<std::uint64_t> keys;
  keys.reserve(8 * sources_.size());
  for (const Source& source : sources_) {
    for (const Vec3<int>& at : LatticeCell(lattice, source.place).node) {
      keys.push_back(lattice.key(at));
    }
  }
  levels_.emplace_back(lattice, of_all_ranks(ranks, std::move(keys)));
  find_entries();
  find_cells();
  while (levels_.back().size() > most_coarsest) {
    const Index before = levels_.back().size();
    add_level();
    if (levels_.back().size() < before) continue;
    levels_.pop_back();  // a chain of nodes far apart
    transfers_.pop_back();
    break;
  }
  right_.resize(levels_.size());
  left_.resize(levels_.size());
}

void BodyLattices::find_entries() {
  const LatticeLevel& finest = levels_.front();
  const std::size_t count = sources_.size();
  node_.resize(8 * count);
  hat_.resize(8 * count);
#pragma omp parallel for schedule(static)
  for (std::size_t p = 0; p < count; ++p) {
    const LatticeCell cell(finest.lattice(), sources_[p].place);
    for (int k = 0; k < 8; ++k) {
      node_[8 * p + k] = finest.number(cell.node[k]);
      hat_[8 * p + k] = static_cast<float>(std::round(whole_hat * cell.hat[k]) / whole_hat);
    }
    float* const own = &hat_[8 * p];
    float sum = 0;
    for (int k = 0; k < 8; ++k) sum += own[k];
    *std::max_element(own, own + 8) += 1 - sum;
  }
  std::vector<std::pair<Index, Index>> pairs;
  pairs.reserve(node_.size());
  for (std::size_t e = 0; e < node_.size(); ++e) {
    pairs.emplace_back(node_[e], static_cast<Index>(e));
  }
  group(static_cast<std::size_t>(finest.size()), pairs, entry_start_, entry_);
  std::vector<std::int64_t> entries;
  for (Index a = 0; a < finest.size(); ++a) {
    entries.push_back(entry_start_[a + 1] - entry_start_[a]);
  }
  add_over_ranks(entries);
  for (const std::int64_t n : entries) most_ = std::max(most_, static_cast<double>(n));
}

void BodyLattices::add_level() {
  const LatticeLevel& fine = levels_.back();
  const Lattice lattice = fine.lattice().coarser();
  std::vector<std::pair<Index, std::pair<std::uint64_t, double>>> terms;
  std::vector<std::uint64_t> keys;
  for (Index a = 0; a < fine.size(); ++a) {
    const Vec3<int> at = fine.node(a);
    for (int k = 0; k < 8; ++k) {
      const Vec3<int> up{k >> 2, k >> 1 & 1, k & 1}, odd{at.x % 2, at.y % 2, at.z % 2};
      if (up.x > odd.x || up.y > odd.y || up.z > odd.z) continue;
      const Vec3<int> parent{at.x / 2 + up.x, at.y / 2 + up.y, at.z / 2 + up.z};
      const double weight = std::pow(0.5, odd.x + odd.y + odd.z);
      terms.push_back({a, {lattice.key(parent), weight}});
      keys.push_back(terms.back().second.first);
    }
  }
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  LatticeLevel coarse(lattice, keys);
  std::vector<std::pair<Index, Transfer::Term>> parents, children;
  for (const auto& [a, term] : terms) {
    const auto at = std::lower_bound(keys.begin(), keys.end(), term.first);
    const auto parent = static_cast<Index>(at - keys.begin());
    parents.push_back({a, {parent, term.second}});
    children.push_back({parent, {a, term.second}});
  }
  Transfer& made = transfers_.emplace_back();
  group(static_cast<std::size_t>(fine.size()), parents, made.parent_start, made.parents);
  group(keys.size(), children, made.child_start, made.children);
  levels_.push_back(std::move(coarse));
}

void BodyLattices::set(std::span<const Vec3d> free, const Present& present) {
  assemble(free, present);
  for (std::size_t l = 0; l + 1 < levels_.size(); ++l) {
    levels_[l].begin();
    coarsen(l);
  }
  levels_.back().begin();
  factor();
}

/// Sets the stiffness of the next coarser level.
void BodyLattices::coarsen(std::size_t level) {
  const LatticeLevel& fine = levels_[level];
  LatticeLevel& coarse = levels_[level + 1];
  const Transfer& transfer = transfers_[level];
#pragma omp parallel for schedule(dynamic, 64)
  for (Index a = 0; a < coarse.size(); ++a) {
    const Vec3<int> here = coarse.node(a);
    std::array<Mat3d, LatticeLevel::around> sum{};
    for (Offset c = transfer.child_start[a]; c < transfer.child_start[a + 1]; ++c) {
      const auto [i, of_child] = transfer.children[c];
      for (int k = 0; k < LatticeLevel::around; ++k) {
        const Index j = fine.near(i, k);
        if (j < 0) continue;
        const Mat3d block = of_child * fine.block(i, k);
        for (Offset p = transfer.parent_start[j]; p < transfer.parent_start[j + 1]; ++p) {
          const auto [b, of_parent] = transfer.parents[p];
          const Vec3<int> at = coarse.node(b);
          const int place =
              LatticeLevel::place_around({at.x - here.x, at.y - here.y, at.z - here.z});
          sum[static_cast<std::size_t>(place)] += of_parent * block;
        }
      }
    }
    for (int k = 0; k < LatticeLevel::around; ++k) {
      coarse.set_block(a, k, sum[static_cast<std::size_t>(k)]);
    }
  }
}

/// Factors the coarsest stiffness. What nothing holds gets a little stiffness.
void BodyLattices::factor() {
  const LatticeLevel& level = levels_.back();
  const Eigen::Index n = 3 * static_cast<Eigen::Index>(level.size());
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(n, n);
  for (Index a = 0; a < level.size(); ++a) {
    for (int k = 0; k < LatticeLevel::around; ++k) {
      const Index b = level.near(a, k);
      if (b < 0) continue;
      const Mat3d block = level.block(a, k);
      for (int e = 0; e < 9; ++e) all(3 * a + e / 3, 3 * b + e % 3) = block(e / 3, e % 3);
    }
  }
  const double most = all.diagonal().maxCoeff();
  constexpr double little = 1e-6;  // above the rounding of blocks in float
  for (Eigen::Index r = 0; r < n; ++r) {
    all(r, r) += all(r, r) > little * most ? little * all(r, r) : std::max(most, 1e-300);
  }
  const Eigen::LLT<Eigen::MatrixXd> cholesky(all);
  const Eigen::MatrixXd lower = cholesky.matrixL();
  factor_.assign(lower.data(), lower.data() + lower.size());
}

void BodyLattices::solve_coarsest() {
  const Eigen::Index n = 3 * static_cast<Eigen::Index>(levels_.back().size());
  const Eigen::Map<const Eigen::MatrixXd> lower(factor_.data(), n, n);
  left_.back() = right_.back();
  Eigen::Map<Eigen::VectorXd> x(&left_.back().data()->x, n);
  lower.triangularView<Eigen::Lower>().solveInPlace(x);
  lower.transpose().triangularView<Eigen::Upper>().solveInPlace(x);
}

void BodyLattices::cycle(std::size_t level) {
  if (level + 1 == levels_.size()) return solve_coarsest();
  const LatticeLevel& fine = levels_[level];
  const Transfer& transfer = transfers_[level];
  Nodes &right = right_[level], &left = left_[level], &down = right_[level + 1];
  const auto find_rest = [&] {
    fine.product(left, rest_);
#pragma omp parallel for schedule(static) if (fine.size() > worth_threads)
    for (Index a = 0; a < fine.size(); ++a) rest_[a] = right[a] - rest_[a];
  };
  fine.smooth(right, left);
  find_rest();
  down.resize(static_cast<std::size_t>(levels_[level + 1].size()));
#pragma omp parallel for schedule(static) if (fine.size() > worth_threads)
  for (Index a = 0; a < levels_[level + 1].size(); ++a) {
    Vec3d sum;
    for (Offset c = transfer.child_start[a]; c < transfer.child_start[a + 1]; ++c) {
      sum += transfer.children[c].weight * rest_[transfer.children[c].node];
    }
    down[a] = sum;
  }
  levels_[level + 1].restrict_to_free(down);
  cycle(level + 1);
  const Nodes& up = left_[level + 1];
  rest_.assign(left.size(), {});
#pragma omp parallel for schedule(static) if (fine.size() > worth_threads)
  for (Index a = 0; a < fine.size(); ++a) {
    for (Offset p = transfer.parent_start[a]; p < transfer.parent_start[a + 1]; ++p) {
      rest_[a] += transfer.parents[p].weight * up[transfer.parents[p].node];
    }
  }
  fine.restrict_to_free(rest_);
  for (std::size_t a = 0; a < left.size(); ++a) left[a] += rest_[a];
  find_rest();
  fine.smooth(rest_, more_);
  for (std::size_t a = 0; a < left.size(); ++a) left[a] += more_[a];
}

void BodyLattices::gather(std::span<const Vec3d> free, std::span<const Vec3d> r, double by,
                          std::span<std::int64_t> sums) {
  rounded_.resize(sources_.size());
#pragma omp parallel for schedule(static) if (sources_.size() > worth_threads)
  for (std::size_t p = 0; p < sources_.size(); ++p) {
    const Index i = sources_[p].phyxel;
    rounded_[p] = {std::rint(by * free[i].x * r[i].x), std::rint(by * free[i].y * r[i].y),
                   std::rint(by * free[i].z * r[i].z)};
  }
  const Index nodes = levels_.front().size();
#pragma omp parallel for schedule(static) if (nodes > worth_threads)
  for (Index a = 0; a < nodes; ++a) {
    Vec3d sum;
    for (Offset n = entry_start_[a]; n < entry_start_[a + 1]; ++n) {
      const auto e = static_cast<std::size_t>(entry_[n]);
      sum += (whole_hat * static_cast<double>(hat_[e])) * rounded_[e / 8];
    }
    const auto at = 3 * static_cast<std::size_t>(a);
    sums[at] = static_cast<std::int64_t>(sum.x);
    sums[at + 1] = static_cast<std::int64_t>(sum.y);
    sums[at + 2] = static_cast<std::int64_t>(sum.z);
  }
}

BodyLattices::Nodes BodyLattices::at_nodes(std::span<const std::int64_t> sums, double by) const {
  Nodes values(static_cast<std::size_t>(levels_.front().size()));
  const double scale = 1 / (whole_hat * by);
  for (std::size_t a = 0; a < values.size(); ++a) {
    const auto value = [&](std::size_t axis) {
      return scale * static_cast<double>(sums[3 * a + axis]);
    };
    values[a] = {value(0), value(1), value(2)};
  }
  return values;
}

Vec3d BodyLattices::total(std::span<const std::int64_t> sums, double by) const {
  std::int64_t all[3] = {0, 0, 0};
  for (std::size_t k = 0; k < sums.size(); ++k) all[k % 3] += sums[k];
  const double scale = 1 / (whole_hat * by);
  return {scale * static_cast<double>(all[0]), scale * static_cast<double>(all[1]),
          scale * static_cast<double>(all[2])};
}

void BodyLattices::correct(std::span<const std::int64_t> sums, double by, Vec3d mean,
                           std::span<const Vec3d> free, std::span<Vec3d> x) {
  Nodes& right = right_.front();
  right = at_nodes(sums, by);
  if (mean != Vec3d{}) {
    for (std::size_t a = 0; a < right.size(); ++a) right[a] -= by_components(shares_[a], mean);
  }
  levels_.front().restrict_to_free(right);
  cycle(0);
  Nodes& left = left_.front();
  levels_.front().restrict_to_free(left);
#pragma omp parallel for schedule(static) if (left.size() > worth_threads)
  for (std::size_t p = 0; p < sources_.size(); ++p) {
    Vec3d sum;
    for (int k = 0; k < 8; ++k) {
      sum += static_cast<double>(hat_[8 * p + k]) * left[node_[8 * p + k]];
    }
    const Index i = sources_[p].phyxel;
    x[i] += by_components(free[i], sum);
  }
}

}  // namespace phyxel
