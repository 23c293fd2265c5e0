#include "shapes/lattice_shapes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mesh/random_bits.hpp"

namespace phyxel {
namespace {

using Cell = std::array<std::int64_t, 3>;

/// Calls visit(cell) in Morton order (x fastest) for the cells below `end` of a cube at `corner`
/// with 2^level cells a side.
template <class Visit>
void visit_cells(const Cell& corner, int level, const Cell& end, Visit& visit) {
  if (corner[0] >= end[0] || corner[1] >= end[1] || corner[2] >= end[2]) return;
  if (level == 0) {
    visit(corner);
    return;
  }
  const std::int64_t half = std::int64_t{1} << (level - 1);
  for (int child = 0; child < 8; ++child) {
    visit_cells({corner[0] + (child & 1) * half, corner[1] + (child >> 1 & 1) * half,
                 corner[2] + (child >> 2) * half},
                level - 1, end, visit);
  }
}

/// Fills a lattice block by block, the blocks in Morton order. The first phyxel of each block is
/// known in advance, so that threads fill blocks independently.
class Filling {
 public:
  Filling(const Lattice& lattice, double jitter, std::uint64_t seed)
      : lattice_(lattice), cell_(lattice.cell()), jitter_(jitter), salt_(mix_bits(seed)) {
    for (int axis = 0; axis < 3; ++axis) {
      end_[axis] = static_cast<std::int64_t>(lattice.places(axis));
      block_end_[axis] = (end_[axis] + block_side - 1) / block_side;
    }
  }

  /// Fills the blocks whose first phyxels are in the piece.
  CloudPiece run(Piece piece) {
    find_blocks();
    const Offset whole = first_.back();
    const auto begins = [&](int k) {
      return std::lower_bound(first_.begin(), first_.end(), whole * k / piece.of) - first_.begin();
    };
    const std::ptrdiff_t begin = begins(piece.number), end = begins(piece.number + 1);
    CloudPiece made{{}, static_cast<Index>(first_[begin]), static_cast<Index>(whole)};
    Cloud& cloud = made.cloud;
    const auto phyxels = static_cast<std::size_t>(first_[end] - first_[begin]);
    cloud.position.resize(phyxels);
    const double inner = lattice_.nodes ? cell_.x * cell_.y * cell_.z
                                        : lattice_.volume() / static_cast<double>(whole);
    cloud.volume.assign(phyxels, inner);
#pragma omp parallel for schedule(dynamic, 16)
    for (std::ptrdiff_t b = begin; b < end; ++b) {
      auto next = static_cast<std::size_t>(first_[b] - first_[begin]);
      visit_inside(b, [&](const Cell& c, Vec3d centre) {
        cloud.position[next] = jittered(c, centre);
        for (int axis = 0; axis < 3; ++axis) {
          if (on_face(c, axis)) cloud.volume[next] *= 0.5;
        }
        ++next;
      });
    }
    add_regions(cloud, begin, end);
    return made;
  }

 private:
  static constexpr int block_level = 4;
  static constexpr std::int64_t block_side = 1 << block_level;

  void find_blocks() {
    int level = 0;
    while ((std::int64_t{1} << level) < std::max({block_end_[0], block_end_[1], block_end_[2]})) {
      ++level;
    }
    const auto add = [&](const Cell& b) { block_.push_back(b); };
    visit_cells({0, 0, 0}, level, block_end_, add);
    first_.assign(block_.size() + 1, 0);
    const auto n = static_cast<std::ptrdiff_t>(block_.size());
#pragma omp parallel for schedule(dynamic, 16)
    for (std::ptrdiff_t b = 0; b < n; ++b) {
      if (lattice_.solid == Lattice::Solid::box) {
        Offset count = 1;
        for (int axis = 0; axis < 3; ++axis) {
          count *= std::min(block_side, end_[axis] - block_[b][axis] * block_side);
        }
        first_[b + 1] = count;
      } else {
        visit_inside(b, [&](const Cell&, Vec3d) { ++first_[b + 1]; });
      }
    }
    for (std::size_t b = 0; b < block_.size(); ++b) first_[b + 1] += first_[b];
  }

  template <class Visit>
  void visit_inside(std::ptrdiff_t b, Visit&& visit) const {
    const Cell& at = block_[b];
    const Cell corner{at[0] * block_side, at[1] * block_side, at[2] * block_side};
    const auto visit_cell = [&](const Cell& c) {
      if (!lattice_.holds(c)) return;
      const double within = lattice_.nodes ? 0 : 0.5;
      const Vec3d centre = lattice_.low + Vec3d{(static_cast<double>(c[0]) + within) * cell_.x,
                                                (static_cast<double>(c[1]) + within) * cell_.y,
                                                (static_cast<double>(c[2]) + within) * cell_.z};
      visit(c, centre);
    };
    visit_cells(corner, block_level, end_, visit_cell);
  }

  /// True if a node lies on a face perpendicular to `axis`; false for cells.
  bool on_face(const Cell& c, int axis) const {
    return lattice_.nodes && (c[axis] == 0 || c[axis] == end_[axis] - 1);
  }

  Vec3d jittered(const Cell& c, Vec3d centre) const {
    if (jitter_ == 0) return centre;
    const auto number = static_cast<std::uint64_t>(c[0] + end_[0] * (c[1] + end_[1] * c[2]));
    const std::uint64_t bits = mix_bits(number ^ salt_);
    const auto signed_fraction = [](std::uint64_t part) { return 2 * unit_fraction(part) - 1; };
    Vec3d move{jitter_ * cell_.x * signed_fraction(bits),
               jitter_ * cell_.y * signed_fraction(bits >> 21),
               jitter_ * cell_.z * signed_fraction(bits >> 42)};
    if (lattice_.nodes) {  // interior nodes cannot reach a face
      return centre + Vec3d{on_face(c, 0) ? 0 : move.x, on_face(c, 1) ? 0 : move.y,
                            on_face(c, 2) ? 0 : move.z};
    }
    for (int attempt = 0; attempt < 4; ++attempt, move = 0.5 * move) {
      if (lattice_.contains(centre + move)) return centre + move;
    }
    return centre;
  }

  /// Adds a region for each flat side: the outermost layer of phyxels there.
  void add_regions(Cloud& cloud, std::ptrdiff_t begin, std::ptrdiff_t end) const {
    if (lattice_.solid == Lattice::Solid::sphere) return;
    for (int axis = lattice_.solid == Lattice::Solid::box ? 0 : 2; axis < 3; ++axis) {
      std::vector<Index>& low = cloud.regions[side_names[axis][0]];
      std::vector<Index>& high = cloud.regions[side_names[axis][1]];
      for (std::ptrdiff_t b = begin; b < end; ++b) {
        const std::int64_t layer = block_[b][axis];
        if (layer != 0 && layer != block_end_[axis] - 1) continue;
        Offset i = first_[b] - first_[begin];
        visit_inside(b, [&](const Cell& c, Vec3d) {
          if (c[axis] == 0) low.push_back(static_cast<Index>(i));
          if (c[axis] == end_[axis] - 1) high.push_back(static_cast<Index>(i));
          ++i;
        });
      }
    }
  }

  const Lattice& lattice_;
  Vec3d cell_;
  double jitter_;
  std::uint64_t salt_;
  Cell end_{}, block_end_{};
  std::vector<Cell> block_;    ///< Lower corners of blocks in units of blocks, in Morton order.
  std::vector<Offset> first_;  ///< Number of phyxels before each block, shape [n_blocks + 1].
};

}  // namespace

double Lattice::volume() const {
  const double box = extent.x * extent.y * extent.z;
  if (solid == Solid::cylinder) return std::numbers::pi / 4 * box;
  if (solid == Solid::sphere) return std::numbers::pi / 6 * box;
  return box;
}

bool Lattice::contains(Vec3d p) const {
  const Vec3d d = p - (low + 0.5 * extent), half = 0.5 * extent;
  if (solid == Solid::sphere) return dot(d, d) < half.x * half.x;
  if (std::abs(d.z) >= half.z) return false;
  if (solid == Solid::cylinder) return d.x * d.x + d.y * d.y < half.x * half.x;
  return std::abs(d.x) < half.x && std::abs(d.y) < half.y;
}

bool Lattice::holds(const std::array<std::int64_t, 3>& cell) const {
  if (solid == Solid::box) return true;
  // Distances from the axis or the centre in half cells, in which the radius is the cell count.
  const auto n = static_cast<std::int64_t>(cells[0]);
  const std::int64_t x = 2 * cell[0] + 1 - n, y = 2 * cell[1] + 1 - n, z = 2 * cell[2] + 1 - n;
  return x * x + y * y + (solid == Solid::sphere ? z * z : 0) < n * n;
}

double Lattice::phyxels() const {
  const double box_cells = places(0) * places(1) * places(2);
  if (solid == Solid::box) return box_cells;
  if (box_cells > 1e11) return box_cells * (volume() / (extent.x * extent.y * extent.z));
  // Row by row in half cells: coordinates of cell centres are odd if n is even, and even if n is
  // odd.
  const double n = cells[0];
  const bool odd = std::fmod(n, 2) == 0;
  const auto numbers_within = [&](double square) {
    if (!(square > 0)) return 0.0;
    const double limit = std::sqrt(square);
    return odd ? 2 * std::ceil((limit - 1) / 2) : 2 * std::ceil(limit / 2) - 1;
  };
  double sum = 0;
  for (double y = 1 - n; y < n; y += 2) {
    if (solid == Solid::cylinder) {
      sum += cells[2] * numbers_within(n * n - y * y);
    } else {
      for (double z = 1 - n; z < n; z += 2) sum += numbers_within(n * n - y * y - z * z);
    }
  }
  return sum;
}

Lattice make_lattice(const ShapeRequest& request, double spacing) {
  Lattice lattice;
  if (request.name == "cylinder") {
    lattice.solid = Lattice::Solid::cylinder;
    lattice.extent = {2 * request.radius, 2 * request.radius, request.length};
  } else if (request.name == "sphere") {
    lattice.solid = Lattice::Solid::sphere;
    lattice.extent = {2 * request.radius, 2 * request.radius, 2 * request.radius};
  } else {
    lattice.extent = request.size;
  }
  lattice.nodes = request.placement == ShapeRequest::Placement::nodes;
  lattice.low = -0.5 * lattice.extent;
  if (request.name == "beam") lattice.low.x = 0;
  const auto count = [&](double extent) { return std::max(1.0, std::round(extent / spacing)); };
  lattice.cells = {count(lattice.extent.x), count(lattice.extent.y), count(lattice.extent.z)};
  return lattice;
}

CloudPiece fill_lattice(const Lattice& lattice, double jitter, std::uint64_t seed, Piece piece) {
  return Filling(lattice, jitter, seed).run(piece);
}

}  // namespace phyxel
