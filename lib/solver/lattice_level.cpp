#include "solver/lattice_level.hpp"

#include <algorithm>
#include <cmath>

#include "solver/on_axes.hpp"

namespace phyxel {
namespace {

/// Numbers of a block: three columns of four, the last number of each of which is 0.
constexpr std::size_t numbers = 12;
using Floats = float __attribute__((vector_size(16), aligned(4)));
using Doubles = double __attribute__((vector_size(32)));

/// 1 along the axes along which a block has a stiffness, 0 along others.
Vec3d stiff_axes(const Mat3d& block) {
  const double most = std::max({block(0, 0), block(1, 1), block(2, 2)});
  const auto is_stiff = [&](int axis) { return block(axis, axis) > 1e-12 * most ? 1.0 : 0.0; };
  return {is_stiff(0), is_stiff(1), is_stiff(2)};
}

}  // namespace

Vec3<int> Lattice::node(std::uint64_t key) const {
  const auto z = static_cast<std::uint64_t>(count.z), y = static_cast<std::uint64_t>(count.y);
  return {static_cast<int>(key / z / y), static_cast<int>(key / z % y), static_cast<int>(key % z)};
}

Lattice Lattice::coarser() const {
  const auto half = [](int n) { return std::max(2, n / 2 + 1); };
  return {low, 2 * spacing, {half(count.x), half(count.y), half(count.z)}};
}

LatticeCell::LatticeCell(const Lattice& lattice, Vec3d place) {
  const Vec3d from = (1 / lattice.spacing) * (place - lattice.low);
  const auto cell_of = [](double f, int nodes) {
    return std::clamp(static_cast<int>(std::floor(f)), 0, nodes - 2);
  };
  const Vec3<int> cell{cell_of(from.x, lattice.count.x), cell_of(from.y, lattice.count.y),
                       cell_of(from.z, lattice.count.z)};
  const Vec3d f{from.x - cell.x, from.y - cell.y, from.z - cell.z};
  const double by = 1 / lattice.spacing;
  for (int k = 0; k < 8; ++k) {
    const int dx = k >> 2, dy = k >> 1 & 1, dz = k & 1;
    const Vec3d hats{dx ? f.x : 1 - f.x, dy ? f.y : 1 - f.y, dz ? f.z : 1 - f.z};
    node[k] = {cell.x + dx, cell.y + dy, cell.z + dz};
    hat[k] = hats.x * hats.y * hats.z;
    slope[k] = by * Vec3d{(dx ? 1 : -1) * hats.y * hats.z, (dy ? 1 : -1) * hats.x * hats.z,
                          (dz ? 1 : -1) * hats.x * hats.y};
  }
}

LatticeLevel::LatticeLevel(const Lattice& lattice, std::vector<std::uint64_t> keys)
    : lattice_(lattice), keys_(std::move(keys)), near_(keys_.size()) {
#pragma omp parallel for schedule(static) if (size() > worth_threads)
  for (Index a = 0; a < size(); ++a) {
    const Vec3<int> at = node(a);
    for (int k = 0; k < around; ++k) {
      near_[a][k] = number({at.x + k / 9 - 1, at.y + k / 3 % 3 - 1, at.z + k % 3 - 1});
    }
  }
  blocks_.assign(keys_.size() * around * numbers, 0);
}

Index LatticeLevel::number(Vec3<int> at) const {
  if (!lattice_.contains(at)) return -1;
  const std::uint64_t key = lattice_.key(at);
  const auto found = std::lower_bound(keys_.begin(), keys_.end(), key);
  return found != keys_.end() && *found == key ? static_cast<Index>(found - keys_.begin()) : -1;
}

void LatticeLevel::set_block(Index a, int k, const Mat3d& block) {
  float* to = blocks_.data() + (static_cast<std::size_t>(a) * around + k) * numbers;
  for (int e = 0; e < 9; ++e) to[e % 3 * 4 + e / 3] = static_cast<float>(block(e / 3, e % 3));
}

Mat3d LatticeLevel::block(Index a, int k) const {
  const float* from = blocks_.data() + (static_cast<std::size_t>(a) * around + k) * numbers;
  Mat3d block;
  for (int e = 0; e < 9; ++e) block(e / 3, e % 3) = from[e % 3 * 4 + e / 3];
  return block;
}

void LatticeLevel::begin() {
  inverse_.resize(keys_.size());
#pragma omp parallel for schedule(static) if (size() > worth_threads)
  for (Index a = 0; a < size(); ++a) {
    const Mat3d own = block(a, around / 2);
    inverse_[a] = inverse_on_axes(own, stiff_axes(own));
  }
  largest_ = largest_eigenvalue();
}

void LatticeLevel::product(const Nodes& x, Nodes& out) const {
  out.resize(x.size());
#pragma omp parallel for schedule(static) if (size() > worth_threads)
  for (Index a = 0; a < size(); ++a) {
    const float* block = blocks_.data() + static_cast<std::size_t>(a) * around * numbers;
    Doubles sum{};
    for (int k = 0; k < around; ++k, block += numbers) {
      const Index b = near_[a][k];
      if (b < 0) continue;
      const Vec3d v = x[b];
      const auto column = [&](int c) {
        return __builtin_convertvector(*reinterpret_cast<const Floats*>(block + 4 * c), Doubles);
      };
      sum += column(0) * v.x + column(1) * v.y + column(2) * v.z;
    }
    out[a] = {sum[0], sum[1], sum[2]};
  }
}

/// By powers of the matrix, from a start that contains all waves. Sums are in a fixed order.
double LatticeLevel::largest_eigenvalue() const {
  Nodes v(keys_.size()), image;
  for (Index a = 0; a < size(); ++a) {
    std::uint64_t bits = (static_cast<std::uint64_t>(a) + 1) * 0x9e3779b97f4a7c15u;
    const auto next = [&] {
      bits ^= bits >> 29;
      bits *= 0xbf58476d1ce4e5b9u;
      return static_cast<double>(bits >> 40) / (1 << 24) - 0.5;
    };
    v[a].x = next();
    v[a].y = next();
    v[a].z = next();
  }
  double found = 1;
  constexpr int powers = 6;
  for (int k = 0; k < powers; ++k) {
    product(v, image);
    double before = 0, after = 0;
    for (Index a = 0; a < size(); ++a) {
      before += dot(v[a], v[a]);
      v[a] = inverse_[a] * image[a];
      after += dot(v[a], v[a]);
    }
    if (!(before > 0) || !(after > 0)) return 1;
    found = std::sqrt(after / before);
    const double scale = 1 / std::sqrt(after);
    for (Vec3d& one : v) one = scale * one;
  }
  return 1.2 * found;
}

void LatticeLevel::smooth(const Nodes& r, Nodes& x) const {
  constexpr double share = 0.5;  // of the spectrum that it does not smooth
  const double by = 2 / (largest_ * (1 + share));
  x.resize(r.size());
#pragma omp parallel for schedule(static) if (size() > worth_threads)
  for (Index a = 0; a < size(); ++a) x[a] = by * (inverse_[a] * r[a]);
}

void LatticeLevel::restrict_to_free(Nodes& r) const {
#pragma omp parallel for schedule(static) if (size() > worth_threads)
  for (Index a = 0; a < size(); ++a) {
    const Mat3d& free = inverse_[a];
    r[a] = {free(0, 0) > 0 ? r[a].x : 0, free(1, 1) > 0 ? r[a].y : 0, free(2, 2) > 0 ? r[a].z : 0};
  }
}

}  // namespace phyxel
