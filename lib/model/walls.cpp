#include "model/walls.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "model/assembly.hpp"
#include "model/row_weights.hpp"
#include "model/selection.hpp"
#include "model/spatial_hash.hpp"
#include "phyxel/physics/moment.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Calls visit(region, axes) for each support of a body that is given by a region of space.
template <class Visit>
void for_each_support(const BodyRequest& request, Visit&& visit) {
  const auto one = [&](const auto& support) {
    if (const auto region = region_of(support.select)) visit(*region, support.axes);
  };
  for (const FixRequest& fix : request.fixed) one(fix);
  for (const MotionRequest& motion : request.motions) one(motion);
}

/// The axes along which the entries of a region hold or move its phyxels, a bit for each.
int axes_held_in(const BodyRequest& request, const SpaceRegion& region) {
  int axes = 0;
  for_each_support(request, [&](const SpaceRegion& other, Axes held) {
    if (other == region) axes |= held.bits();
  });
  return axes;
}

/// True if numbers differ by no more than the rounding of differences of numbers of size `shift`.
bool nearly_equal(Vec3d a, Vec3d b, double shift) {
  const auto near = [&](double x, double y) {
    constexpr double few = 64 * std::numeric_limits<double>::epsilon();
    return std::abs(x - y) <= few * (std::max(std::abs(x), std::abs(y)) + shift);
  };
  return near(a.x, b.x) && near(a.y, b.y) && near(a.z, b.z);
}

bool nearly_equal(const SpaceRegion& a, const SpaceRegion& b, double shift) {
  for (int k = 0; k < 3; ++k) {
    if (!nearly_equal(a.edge[k], b.edge[k], 0.0)) return false;
  }
  return a.is_ball == b.is_ball && nearly_equal(a.low, b.low, shift) &&
         nearly_equal(a.high, b.high, shift) && nearly_equal(a.centre, b.centre, shift) &&
         nearly_equal(Vec3d{a.radius, 0, 0}, Vec3d{b.radius, 0, 0}, shift);
}

/// The number of a room that is open to all others.
constexpr std::size_t open_room = std::numeric_limits<std::size_t>::max();

/// The room of each phyxel.
std::vector<std::size_t> rooms_of(std::span<const Vec3d> position, const Walls& walls) {
  std::vector<std::size_t> room =
      tabulated(position.size(), [&](std::size_t i) { return walls.room_of(position[i]); });
  const std::size_t outside = walls.regions.size();
  std::vector<Vec3d> on_wall;
  std::vector<std::pair<std::size_t, std::size_t>> beside;  // phyxels, and the walls beside them
  for (std::size_t i = 0; i < position.size(); ++i) {
    if (room[i] != outside) continue;
    bool lies_on = false;
    std::size_t nearest = outside;
    for (std::size_t k = 0; k < outside; ++k) {
      const double distance = walls.regions[k].distance(position[i]);
      lies_on = lies_on || distance <= 2 * walls.depth;
      if (distance < walls.spacing) nearest = k;
    }
    if (lies_on) {
      on_wall.push_back(position[i]);
    } else if (nearest != outside) {
      beside.emplace_back(i, nearest);
    }
  }
  const SpatialHash hash(on_wall, walls.spacing);
  for (const auto& [i, wall] : beside) {
    const Vec3d foot = walls.regions[wall].nearest_on_boundary(position[i]);
    const double reach = walls.spacing;
    if (on_wall.empty() || hash.nearest(foot, reach).distance2 > reach * reach) room[i] = open_room;
  }
  return room;
}

bool may_be_neighbours(std::size_t a, std::size_t b) {
  return a == b || a == open_room || b == open_room;
}

/// Neighbours lie nearly in a plane if the smallest eigenvalue of their moment matrix is at most
/// one of these shares of the largest, while that of more neighbours is above it.
constexpr double flat_shares[] = {0.05, 0.1, 0.15};

/// True if those neighbours of phyxel i for which counts(j) is true span space: if the smallest
/// eigenvalue of their moment matrix is above a share of the largest. Beside a flat wall, or a
/// surface, it is 0.4 to 1 of it.
template <class Counts>
bool span_space(const Neighbourhood& hood, std::span<const Vec3d> position, double pair_length,
                Index i, double share, Counts&& counts) {
  const RowWeights weights(hood.support.data(), i, pair_length);
  Sym3d moment;
  for (const Index j : hood.neighbours.row(i)) {
    if (!counts(j)) continue;
    const Vec3d x = position[j] - position[i];
    moment += moment_term(x, weights(j, dot(x, x)));
  }
  return pseudo_inverse(moment, share).rank == 3;
}

/// Opens the rooms of phyxels that no region contains, and whose neighbours in the same room lie
/// nearly in a plane while all their neighbours do not: those of an acute wedge between a wall and
/// the surface. Their fits would be far stiffer than any other in the body. Phyxels inside regions
/// keep theirs, as all of their neighbours are held or moved, too.
void open_thin_rooms(std::vector<std::size_t>& room, const Neighbourhood& hood,
                     std::span<const Vec3d> position, double pair_length, std::size_t outside) {
  std::vector<Index> opened;
  for (Index i = 0; i < hood.neighbours.rows(); ++i) {
    if (room[i] != outside) continue;
    const auto is_kept = [&](Index j) { return may_be_neighbours(room[i], room[j]); };
    const auto is_opened_by = [&](double share) {
      return !span_space(hood, position, pair_length, i, share, is_kept) &&
             span_space(hood, position, pair_length, i, share, [](Index) { return true; });
    };
    if (!std::ranges::all_of(hood.neighbours.row(i), is_kept) &&
        std::ranges::any_of(flat_shares, is_opened_by)) {
      opened.push_back(i);
    }
  }
  for (const Index i : opened) room[i] = open_room;
}

}  // namespace

std::size_t Walls::room_of(Vec3d point) const {
  const auto inside = [&](const SpaceRegion& region) {
    return region.shrunk(4 * depth).contains(point);
  };
  return static_cast<std::size_t>(std::find_if(regions.begin(), regions.end(), inside) -
                                  regions.begin());
}

Walls walls_of(const BodyRequest& request, const Cloud& cloud) {
  Walls walls{.regions = {}, .depth = cloud.cuts.depth, .spacing = cloud.cuts.spacing};
  for (const SupportCut& cut : cloud.cuts.list) {
    if (axes_held_in(request, cut.support) == Axes{}.bits()) walls.regions.push_back(cut.wall);
  }
  return walls;
}

void separate(Neighbourhood& hood, std::span<const Vec3d> position, const Walls& walls,
              double pair_length) {
  if (walls.regions.empty()) return;
  std::vector<std::size_t> room = rooms_of(position, walls);
  open_thin_rooms(room, hood, position, pair_length, walls.regions.size());
  Csr& lists = hood.neighbours;
  Offset kept = 0, from = 0;
  for (Index i = 0; i < lists.rows(); ++i) {
    const Offset end = lists.offsets[i + 1];
    for (; from < end; ++from) {
      const Index j = lists.indices[from];
      if (may_be_neighbours(room[i], room[j])) lists.indices[kept++] = j;
    }
    lists.offsets[i + 1] = kept;
  }
  lists.indices.resize(static_cast<std::size_t>(kept));
  if (!hood.symmetric) hood.inverse_lists = transpose(lists, lists.rows());
}

std::vector<SupportRegion> support_regions(const BodyRequest& request) {
  std::vector<SupportRegion> supports;
  for_each_support(request, [&](const SpaceRegion& region, Axes) {
    if (std::ranges::count(supports, region, &SupportRegion::region) > 0) return;
    supports.push_back({region, axes_held_in(request, region) == Axes{}.bits()});
  });
  std::ranges::sort(supports, comes_before, &SupportRegion::region);
  return supports;
}

CutSource source_of(const BodyRequest& request) {
  CutSource made{request.source, {}, {}, 0};
  const std::string& shape = request.source.shape.name;
  const bool is_shape =
      !shape.empty() && !is_paper_shape(shape) && request.volume_rule != VolumeRule::kernel;
  if (request.source.mesh.empty() && !is_shape) return made;
  const Mat3d rotation = rotation_of(request);
  for (const auto& [region, holds_all] : support_regions(request)) {
    made.supports.push_back(
        {region.before_placement(request.scale, rotation, request.translation), holds_all});
  }
  for (const FinerRequest& finer : request.finer) {
    made.finer.push_back(
        {region_of(finer.select)->before_placement(request.scale, rotation, request.translation),
         finer.by});
  }
  made.shift = norm(request.translation) / request.scale;
  return made;
}

bool is_same(const CutSource& a, const CutSource& b) {
  const auto equal = [&](const SpaceRegion& one, const SpaceRegion& other) {
    return nearly_equal(one, other, a.shift + b.shift);
  };
  const auto equal_supports = [&](const SupportRegion& one, const SupportRegion& other) {
    return one.holds_all == other.holds_all && equal(one.region, other.region);
  };
  const auto equal_finer = [&](const Grading::Finer& one, const Grading::Finer& other) {
    return one.by == other.by && equal(one.region, other.region);
  };
  return a.source == b.source && std::ranges::equal(a.supports, b.supports, equal_supports) &&
         std::ranges::equal(a.finer, b.finer, equal_finer);
}

std::vector<SharedSource> shared_sources(const Scene& scene) {
  std::vector<SharedSource> sources;
  std::optional<CutSource> before;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    CutSource source = source_of(scene.bodies[b]);
    // Each copy is compared with the one before: those far apart differ by more.
    if (!before || !is_same(*before, source)) sources.push_back({source, {}});
    sources.back().bodies.push_back(b);
    before = std::move(source);
  }
  return sources;
}

void place_cuts(Cloud& cloud, const BodyRequest& request) {
  cloud.cuts.depth *= request.scale;
  cloud.cuts.spacing *= request.scale;
  if (cloud.cuts.list.empty() && cloud.cuts.moved.empty()) return;
  const CutSource source = source_of(request);
  const std::vector<SupportRegion> supports = support_regions(request);
  const Mat3d rotation = rotation_of(request);
  const auto placed = [&](const std::vector<SupportCut>& cuts) {
    std::vector<SupportCut> all;
    for (std::size_t k = 0; k < source.supports.size(); ++k) {
      const auto cut = std::find_if(cuts.begin(), cuts.end(), [&](const SupportCut& c) {
        return nearly_equal(c.support, source.supports[k].region,
                            2 * source.shift + cloud.cuts.shift);
      });
      if (cut == cuts.end()) continue;
      all.push_back(
          {supports[k].region, cut->wall.placed(request.scale, rotation, request.translation)});
    }
    return all;
  };
  cloud.cuts.list = placed(cloud.cuts.list);
  cloud.cuts.moved = placed(cloud.cuts.moved);
}

}  // namespace phyxel
