#include "shapes/lattice_shapes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "mesh/random_bits.hpp"
#include "shapes/lattice_cuts.hpp"

namespace phyxel {
namespace {

using Cell = Lattice::Site;

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
      : lattice_(lattice), jitter_(jitter), salt_(mix_bits(seed)) {
    for (int axis = 0; axis < 3; ++axis) {
      end_[axis] = static_cast<std::int64_t>(lattice.layers[axis].count());
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
    cloud.volume.resize(phyxels);
    const double factor = volume_over_share(static_cast<double>(whole));
#pragma omp parallel for schedule(dynamic, 16)
    for (std::ptrdiff_t b = begin; b < end; ++b) {
      auto next = static_cast<std::size_t>(first_[b] - first_[begin]);
      visit_inside(b, [&](const Cell& c) {
        cloud.position[next] = jittered(c);
        cloud.volume[next++] = factor * lattice_.share(c);
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
        visit_inside(b, [&](const Cell&) { ++first_[b + 1]; });
      }
    }
    for (std::size_t b = 0; b < block_.size(); ++b) first_[b + 1] += first_[b];
  }

  template <class Visit>
  void visit_inside(std::ptrdiff_t b, Visit&& visit) const {
    const Cell& at = block_[b];
    const Cell corner{at[0] * block_side, at[1] * block_side, at[2] * block_side};
    const auto visit_cell = [&](const Cell& c) {
      if (lattice_.holds(c)) visit(c);
    };
    visit_cells(corner, block_level, end_, visit_cell);
  }

  /// The volume of a phyxel over its share of the bounding box, if there are `whole` phyxels.
  double volume_over_share(double whole) const {
    if (lattice_.solid == Lattice::Solid::box) return 1;
    const Vec3d& extent = lattice_.extent;
    const double cell = extent.x * extent.y / (lattice_.cells * lattice_.cells);
    if (lattice_.solid == Lattice::Solid::sphere) {
      return lattice_.volume() / (whole * cell * extent.z / lattice_.cells);
    }
    return lattice_.volume() / (whole / lattice_.layers[2].count() * cell * extent.z);
  }

  Vec3d jittered(const Cell& c) const {
    const Vec3d site = lattice_.place(c);
    if (jitter_ == 0) return site;
    const auto number = static_cast<std::uint64_t>(c[0] + end_[0] * (c[1] + end_[1] * c[2]));
    const std::uint64_t bits = mix_bits(number ^ salt_);
    double move[3], inside[3];  // sites laid on a face are in its middle plane to `contains`
    for (int axis = 0; axis < 3; ++axis) {
      const Layers& layers = lattice_.layers[axis];
      const auto layer = static_cast<double>(c[axis]);
      const bool laid = layers.is_laid(layer);
      const double fraction = 2 * unit_fraction(bits >> (21 * axis)) - 1;
      move[axis] = laid ? 0 : jitter_ * layers.spacing(layer) * fraction;
      inside[axis] = laid ? 0.5 * component(lattice_.extent, axis) + component(lattice_.low, axis)
                          : component(site, axis);
    }
    for (double part = 1; part > 0.1; part *= 0.5) {
      const Vec3d by{part * move[0], part * move[1], part * move[2]};
      if (lattice_.contains(Vec3d{inside[0], inside[1], inside[2]} + by)) return site + by;
    }
    return site;
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
        visit_inside(b, [&](const Cell& c) {
          if (c[axis] == 0) low.push_back(static_cast<Index>(i));
          if (c[axis] == end_[axis] - 1) high.push_back(static_cast<Index>(i));
          ++i;
        });
      }
    }
  }

  const Lattice& lattice_;
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

bool Lattice::holds(const Site& site) const {
  if (solid == Solid::box) return true;
  // Distances from the axis or the centre in half cells, in which the radius is the cell count.
  const auto n = static_cast<std::int64_t>(cells);
  const std::int64_t x = 2 * site[0] + 1 - n, y = 2 * site[1] + 1 - n, z = 2 * site[2] + 1 - n;
  return x * x + y * y + (solid == Solid::sphere ? z * z : 0) < n * n;
}

Vec3d Lattice::place(const Site& site) const {
  const auto along = [&](int axis) { return layers[axis].place(static_cast<double>(site[axis])); };
  return {along(0), along(1), along(2)};
}

namespace {

constexpr std::size_t no_room = std::numeric_limits<std::size_t>::max();

/// The parts of a site beside it, below and above along each axis [m].
using Parts = std::array<std::array<double, 2>, 3>;

Parts parts_of(const Lattice& lattice, const Lattice::Site& site) {
  Parts parts;
  for (int axis = 0; axis < 3; ++axis) {
    parts[axis] = lattice.layers[axis].shares(static_cast<double>(site[axis]));
  }
  return parts;
}

/// The product of the parts of a site on the sides given by the bits of `corner`.
double octant(const Parts& parts, int corner) {
  return parts[0][corner & 1] * parts[1][corner >> 1 & 1] * parts[2][corner >> 2];
}

/// The site below or above another one along each axis, by the bits of `corner`.
Lattice::Site beside(const Lattice::Site& site, int corner, int step) {
  return {site[0] + step * (corner & 1), site[1] + step * (corner >> 1 & 1),
          site[2] + step * (corner >> 2)};
}

/// The first room between whose layers a cell lies, those on the room's boundary included; or
/// `no_room`. @param low the cell's lowest corner
std::size_t room_of_cell(const Lattice& lattice, const Lattice::Site& low) {
  const auto contains = [&](const LatticeRoom& room) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto lower = static_cast<double>(low[axis]);
      if (lower < room.layers[axis][0] - 1 || lower + 1 > room.layers[axis][1]) return false;
    }
    return true;
  };
  const auto found = std::find_if(lattice.rooms.begin(), lattice.rooms.end(), contains);
  return found == lattice.rooms.end() ? no_room
                                      : static_cast<std::size_t>(found - lattice.rooms.begin());
}

/// The room that a site has its volume in: the first one that it is inside of; or, if all cells
/// around it are in rooms, as between two that touch, the first one of these.
std::size_t room_of_site(const Lattice& lattice, const Lattice::Site& site, const Parts& parts) {
  const auto contains = [&](const LatticeRoom& room) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto at = static_cast<double>(site[axis]);
      if (at < room.layers[axis][0] || at >= room.layers[axis][1]) return false;
    }
    return true;
  };
  const auto inside = std::find_if(lattice.rooms.begin(), lattice.rooms.end(), contains);
  if (inside != lattice.rooms.end()) {
    return static_cast<std::size_t>(inside - lattice.rooms.begin());
  }
  std::size_t first = no_room;
  for (int corner = 0; corner < 8; ++corner) {
    if (octant(parts, corner) == 0) continue;
    const std::size_t room = room_of_cell(lattice, beside(beside(site, 7, -1), corner, 1));
    if (room == no_room) return no_room;
    first = std::min(first, room);
  }
  return first;
}

/// The sites at a cell's corners, and those of them that have their volume in a room.
struct CellSites {
  int all = 0, in_room = 0;
};
CellSites count_sites(const Lattice& lattice, const Lattice::Site& low, std::size_t room) {
  CellSites count;
  for (int corner = 0; corner < 8; ++corner) {
    const Lattice::Site site = beside(low, corner, 1);
    bool exists = true;
    for (int axis = 0; axis < 3; ++axis) {
      exists = exists && site[axis] >= 0 &&
               static_cast<double>(site[axis]) < lattice.layers[axis].count();
    }
    if (!exists) continue;
    ++count.all;
    count.in_room += room_of_site(lattice, site, parts_of(lattice, site)) == room;
  }
  return count;
}

}  // namespace

double Lattice::share(const Site& site) const {
  const Parts parts = parts_of(*this, site);
  if (rooms.empty()) {
    const auto whole = [&](int axis) { return parts[axis][0] + parts[axis][1]; };
    return whole(0) * whole(1) * whole(2);
  }
  // Each cell belongs to the sites at its corners that have their volume in the cell's room.
  const std::size_t own = room_of_site(*this, site, parts);
  bool beside_boundary = false;
  for (int axis = 0; axis < 3 && own != no_room; ++axis) {
    const auto [first, end] = rooms[own].layers[axis];
    const auto at = static_cast<double>(site[axis]);
    beside_boundary = beside_boundary || (at <= first && first > 0) ||
                      (at >= end - 1 && end < layers[axis].count());
  }
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const double part = octant(parts, corner);
    const Site cell = beside(beside(site, 7, -1), corner, 1);
    if (part == 0 || room_of_cell(*this, cell) != own) continue;
    const CellSites count = beside_boundary ? count_sites(*this, cell, own) : CellSites{1, 1};
    sum += part * count.all / count.in_room;
  }
  return sum;
}

double Lattice::phyxels() const {
  const auto count = [&](int axis) { return layers[axis].count(); };
  const double box_sites = count(0) * count(1) * count(2);
  if (solid == Solid::box) return box_sites;
  if (box_sites > 1e11) return box_sites * (volume() / (extent.x * extent.y * extent.z));
  // Row by row in half cells: coordinates of cell centres are odd if n is even, and even if n is
  // odd.
  const double n = cells;
  const bool odd = std::fmod(n, 2) == 0;
  const auto numbers_within = [&](double square) {
    if (!(square > 0)) return 0.0;
    const double limit = std::sqrt(square);
    return odd ? 2 * std::ceil((limit - 1) / 2) : 2 * std::ceil(limit / 2) - 1;
  };
  double sum = 0;
  for (double y = 1 - n; y < n; y += 2) {
    if (solid == Solid::cylinder) {
      sum += count(2) * numbers_within(n * n - y * y);
    } else {
      for (double z = 1 - n; z < n; z += 2) sum += numbers_within(n * n - y * y - z * z);
    }
  }
  return sum;
}

namespace {

/// The layers of a lattice inside a cut; nothing if there are none.
std::optional<LatticeRoom> room_of(const Lattice& lattice, const SupportCut& cut) {
  LatticeRoom room{.cut = cut, .layers = {}};
  const SpaceRegion inside = cut.wall.shrunk(4 * lattice.depth);
  for (int axis = 0; axis < 3; ++axis) {
    const Layers& layers = lattice.layers[axis];
    auto& [first, end] = room.layers[axis];
    first = layers.first_above(component(inside.low, axis));
    end = layers.first_above(component(inside.high, axis));
    if (!(first < end)) return {};
  }
  return room;
}

}  // namespace

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
  lattice.low = -0.5 * lattice.extent;
  if (request.name == "beam") lattice.low.x = 0;
  const Vec3d &low = lattice.low, &extent = lattice.extent;
  lattice.cells = std::max(1.0, std::round(extent.x / spacing));
  lattice.depth = 1e-7 * spacing + 16 * std::numeric_limits<double>::epsilon() *
                                       std::max({extent.x, extent.y, extent.z});
  const bool nodes = request.placement == ShapeRequest::Placement::nodes;
  LatticeBox box{.low = low, .extent = extent, .spacing = spacing, .depth = lattice.depth};
  for (int axis = 0; axis < 3; ++axis) {
    box.flat[axis] = lattice.solid == Lattice::Solid::box ||
                     (lattice.solid == Lattice::Solid::cylinder && axis == 2);
    box.on_end[axis] = nodes && box.flat[axis];
  }
  LayerPlan plan = plan_layers(box, request.supports);
  for (int axis = 0; axis < 3; ++axis) {
    lattice.layers[axis] = Layers(component(low, axis), component(extent, axis), spacing,
                                  plan.on_end[axis], plan.planes[axis]);
  }
  for (const SupportCut& cut : plan.cuts) {
    if (const std::optional<LatticeRoom> room = room_of(lattice, cut)) {
      lattice.rooms.push_back(*room);
    }
  }
  lattice.moved = std::move(plan.moved);
  return lattice;
}

CloudPiece fill_lattice(const Lattice& lattice, double jitter, std::uint64_t seed, Piece piece) {
  return Filling(lattice, jitter, seed).run(piece);
}

}  // namespace phyxel
