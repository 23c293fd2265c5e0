/// Sample points that fill the inside of a surface evenly.
#pragma once

#include <atomic>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "mesh/sample_grid.hpp"
#include "mesh/winding_number.hpp"
#include "phyxel/cloud.hpp"

namespace phyxel {

class Stage;

/// A block of neighbouring sample points, at `centre` + `offset`.
struct SampleBlock {
  Vec3d centre;                     ///< [m]
  std::vector<Vec3<float>> offset;  ///< [m], shape [n].
  Vec3d region;  ///< Middle of the cube of 8 x 8 x 8 voxels that contains the block [m].
  double region_radius = 0;  ///< Radius of a ball that contains that cube [m]; 0: there is none.
  double voxel = 0;          ///< Side of the voxels, each with one sample point [m].

  Vec3d position(std::size_t k) const { return at_offset(centre, offset[k]); }
};

/// Counts made while sampling.
struct SampleTally {
  Offset samples = 0;   ///< Number of sample points inside.
  Offset doubtful = 0;  ///< Samples whose winding number is more than 0.1 from an integer.
  Offset repeated = 0;  ///< Samples with a winding number above one.
  /// Work done: one unit for each sample, each triangle tested against a cell or a line, and each
  /// group of triangles in a winding number; `WindingView::angle_work` for each solid angle.
  Offset work = 0;
  void add(const SampleTally& other);
};

/// One sweep over the voxels of a grid.
struct SampleSweep {
  double voxel = 0;        ///< Side of the voxels [m].
  std::uint64_t seed = 1;  ///< Seed of the points' positions in their voxels, or of the grid's.
  /// True for a sample point at a random position in each voxel of a grid along the axes; false for
  /// one in the middle of each voxel of a grid turned by `turn`, at a random position.
  bool at_random = true;
  Mat3d turn = identity<double>();
  /// Tells whether a cube, given by its middle and half its side [m], is wanted; one that is not
  /// may be left out. Called on many threads. Null: all are.
  std::function<bool(Vec3d middle, double half)> wanted;
  /// Tells whether a cube, given likewise, may be one block: its voxels are then a quarter of its
  /// side, which is that of `voxel` doubled some times. The largest cubes are divided all the same,
  /// into tasks for many threads. Null: no cube, and all voxels have the same size.
  std::function<bool(Vec3d middle, double half)> coarse;
  Offset most_work = std::numeric_limits<Offset>::max();  ///< Upper limit of the work.
};

/// Sampler of the inside of a surface: voxels, each with one sample point.
/// An octree is refined down to the voxels near triangles only, so that the empty part of a large
/// box costs nothing. A point is inside if its winding number is above one half.
class InsideSampler {
 public:
  /// @param surface must outlive the sampler
  /// @param closed see `SurfaceTopology`
  InsideSampler(const Surface& surface, bool closed);

  using Visit = std::function<void(std::size_t task, const SampleBlock&)>;

  /// Upper limit of the number of tasks of a sweep.
  static constexpr std::size_t most_tasks = 3200;

  /// Calls visit_block(task, block) for blocks of up to 4 x 4 x 4 voxels. Tasks run on many threads
  /// in any order, the blocks of one task in order; the blocks depend on the sweep only. A sweep
  /// that takes more than `most_work` ends early: the tally's work is then above the limit, and the
  /// blocks are incomplete.
  /// @param stage reports the progress of the sweep; may be null
  SampleTally visit(const SampleSweep& sweep, const Visit& visit_block,
                    Stage* stage = nullptr) const;

  /// Collects the blocks of a sweep in the order of their tasks.
  SampleTally collect(const SampleSweep& sweep, std::vector<SampleBlock>& blocks,
                      Stage* stage = nullptr) const;

  /// The regions of a closed surface's inside that `visit` would take blocks from, in its order:
  /// the points of those that do not lie inside as wholes have to be tested. A sweep's `wanted` is
  /// not asked about single blocks of a region.
  struct Regions {
    SampleGrid grid;
    std::vector<SampleRegion> list;
  };
  /// @param sweep without `coarse` and without a limit of the work
  Regions regions(const SampleSweep& sweep) const;

  bool inside(Vec3d point) const { return winding_number_(point) > 0.5; }
  /// Tells whether a step stays inside; see the function of that name.
  bool stays_inside(Vec3d before, Vec3d after, double most, ClearBall& ball) const;
  const WindingNumber& winding_number() const { return winding_number_; }
  /// The mean work of a winding number near the surface, in the units of `SampleTally::work`: large
  /// beside long thin triangles, whose groups overlap.
  Offset winding_work() const { return winding_work_; }
  /// Approximate number of voxels that the surface passes through; the sampler visits each.
  double surface_voxels(double voxel) const { return (area_ / voxel + length_) / voxel; }
  double area() const { return area_; }      ///< Area of the surface [m^2].
  double extent() const { return extent_; }  ///< Longest side of the surface's bounding box [m].
  Vec3d middle() const { return middle_; }   ///< Centre of the surface's bounding box [m].

 private:
  /// A cube of 2^level voxels a side.
  struct Cell {
    std::int64_t x = 0, y = 0, z = 0;  ///< Lower corner in units of voxels.
    int level = 0;
    std::vector<Index> triangles;  ///< Triangles that may touch the cell.
    bool known = false;            ///< True if the whole cell has the same `winding`.
    bool measured = false;         ///< True if `winding` is known at least in the middle.
    double winding = 0;            ///< Winding number.
  };
  /// The work that the tasks of a sweep have done, and its upper limit.
  struct WorkLimit {
    std::atomic<Offset> done = 0;
    Offset most = 0;
    bool reached() const { return done.load(std::memory_order_relaxed) > most; }
  };
  struct Grid : SampleGrid {
    Grid(const InsideSampler& sampler, const SampleSweep& sweep, int levels);
    /// The same places, by voxels whose side is doubled `times` times.
    Grid coarser(int times) const {
      Grid made = *this;
      made.voxel = std::ldexp(voxel, times);
      return made;
    }

    const SampleSweep& sweep;
    Mat3d back;  ///< Inverse of the turn.
    /// A vector's components along the edges of the voxels.
    Vec3d along_edges(Vec3d v) const { return sweep.at_random ? v : back * v; }
    using SampleGrid::middle;
    Vec3d middle(const Cell& cell) const {
      return middle({cell.x, cell.y, cell.z}, std::int64_t{1} << cell.level);
    }
  };

  Cell root_of(const SampleSweep& sweep) const;
  std::vector<Cell> tasks_of(const Grid& grid, Cell root, SampleTally& total) const;
  void add_regions(const Grid& grid, Cell& cell, std::vector<SampleRegion>& regions) const;
  std::vector<Cell> split(const Grid& grid, Cell& cell, SampleTally& tally) const;
  Offset mean_winding_work() const;
  /// @param a, b, c corners of the triangle, relative to the cube's middle and along its edges [m]
  bool may_touch(Vec3d a, Vec3d b, Vec3d c, double half) const;
  void deal_out(const Grid& grid, const Cell& cell, double half, std::vector<Cell>& children) const;
  double winding_at(Vec3d point, SampleTally& tally) const;
  std::optional<double> change_between(const Cell& cell, Vec3d start, Vec3d point,
                                       SampleTally& tally) const;
  double winding_from(const Grid& grid, const Cell& cell, Vec3d point, SampleTally& tally) const;
  bool agrees_throughout(const Grid& grid, const Cell& cell, SampleTally& tally) const;
  void descend(const Grid& grid, Cell& cell, SampleTally& tally, WorkLimit& limit,
               const std::function<void(const SampleBlock&)>& visit_block) const;
  SampleBlock filled(const Grid& grid, Cell& cell, SampleTally& tally) const;
  void fill(const Grid& grid, Cell& cell, SampleBlock& block, SampleTally& tally) const;
  static void fill_known(const Grid& grid, const Cell& cell, SampleBlock& block,
                         SampleTally& tally);
  void add_sample(const Grid& grid, const Cell& parent, const Cell& cell, SampleBlock& block,
                  SampleTally& tally) const;

  const Surface& surface_;
  bool closed_;
  WindingNumber winding_number_;
  Vec3d middle_;
  Offset winding_work_ = 0;
  std::size_t few_ = 0;  ///< Number of triangles up to which walking from a known point is faster.
  double extent_ = 0;
  double area_ = 0;    ///< Sum of the triangles' areas [m^2].
  double length_ = 0;  ///< Sum of the triangles' longest sides [m].
};

}  // namespace phyxel
