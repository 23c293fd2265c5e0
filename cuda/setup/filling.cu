// Compiled without fused multiplications, so that places are those of the CPU.
#include <algorithm>
#include <bit>
#include <cfloat>
#include <cub/block/block_reduce.cuh>
#include <type_traits>
#include <utility>

#include "device.hpp"
#include "mesh/filling_rules.hpp"
#include "mesh/nearest_site.hpp"
#include "phyxel/error.hpp"
#include "setup/device_faces.cuh"
#include "setup/device_table.cuh"
#include "setup/filling.hpp"

namespace phyxel::cuda {
namespace {

constexpr const char* name = "the filling of a surface";
/// Regions whose voxels are worked on together: 17 million voxels.
constexpr std::size_t regions_at_once = 1 << 15;
/// Blocks in a region.
constexpr int region_blocks = 8;

/// A test whether places are inside a closed surface, by its winding number.
struct InsideTest {
  WindingView tree;
  int* undecided;  ///< Is set if a winding number is far from whole ones.

  __device__ bool operator()(Vec3d place) const {
    Offset work = 0;
    const double winding = tree.winding(place, work);
    // The host may know the exact one, and arc tangents of host and device differ by rounding. The
    // expansion of distant groups errs by 0.05 at most.
    if (fabs(winding - rint(winding)) > 0.1) *undecided = 1;
    return winding > 0.5;
  }
};

/// Calls each(regions) for chunks of the regions, on the device.
template <class Each>
void for_each_chunk(const std::vector<SampleRegion>& regions, Each&& each) {
  for (std::size_t begin = 0; begin < regions.size(); begin += regions_at_once) {
    const std::size_t count = std::min(regions_at_once, regions.size() - begin);
    each(sent(std::span(regions).subspan(begin, count), name));
  }
}

/// The number of voxels in the wanted blocks of regions.
std::size_t voxels_of(const std::vector<SampleRegion>& regions) {
  std::size_t blocks = 0;
  for (const SampleRegion& region : regions) {
    blocks += static_cast<std::size_t>(std::popcount(region.blocks));
  }
  return blocks * block_voxels;
}

/// A voxel of a region, by its number among those of all regions.
struct VoxelHere {
  std::int64_t region;
  int block;  ///< Of the region.
  int voxel;  ///< Of the block.

  PHYXEL_HD explicit VoxelHere(std::int64_t number)
      : region(number / region_voxels),
        block(static_cast<int>(number % region_voxels) / block_voxels),
        voxel(static_cast<int>(number % block_voxels)) {}
};

/// A sample point, from the centre of its block [m], and that centre [m].
struct SamplePoint {
  Vec3d centre;
  Vec3<float> offset;

  PHYXEL_HD Vec3d place() const { return at_offset(centre, offset); }
};

/// The m-th sample point of a block.
PHYXEL_HD SamplePoint sample_of(const SampleGrid& grid, Voxel block, int m) {
  const Vec3d centre = grid.middle(block, block_side);
  const Voxel voxel = voxel_of(block, m);
  return {centre, grid.offset(voxel, grid.within(voxel), centre)};
}

/// The points from which nodes keep a distance, on the device.
struct MarksHere {
  DeviceTable deep, site, sample;
  double spacing, farthest;

  explicit MarksHere(const SurfaceMarks& marks, const DeviceArray<Vec3d>& sites)
      : deep(sites, depth_cell * marks.spacing),
        site(sites, site_cell * marks.spacing),
        sample(sent(marks.samples, name), sample_cell * marks.spacing),
        spacing(marks.spacing),
        farthest(marks.farthest) {}
};

/// Flags of the blocks of regions that lie deep inside as wholes.
DeviceArray<char> deep_blocks(const DeviceArray<SampleRegion>& regions, const SampleGrid& grid,
                              const MarksHere& marks) {
  DeviceArray<char> deep(region_blocks * regions.size(), name);
  for_each("find_deep_blocks", static_cast<std::int64_t>(deep.size()),
           [grid, regions = regions.data(), deep = deep.data(), site = marks.deep.view(),
            spacing = marks.spacing, farthest = marks.farthest] __device__(std::int64_t b) {
             const Vec3d centre = grid.middle(
                 regions[b / region_blocks].block(static_cast<int>(b % region_blocks)), block_side);
             deep[b] = is_deep(site, centre, radius_of_nodes(spacing), largest_clearance * spacing,
                               farthest);
           });
  return deep;
}

/// Flags of the voxels of regions whose nodes are inside. @param clearance receives theirs
DeviceArray<char> nodes_inside(const DeviceArray<SampleRegion>& regions, const SampleGrid& grid,
                               const InsideTest& inside, const MarksHere& marks,
                               const DeviceArray<float>& clearance) {
  const DeviceArray<char> deep = deep_blocks(regions, grid, marks);
  DeviceArray<char> flags(region_voxels * regions.size(), name);
  for_each("place_nodes", static_cast<std::int64_t>(flags.size()),
           [grid, inside, regions = regions.data(), deep = deep.data(), flags = flags.data(),
            clearance = clearance.data(), site = marks.site.view(), sample = marks.sample.view(),
            spacing = marks.spacing] __device__(std::int64_t n) {
             const VoxelHere v(n);
             const SampleRegion& region = regions[v.region];
             flags[n] = 0;
             if (!(region.blocks >> v.block & 1)) return;
             const Vec3d place = sample_of(grid, region.block(v.block), v.voxel).place();
             if (!region.inside && !inside(place)) return;
             flags[n] = 1;
             clearance[n] = static_cast<float>(deep[n / block_voxels]
                                                   ? largest_clearance
                                                   : clearance_at(site, sample, place, spacing));
           });
  return flags;
}

/// Appends the nodes of the flagged voxels.
void append_nodes(const DeviceArray<SampleRegion>& regions, const SampleGrid& grid,
                  const DeviceArray<char>& flags, const DeviceArray<float>& clearance,
                  LatticeNodes& nodes) {
  const DeviceArray<Index> number = flagged_numbers(flags);
  DeviceArray<Vec3d> position(number.size(), name);
  DeviceArray<float> found(number.size(), name);
  for_each("gather_nodes", static_cast<std::int64_t>(number.size()),
           [grid, regions = regions.data(), number = number.data(), clearance = clearance.data(),
            position = position.data(), found = found.data()] __device__(std::int64_t k) {
             const VoxelHere v(number[k]);
             position[k] = sample_of(grid, regions[v.region].block(v.block), v.voxel).place();
             found[k] = clearance[number[k]];
           });
  const std::size_t before = nodes.position.size();
  nodes.position.resize(before + number.size());
  nodes.clearance.resize(before + number.size());
  position.download(nodes.position.data() + before);
  found.download(nodes.clearance.data() + before);
}

/// Moves points by one sweep of repulsion.
void sweep(const DeviceArray<Vec3d>& point, const DeviceArray<Vec3d>& moved,
           const DeviceArray<char>& moves, const DeviceArray<ClearBall>& balls,
           const InsideTest& inside, const RepelledPoints& which) {
  const DeviceTable table(point, 0.5 * repulsion_reach * which.spacing);
  for_each("repel_nodes", static_cast<std::int64_t>(moved.size()),
           [table = table.view(), point = point.data() + which.fixed, moved = moved.data(),
            moves = moves.data(), balls = balls.data(), inside,
            fixed = static_cast<Index>(which.fixed), on_surface = which.on_surface,
            spacing = which.spacing, clear = which.clear] __device__(std::int64_t k) {
             const Vec3d before = point[k];
             moved[k] = before;
             if (!moves[k]) return;
             const Index self = fixed + static_cast<Index>(k);
             moved[k] = repelled_inside(
                 on_surface, before,
                 [&](auto&& strength) {
                   return step_of_repulsion(table, before, self, spacing, strength);
                 },
                 [&](Vec3d after) {
                   return stays_inside(inside.tree, before, after, clear, balls[k], inside);
                 });
           });
  PHYXEL_CUDA(cudaMemcpy(point.data() + which.fixed, moved.data(), moved.bytes(),
                         cudaMemcpyDeviceToDevice));
}

/// Sites that may be nearest to points of regions, region by region.
struct RegionSites {
  DeviceArray<Offset> start;  ///< Shape [regions + 1].
  DeviceArray<Index> index;
  DeviceArray<Vec3d> position;  ///< [m]
};

/// Calls visit(entry) for the sites that may be nearest to points of a region.
template <class Visit>
__device__ void visit_sites_of(const TableView& table, const SampleGrid& grid, Voxel corner,
                               Visit&& visit) {
  visit_nearest_sites(table, grid.middle(corner, region_side),
                      radius_of_samples(grid.voxel, region_side), visit);
}

/// Lists the sites that may be nearest to points of regions.
RegionSites sites_of(const DeviceArray<SampleRegion>& regions, const SampleGrid& grid,
                     const DeviceTable& table) {
  const auto count = static_cast<std::int64_t>(regions.size());
  const DeviceArray<Offset> number(regions.size(), name);
  for_each("count_sites", count,
           [grid, table = table.view(), regions = regions.data(),
            number = number.data()] __device__(std::int64_t r) {
             Offset found = 0;
             visit_sites_of(table, grid, regions[r].corner, [&](const auto&) { ++found; });
             number[r] = found;
           });
  RegionSites sites;
  sites.start = running_sums(number);
  const auto all = static_cast<std::size_t>(last_of(sites.start));
  sites.index = {all, name};
  sites.position = {all, name};
  for_each(
      "list_sites", count,
      [grid, table = table.view(), regions = regions.data(), start = sites.start.data(),
       index = sites.index.data(), position = sites.position.data()] __device__(std::int64_t r) {
        Offset at = start[r];
        visit_sites_of(table, grid, regions[r].corner, [&](const auto& entry) {
          index[at] = entry.index;
          position[at++] = entry.position;
        });
      });
  return sites;
}

/// A site and the square of its distance from a block's centre.
struct SiteNear {
  double distance2;
  Offset site;
};
/// The nearer one of two; of several at the same distance, the first.
struct Nearer {
  __device__ SiteNear operator()(const SiteNear& a, const SiteNear& b) const {
    if (a.distance2 != b.distance2) return a.distance2 < b.distance2 ? a : b;
    return a.site < b.site ? a : b;
  }
};

/// Candidates for the nearest sites of a block's points, from its centre.
struct Candidates {
  float x[block_voxels], y[block_voxels], z[block_voxels];
  bool may_be_nearest[block_voxels];
};

/// Gives each sample point of a block to the nearest site. One thread per voxel, one block of them
/// per block of a region.
__global__ void __launch_bounds__(block_voxels)
    share_samples(const SampleRegion* regions, SampleGrid grid, InsideTest inside,
                  const Offset* start, const Index* index, const Vec3d* position,
                  std::uint32_t* count) {
  const unsigned r = blockIdx.x / region_blocks;
  const int block = static_cast<int>(blockIdx.x % region_blocks), m = static_cast<int>(threadIdx.x);
  const SampleRegion region = regions[r];
  if (!(region.blocks >> block & 1)) return;
  const SamplePoint sample = sample_of(grid, region.block(block), m);
  const bool counts = region.inside || inside(sample.place());
  using Float = cub::BlockReduce<float, block_voxels>;
  using Site = cub::BlockReduce<SiteNear, block_voxels>;
  __shared__ union {
    typename Float::TempStorage of_float;
    typename Site::TempStorage of_site;
  } memory;
  __shared__ float largest2;
  __shared__ Offset nearest_site;
  __shared__ Candidates candidates;
  const float own2 = counts ? dot(sample.offset, sample.offset) : 0;
  const float all2 = Float(memory.of_float).Reduce(own2, Larger());
  if (m == 0) largest2 = all2;
  if (__syncthreads_count(counts) == 0) return;

  const Offset begin = start[r], end = start[r + 1];
  SiteNear own{HUGE_VAL, end};
  for (Offset s = begin + m; s < end; s += block_voxels) {
    const Vec3d apart = position[s] - sample.centre;
    own = Nearer()(own, {dot(apart, apart), s});
  }
  const SiteNear nearest = Site(memory.of_site).Reduce(own, Nearer());
  if (m == 0) nearest_site = nearest.site;
  __syncthreads();

  const Vec3d to_nearest = position[nearest_site] - sample.centre;
  const double ball = radius_of_block(largest2);
  float best = FLT_MAX;
  Offset owner = nearest_site;
  for (Offset first = begin; first < end; first += block_voxels) {
    const Offset here = end - first < block_voxels ? end - first : Offset{block_voxels};
    if (m < here) {
      const Vec3d apart = position[first + m] - sample.centre;
      candidates.may_be_nearest[m] = may_be_nearest(apart, to_nearest, ball);
      candidates.x[m] = static_cast<float>(apart.x);
      candidates.y[m] = static_cast<float>(apart.y);
      candidates.z[m] = static_cast<float>(apart.z);
    }
    __syncthreads();
    for (int c = 0; c < here; ++c) {
      if (!candidates.may_be_nearest[c]) continue;
      const float dx = sample.offset.x - candidates.x[c], dy = sample.offset.y - candidates.y[c],
                  dz = sample.offset.z - candidates.z[c];
      const float d2 = dx * dx + dy * dy + dz * dz;
      if (!(d2 < best)) continue;
      best = d2;
      owner = first + c;
    }
    __syncthreads();
  }
  if (counts) atomicAdd(count + index[owner], 1U);
}

/// The distance from each wanted point to the nearest other one [m].
std::vector<double> gaps_of(std::span<const Vec3d> point, double spacing,
                            std::span<const char> wanted) {
  const DeviceArray<Vec3d> here = sent(point, name);
  const DeviceArray<char> asked = sent(wanted, name);
  const DeviceTable table(here, spacing);
  const DeviceArray<double> gap(point.size(), name);
  for_each("find_gaps", static_cast<std::int64_t>(point.size()),
           [table = table.view(), point = here.data(), asked = asked.data(),
            gap = gap.data()] __device__(std::int64_t k) {
             gap[k] = asked[k]
                          ? sqrt(table.nearest(point[k], HUGE_VAL, static_cast<Index>(k)).distance2)
                          : 0;
           });
  return fetched(gap);
}

/// A scope with a pool of its own, on CUDA's default stream.
class Pooled {
 private:
  MemoryPool pool_{nullptr};
  PooledMemory scope_{pool_};
};

/// A surface on the GPU.
class SurfaceOnGpu : public SurfaceOnDevice {
 public:
  explicit SurfaceOnGpu(const WindingNumber& surface)
      : corners_(sent(surface.corners(), name)),
        nodes_(sent(surface.nodes(), name)),
        boxes_(sent(surface.boxes(), name)) {}

  std::optional<std::vector<Vec3d>> darts(std::span<const Vec3d> candidates,
                                          std::span<const Vec3d> before, double gap,
                                          std::uint64_t seed) const override {
    return unless_declined([&](const InsideTest&) {
      const Pooled pooled;
      return darts_on_device(candidates, before, gap, seed);
    });
  }

  bool even_out(std::span<Vec3d> point, const PointsOnFaces& faces) const override {
    return replaces(point, faces.fixed, [&](const InsideTest&) {
      const Pooled pooled;
      return evened_out(point, faces);
    });
  }

  std::optional<LatticeNodes> nodes(const InsideSampler::Regions& regions,
                                    const SurfaceMarks& marks) const override {
    return unless_declined([&](const InsideTest& inside) {
      const DeviceArray<Vec3d> sites = sent(marks.sites, name);
      const MarksHere here(marks, sites);
      LatticeNodes found;
      const std::size_t most = voxels_of(regions.list);
      found.position.reserve(most);
      found.clearance.reserve(most);
      for_each_chunk(regions.list, [&](const DeviceArray<SampleRegion>& some) {
        const DeviceArray<float> clearance(region_voxels * some.size(), name);
        const auto flags = nodes_inside(some, regions.grid, inside, here, clearance);
        append_nodes(some, regions.grid, flags, clearance, found);
      });
      return found;
    });
  }

  bool repel(std::span<Vec3d> point, const RepelledPoints& which) const override {
    return replaces(point, which.fixed, [&](const InsideTest& inside) {
      const DeviceArray<Vec3d> here = sent(std::span<const Vec3d>(point), name);
      const std::size_t count = point.size() - which.fixed;
      const DeviceArray<Vec3d> after(count, name);
      const DeviceArray<char> moves = sent(which.moves, name);
      const DeviceArray<ClearBall> balls(count, name);
      balls.clear();
      const Pooled pooled;
      for (int k = 0; k < which.sweeps; ++k) sweep(here, after, moves, balls, inside, which);
      return fetched(here, which.fixed, count);
    });
  }

  std::optional<std::vector<double>> gaps(std::span<const Vec3d> point, double spacing,
                                          std::span<const char> wanted) const override {
    return unless_declined([&](const InsideTest&) { return gaps_of(point, spacing, wanted); });
  }

  std::optional<std::vector<std::uint32_t>> samples_of_sites(const InsideSampler::Regions& regions,
                                                             std::span<const Vec3d> site,
                                                             double spacing) const override {
    return unless_declined([&](const InsideTest& inside) {
      const DeviceArray<Vec3d> here = sent(site, name);
      const DeviceTable table = widened_table(
          site.size(), spacing, [&](double cell_size) { return DeviceTable(here, cell_size); });
      const DeviceArray<std::uint32_t> count(site.size(), name);
      count.clear();
      for_each_chunk(regions.list, [&](const DeviceArray<SampleRegion>& some) {
        const RegionSites sites = sites_of(some, regions.grid, table);
        const auto blocks = static_cast<unsigned>(region_blocks * some.size());
        share_samples<<<blocks, block_voxels>>>(some.data(), regions.grid, inside,
                                                sites.start.data(), sites.index.data(),
                                                sites.position.data(), count.data());
        check_launch({"share_samples", blocks, block_voxels, name});
      });
      return fetched(count);
    });
  }

 private:
  /// Moves the points after the first `fixed` ones to the places that find(inside) returns.
  /// @returns false if it has none
  template <class Find>
  bool replaces(std::span<Vec3d> point, std::size_t fixed, Find&& find) const {
    const auto moved = unless_declined(find);
    if (moved) std::copy(moved->begin(), moved->end(), point.begin() + fixed);
    return moved.has_value();
  }

  /// The result of find(inside); none if the device lacks memory, or if a winding number is far
  /// from whole ones.
  template <class Find>
  auto unless_declined(Find&& find) const -> std::optional<std::invoke_result_t<Find, InsideTest>> {
    try {
      const DeviceArray<int> undecided(1, name);
      undecided.clear();
      auto found =
          find(InsideTest{{corners_.data(), nodes_.data(), boxes_.data()}, undecided.data()});
      if (last_of(undecided) != 0) return std::nullopt;
      return found;
    } catch (const DeviceMemoryError&) {
      return std::nullopt;
    }
  }

  DeviceArray<Corners> corners_;
  DeviceArray<WindingNode> nodes_;
  DeviceArray<TriangleBox> boxes_;
};

/// A GPU that fills surfaces.
class Gpu : public FillingDevice {
 public:
  Gpu(int device, Index least) : device_(device), least_(least) {}

  std::unique_ptr<SurfaceOnDevice> take(const WindingNumber& surface,
                                        Index phyxels) const override {
    if (phyxels < least_ || surface.nodes().empty()) return nullptr;
    use_cuda_device(device_);
    try {
      return std::make_unique<SurfaceOnGpu>(surface);
    } catch (const DeviceMemoryError&) {
      return nullptr;
    }
  }

 private:
  int device_;
  Index least_;
};

}  // namespace
}  // namespace phyxel::cuda

namespace phyxel {

std::shared_ptr<const FillingDevice> cuda_filling_device(int device, Index least) {
  return std::make_shared<const cuda::Gpu>(device, least);
}

}  // namespace phyxel
