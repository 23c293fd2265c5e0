#include "mesh/inside_samples.hpp"

#include <algorithm>
#include <cmath>

#include "mesh/random_bits.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

constexpr int block_level = 2;  ///< A block has 2^2 voxels a side.
static_assert(block_side == 1 << block_level);
/// Number of tasks that balances the load of threads; each of fewer cells has up to eight children.
constexpr std::size_t enough_tasks = InsideSampler::most_tasks / 8;

/// Number of triangles up to which walking from a known point is faster than the winding number
/// of a compact surface, which visits few of its triangles.
constexpr std::size_t few_triangles = 48;

/// True if an axis perpendicular to an edge of the triangle and an edge of the cube separates the
/// two; the cube is centred at the origin. Without this test a long thin triangle oblique to the
/// axes would seem to touch each cell of its plane within its bounding box.
/// Source: Akenine-Moeller 2001, the nine axes of class 3.
bool parted_by_an_edge(Vec3d a, Vec3d b, Vec3d c, double half) {
  const Vec3d corner[3] = {a, b, c};
  for (int k = 0; k < 3; ++k) {
    const Vec3d edge = corner[(k + 1) % 3] - corner[k];
    for (const Vec3d side : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
      const Vec3d axis = cross(edge, side);
      const double on_edge = dot(axis, corner[k]), beyond = dot(axis, corner[(k + 2) % 3]);
      const double reach = half * (std::abs(axis.x) + std::abs(axis.y) + std::abs(axis.z));
      // Products of coordinates that cancel in `on_edge` leave this rounding error.
      const double rounding =
          1e-15 * (std::abs(axis.x * corner[k].x) + std::abs(axis.y * corner[k].y) +
                   std::abs(axis.z * corner[k].z));
      const double most = reach * (1 + 1e-9) + 4 * rounding;
      if (std::min(on_edge, beyond) > most || std::max(on_edge, beyond) < -most) return true;
    }
  }
  return false;
}

bool is_doubtful(double winding) { return std::abs(winding - std::round(winding)) > 0.1; }

}  // namespace

InsideSampler::Grid::Grid(const InsideSampler& sampler, const SampleSweep& asked, int levels)
    : SampleGrid{asked.voxel, {}, asked.turn, asked.seed, asked.at_random},
      sweep(asked),
      back(transpose(asked.turn)) {
  const double half = 0.5 * static_cast<double>(std::int64_t{1} << levels);
  double x = half, y = half, z = half;
  if (!sweep.at_random) {
    const std::uint64_t bits = mix_bits(sweep.seed);
    x -= unit_fraction(bits), y -= unit_fraction(bits >> 21), z -= unit_fraction(bits >> 42);
  }
  origin = sampler.middle_;
  origin = place(-x, -y, -z);
}

void SampleTally::add(const SampleTally& other) {
  samples += other.samples;
  doubtful += other.doubtful;
  repeated += other.repeated;
  work += other.work;
}

InsideSampler::InsideSampler(const Surface& surface, bool closed)
    : surface_(surface), closed_(closed), winding_number_(surface) {
  bool first = true;
  Vec3d low, high;
  for (const Triangle& t : surface.triangle) {
    for (const Index corner : t) {
      const Vec3d p = surface.position[corner];
      if (first) low = high = p;
      first = false;
      low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
    }
    const Vec3d a = surface.position[t[0]], b = surface.position[t[1]], c = surface.position[t[2]];
    area_ += 0.5 * norm(cross(b - a, c - a));
    length_ += std::max({norm(b - a), norm(c - b), norm(a - c)});
  }
  middle_ = 0.5 * (low + high);
  extent_ = std::max({high.x - low.x, high.y - low.y, high.z - low.z});
  winding_work_ = mean_winding_work();
  // Long thin triangles have large overlapping groups, so that a winding number near them visits
  // most triangles; walking past hundreds then costs less.
  few_ = std::max(few_triangles, static_cast<std::size_t>(winding_work_ / 8));
}

/// The mean work of winding numbers at places on the surface.
Offset InsideSampler::mean_winding_work() const {
  constexpr std::size_t probes = 32;
  const std::size_t step = surface_.triangle.size() / probes + 1;
  Offset work = 0, probed = 0;
  for (std::size_t t = 0; t < surface_.triangle.size(); t += step, ++probed) {
    const Triangle& corner = surface_.triangle[t];
    winding_number_((surface_.position[corner[0]] + surface_.position[corner[1]] +
                     surface_.position[corner[2]]) /
                        3.0,
                    &work);
  }
  return work / std::max<Offset>(probed, 1);
}

bool InsideSampler::stays_inside(Vec3d before, Vec3d after, double most, ClearBall& ball) const {
  return phyxel::stays_inside(winding_number_.view(), before, after, most, ball,
                              [&](Vec3d place) { return inside(place); });
}

/// False if a separating axis shows that the triangle misses the cube. For an open surface only
/// the axes of the cube and the triangle's normal are tried, and a triangle may still miss the
/// cube: `agrees_throughout` is evidence, not proof, and such cells do not rely on it.
bool InsideSampler::may_touch(Vec3d a, Vec3d b, Vec3d c, double half) const {
  for (int axis = 0; axis < 3; ++axis) {
    const double p = component(a, axis), q = component(b, axis), r = component(c, axis);
    if (std::min({p, q, r}) > half || std::max({p, q, r}) < -half) return false;
  }
  const Vec3d normal = cross(b - a, c - a);
  const double reach = half * (std::abs(normal.x) + std::abs(normal.y) + std::abs(normal.z));
  if (std::abs(dot(normal, a)) > reach * (1 + 1e-9)) return false;
  return !closed_ || !parted_by_an_edge(a, b, c, half);
}

/// The winding number at `point`; its cost is added to the tally's work.
double InsideSampler::winding_at(Vec3d point, SampleTally& tally) const {
  return winding_number_(point, &tally.work);
}

/// The change of the winding number along the segment between two points of a cell of a closed
/// surface: one for each triangle that the segment crosses. Unset if rounding might decide.
std::optional<double> InsideSampler::change_between(const Cell& cell, Vec3d start, Vec3d point,
                                                    SampleTally& tally) const {
  tally.work += static_cast<Offset>(cell.triangles.size());
  const Vec3d way = point - start;
  const double length = norm(way);
  double change = 0;
  for (const Index index : cell.triangles) {
    const Triangle& t = surface_.triangle[index];
    const Vec3d a = surface_.position[t[0]] - start, b = surface_.position[t[1]] - start,
                c = surface_.position[t[2]] - start;
    const Vec3d normal = cross(b - a, c - a);
    const double size = std::max({norm(a), norm(b), norm(c)});
    // Six times the volumes of the tetrahedra of the triangle and either end.
    const double rounding = 1e-12 * size * size * size,
                 edge_rounding = 1e-12 * size * size * length;
    const double before = dot(a, normal), after = before - dot(way, normal);
    if ((before > rounding && after > rounding) || (before < -rounding && after < -rounding)) {
      continue;
    }
    const double u = dot(way, cross(a, b)), v = dot(way, cross(b, c)), w = dot(way, cross(c, a));
    if (std::min({u, v, w}) < -edge_rounding && std::max({u, v, w}) > edge_rounding) continue;
    const bool clear = std::min({std::abs(u), std::abs(v), std::abs(w)}) > edge_rounding &&
                       std::min(std::abs(before), std::abs(after)) > rounding;
    if (!clear) return std::nullopt;
    change += before > 0 ? -1 : 1;
  }
  return change;
}

/// The winding number at a point in a cell of a closed surface, from the one in the cell's middle.
/// If the segment meets an edge, as many do on surfaces with a plane of symmetry, a path with a
/// bend inside the cell is tried next.
double InsideSampler::winding_from(const Grid& grid, const Cell& cell, Vec3d point,
                                   SampleTally& tally) const {
  const Vec3d start = grid.middle(cell);
  if (const auto change = change_between(cell, start, point, tally)) return cell.winding + *change;
  const double length = norm(point - start);
  const Vec3d bend = 0.5 * (start + point) + length * Vec3d{0.137, 0.071, -0.193};
  const auto first = change_between(cell, start, bend, tally);
  const auto second = first ? change_between(cell, bend, point, tally) : std::nullopt;
  return second ? cell.winding + *first + *second : winding_at(point, tally);
}

/// True if a cell that no triangle of an open surface touches lies on one side of it. The winding
/// number is harmonic there and has no extremes inside the cell, so agreement of the middle and
/// the corners is good evidence.
bool InsideSampler::agrees_throughout(const Grid& grid, const Cell& cell,
                                      SampleTally& tally) const {
  const auto clear = [&](double w) {
    return (w > 0.5) == (cell.winding > 0.5) && std::abs(w - 0.5) > 0.1;
  };
  bool agrees = clear(cell.winding);
  const std::int64_t side = std::int64_t{1} << cell.level;
  for (int corner = 0; corner < 8 && agrees; ++corner) {
    agrees = clear(winding_at(grid.place(static_cast<double>(cell.x + (corner & 1) * side),
                                         static_cast<double>(cell.y + (corner >> 1 & 1) * side),
                                         static_cast<double>(cell.z + (corner >> 2) * side)),
                              tally));
  }
  return agrees;
}

/// Gives each child of a cell the triangles that may touch it.
/// @param half half the side of a child, or a little more [m]
void InsideSampler::deal_out(const Grid& grid, const Cell& cell, double half,
                             std::vector<Cell>& children) const {
  const Vec3d middle = grid.middle(cell);
  const double shift = 0.25 * grid.voxel * static_cast<double>(std::int64_t{1} << cell.level);
  for (const Index t : cell.triangles) {
    const Triangle& corner = surface_.triangle[t];
    const Vec3d a = grid.along_edges(surface_.position[corner[0]] - middle),
                b = grid.along_edges(surface_.position[corner[1]] - middle),
                c = grid.along_edges(surface_.position[corner[2]] - middle);
    // Along each axis most triangles are on one side.
    bool reaches[3][2];
    for (int axis = 0; axis < 3; ++axis) {
      const double p = component(a, axis), q = component(b, axis), r = component(c, axis);
      reaches[axis][0] = std::min({p, q, r}) <= half - shift;
      reaches[axis][1] = std::max({p, q, r}) >= shift - half;
    }
    for (int k = 0; k < 8; ++k) {
      if (!reaches[0][k & 1] || !reaches[1][k >> 1 & 1] || !reaches[2][k >> 2]) continue;
      const Vec3d to_child =
          shift * Vec3d{k & 1 ? 1.0 : -1.0, k >> 1 & 1 ? 1.0 : -1.0, k >> 2 ? 1.0 : -1.0};
      if (may_touch(a - to_child, b - to_child, c - to_child, half)) {
        children[k].triangles.push_back(t);
      }
    }
  }
}

std::vector<InsideSampler::Cell> InsideSampler::split(const Grid& grid, Cell& cell,
                                                      SampleTally& tally) const {
  std::vector<Cell> children(8);
  const std::int64_t side = std::int64_t{1} << (cell.level - 1);
  // Slightly enlarged, since sample points are rounded to float.
  const double half = 0.5 * grid.voxel * (static_cast<double>(side) + 1e-3);
  const bool few = closed_ && cell.triangles.size() <= few_;
  if (few && !cell.measured) {
    const double winding = winding_at(grid.middle(cell), tally);
    cell.measured = !is_doubtful(winding);
    cell.winding = std::round(winding);
  }
  for (int k = 0; k < 8; ++k) {
    Cell& child = children[k];
    child.level = cell.level - 1;
    child.x = cell.x + (k & 1) * side;
    child.y = cell.y + (k >> 1 & 1) * side;
    child.z = cell.z + (k >> 2) * side;
    child.known = cell.known;
    child.measured = cell.measured;
    child.winding = cell.winding;
  }
  if (cell.known) return children;
  deal_out(grid, cell, half, children);
  for (Cell& child : children) {
    tally.work += static_cast<Offset>(cell.triangles.size());
    const Vec3d middle = grid.middle(child);
    child.measured = false;
    if (child.level == 0) continue;
    if (few && cell.measured) {
      child.winding = winding_from(grid, cell, middle, tally);
      child.measured = !is_doubtful(child.winding);
    }
    if (!child.triangles.empty()) continue;
    if (!child.measured) child.winding = winding_at(middle, tally);
    child.known = closed_ || agrees_throughout(grid, child, tally);
  }
  return children;
}

void InsideSampler::fill(const Grid& grid, Cell& cell, SampleBlock& block,
                         SampleTally& tally) const {
  if (cell.known && !(cell.winding > 0.5)) return;
  if (cell.known) {
    fill_known(grid, cell, block, tally);
    return;
  }
  for (Cell& child : split(grid, cell, tally)) {
    if (child.level > 0) {
      fill(grid, child, block, tally);
    } else {
      add_sample(grid, cell, child, block, tally);
    }
  }
}

/// Adds a sample for each voxel of a cell inside the surface, in the order of `split`.
void InsideSampler::fill_known(const Grid& grid, const Cell& cell, SampleBlock& block,
                               SampleTally& tally) {
  constexpr int most = 1 << block_level;
  const int side = 1 << cell.level;
  // Bits of the voxels' coordinates, and of their rows along z.
  std::uint64_t z_bits[most], row_bits[most][most];
  if (grid.sweep.at_random) {
    std::uint64_t x_bits[most], y_bits[most];
    for (int k = 0; k < side; ++k) {
      x_bits[k] = bits_of(cell.x + k);
      y_bits[k] = bits_of(cell.y + k);
      z_bits[k] = bits_of(cell.z + k);
    }
    for (int x = 0; x < side; ++x) {
      for (int y = 0; y < side; ++y) {
        row_bits[x][y] = bits_of_row(grid.sweep.seed, x_bits[x], y_bits[y]);
      }
    }
  }
  const int voxels = side * side * side;
  for (int m = 0; m < voxels; ++m) {
    int x = 0, y = 0, z = 0;
    for (int bit = 0; bit < cell.level; ++bit) {
      const int octant = m >> 3 * bit;
      x |= (octant & 1) << bit;
      y |= (octant >> 1 & 1) << bit;
      z |= (octant >> 2 & 1) << bit;
    }
    Vec3d within{0.5, 0.5, 0.5};
    if (grid.sweep.at_random) within = random_in(row_bits[x][y], z_bits[z]);
    block.offset.push_back(grid.offset({cell.x + x, cell.y + y, cell.z + z}, within, block.centre));
  }
  tally.samples += voxels;
  tally.work += voxels;
  if (is_doubtful(cell.winding)) tally.doubtful += voxels;
  if (cell.winding > 1.5) tally.repeated += voxels;
}

void InsideSampler::add_sample(const Grid& grid, const Cell& parent, const Cell& cell,
                               SampleBlock& block, SampleTally& tally) const {
  const Voxel voxel{cell.x, cell.y, cell.z};
  block.offset.push_back(grid.offset(voxel, grid.within(voxel), block.centre));
  const Vec3d rounded = block.position(block.offset.size() - 1);
  const double winding = cell.known                   ? cell.winding
                         : parent.measured && closed_ ? winding_from(grid, parent, rounded, tally)
                                                      : winding_at(rounded, tally);
  if (!(winding > 0.5)) {
    block.offset.pop_back();
    return;
  }
  ++tally.samples;
  ++tally.work;
  tally.doubtful += is_doubtful(winding);
  tally.repeated += winding > 1.5;
}

void InsideSampler::descend(const Grid& grid, Cell& cell, SampleTally& tally, WorkLimit& limit,
                            const std::function<void(const SampleBlock&)>& visit_block) const {
  if (cell.known && !(cell.winding > 0.5)) return;
  if (limit.reached()) return;
  const double half = 0.5 * grid.voxel * static_cast<double>(std::int64_t{1} << cell.level);
  if (grid.sweep.wanted && !grid.sweep.wanted(grid.middle(cell), half)) return;
  const Offset before = tally.work;
  if (cell.level > block_level &&
      !(grid.sweep.coarse && grid.sweep.coarse(grid.middle(cell), half))) {
    std::vector<Cell> children = split(grid, cell, tally);
    limit.done += tally.work - before;
    for (Cell& child : children) descend(grid, child, tally, limit, visit_block);
    return;
  }
  const int doubled = cell.level - block_level;
  cell.x >>= doubled, cell.y >>= doubled, cell.z >>= doubled;
  cell.level = block_level;
  const SampleBlock block = filled(grid.coarser(doubled), cell, tally);
  limit.done += tally.work - before;
  if (!block.offset.empty()) visit_block(block);
}

/// The block of sample points in a cell.
SampleBlock InsideSampler::filled(const Grid& grid, Cell& cell, SampleTally& tally) const {
  SampleBlock block;
  block.centre = grid.middle(cell);
  block.voxel = grid.voxel;
  // The region is the cell one level up.
  Cell region;
  region.level = cell.level + 1;
  const std::int64_t side = std::int64_t{1} << region.level;
  region.x = cell.x & -side;
  region.y = cell.y & -side;
  region.z = cell.z & -side;
  block.region = grid.middle(region);
  // Sample points are rounded to float.
  block.region_radius = radius_of_samples(grid.voxel, side);
  fill(grid, cell, block, tally);
  return block;
}

/// The whole surface as one cell, at a level at which voxels contain it.
InsideSampler::Cell InsideSampler::root_of(const SampleSweep& sweep) const {
  Cell root;
  root.level = block_level;
  // A turned cube that contains the bounding box is as wide as the diagonal of the latter, at most;
  // and its position may be shifted by a voxel.
  const double width =
      sweep.at_random ? extent_ * 1.001 + sweep.voxel : extent_ * 1.733 + 3 * sweep.voxel;
  while (sweep.voxel * static_cast<double>(std::int64_t{1} << root.level) < width) ++root.level;
  root.triangles.resize(surface_.triangle.size());
  for (std::size_t t = 0; t < root.triangles.size(); ++t) root.triangles[t] = static_cast<Index>(t);
  return root;
}

/// Divides the root into tasks for many threads, unless that takes too much work.
std::vector<InsideSampler::Cell> InsideSampler::tasks_of(const Grid& grid, Cell root,
                                                         SampleTally& total) const {
  std::vector<Cell> tasks;
  tasks.push_back(std::move(root));
  while (total.work <= grid.sweep.most_work && tasks.size() < enough_tasks && !tasks.empty() &&
         tasks.front().level > block_level) {
    const auto n_cells = static_cast<std::ptrdiff_t>(tasks.size());
    std::vector<std::vector<Cell>> children(tasks.size());
#pragma omp parallel for schedule(dynamic)
    for (std::ptrdiff_t k = 0; k < n_cells; ++k) {
      SampleTally tally;
      children[k] = split(grid, tasks[k], tally);
      tasks[k] = {};
#pragma omp critical(phyxel_sample_tally)
      total.add(tally);
    }
    tasks.clear();
    for (std::vector<Cell>& of_cell : children) {
      for (Cell& child : of_cell) {
        if (!child.known || child.winding > 0.5) tasks.push_back(std::move(child));
      }
    }
  }
  return tasks;
}

SampleTally InsideSampler::visit(const SampleSweep& sweep, const Visit& visit_block,
                                 Stage* stage) const {
  Cell root = root_of(sweep);
  const Grid grid(*this, sweep, root.level);
  SampleTally total;
  std::vector<Cell> tasks = tasks_of(grid, std::move(root), total);
  WorkLimit limit{total.work, sweep.most_work};
  const auto n_tasks = static_cast<std::ptrdiff_t>(tasks.size());
  if (stage) stage->expect(tasks.size());
#pragma omp parallel for schedule(dynamic)
  for (std::ptrdiff_t task = 0; task < n_tasks; ++task) {
    SampleTally tally;
    descend(grid, tasks[task], tally, limit,
            [&](const SampleBlock& block) { visit_block(static_cast<std::size_t>(task), block); });
#pragma omp critical(phyxel_sample_tally)
    total.add(tally);
    if (stage) stage->count();
  }
  return total;
}

/// Adds the regions of a cell, in the order of `descend`.
void InsideSampler::add_regions(const Grid& grid, Cell& cell,
                                std::vector<SampleRegion>& regions) const {
  if (cell.known && !(cell.winding > 0.5)) return;
  const std::int64_t side = std::int64_t{1} << cell.level;
  const double half = 0.5 * grid.voxel * static_cast<double>(side);
  if (grid.sweep.wanted && !grid.sweep.wanted(grid.middle(cell), half)) return;
  if (side > region_side) {
    SampleTally unused;
    for (Cell& child : split(grid, cell, unused)) add_regions(grid, child, regions);
    return;
  }
  constexpr std::int64_t within = region_side - 1;
  SampleRegion region{.corner = {cell.x & ~within, cell.y & ~within, cell.z & ~within},
                      .blocks = 0xff,
                      .inside = cell.known};
  if (side == block_side) {
    region.blocks = static_cast<std::uint8_t>(
        1 << ((cell.x & within ? 1 : 0) + (cell.y & within ? 2 : 0) + (cell.z & within ? 4 : 0)));
  }
  regions.push_back(region);
}

InsideSampler::Regions InsideSampler::regions(const SampleSweep& sweep) const {
  Cell root = root_of(sweep);
  const Grid grid(*this, sweep, root.level);
  SampleTally unused;
  std::vector<Cell> tasks = tasks_of(grid, std::move(root), unused);
  std::vector<std::vector<SampleRegion>> of_task(tasks.size());
#pragma omp parallel for schedule(dynamic)
  for (std::size_t task = 0; task < tasks.size(); ++task) {
    add_regions(grid, tasks[task], of_task[task]);
  }
  Regions found{grid, {}};
  for (const std::vector<SampleRegion>& some : of_task) {
    found.list.insert(found.list.end(), some.begin(), some.end());
  }
  return found;
}

SampleTally InsideSampler::collect(const SampleSweep& sweep, std::vector<SampleBlock>& blocks,
                                   Stage* stage) const {
  std::vector<std::vector<SampleBlock>> by_task(most_tasks);
  const SampleTally tally = visit(
      sweep, [&](std::size_t task, const SampleBlock& block) { by_task[task].push_back(block); },
      stage);
  blocks.clear();
  for (std::vector<SampleBlock>& part : by_task) {
    std::move(part.begin(), part.end(), std::back_inserter(blocks));
    part = {};
  }
  return tally;
}

}  // namespace phyxel
