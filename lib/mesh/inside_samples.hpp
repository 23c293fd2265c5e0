/// Sample points that fill the inside of a surface evenly.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "mesh/winding_number.hpp"
#include "phyxel/cloud.hpp"

namespace phyxel {

class Stage;

/// A block of neighbouring sample points, at `centre` + `offset`.
struct SampleBlock {
  Vec3d centre;                     ///< [m]
  std::vector<Vec3<float>> offset;  ///< [m], shape [n].

  Vec3d position(std::size_t k) const {
    return centre + Vec3d{offset[k].x, offset[k].y, offset[k].z};
  }
};

/// Counts made while sampling.
struct SampleTally {
  Offset samples = 0;   ///< Number of sample points inside.
  Offset doubtful = 0;  ///< Samples whose winding number is more than 0.1 from an integer.
  Offset repeated = 0;  ///< Samples with a winding number above one.
  /// Work done: one unit for each sample, each triangle tested against a cell or a line, and each
  /// group of triangles in a winding number; `WindingNumber::angle_work` for each solid angle.
  Offset work = 0;
  void add(const SampleTally& other);
};

/// Sampler of the inside of a surface: voxels, each with one sample point at a random position.
/// An octree is refined down to the voxels near triangles only, so that the empty part of a large
/// box costs nothing. A point is inside if its winding number is above one half.
class InsideSampler {
 public:
  /// @param surface must outlive the sampler
  /// @param closed see `SurfaceTopology`
  InsideSampler(const Surface& surface, bool closed);

  using Visit = std::function<void(std::size_t task, const SampleBlock&)>;

  static constexpr Offset no_limit = std::numeric_limits<Offset>::max();

  /// Calls visit_block(task, block) for blocks of up to 4 x 4 x 4 voxels with the side `voxel` [m].
  /// Tasks run on many threads in any order, the blocks of one task in order; the blocks depend
  /// on `voxel` and `seed` only. A sweep that takes more than `most_work` ends early: the tally's
  /// work is then above the limit, and the blocks are incomplete.
  /// @param stage reports the progress of the sweep; may be null
  SampleTally visit(double voxel, std::uint64_t seed, const Visit& visit_block,
                    Stage* stage = nullptr, Offset most_work = no_limit) const;

  /// Collects the blocks of a sweep in the order of their tasks.
  SampleTally collect(double voxel, std::uint64_t seed, std::vector<SampleBlock>& blocks,
                      Stage* stage = nullptr, Offset most_work = no_limit) const;

  bool inside(Vec3d point) const { return winding_number_(point) > 0.5; }
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
    Offset most = no_limit;
    bool reached() const { return done.load(std::memory_order_relaxed) > most; }
  };
  struct Grid {
    Vec3d origin;
    double voxel;
    std::uint64_t seed;
    Vec3d place(double x, double y, double z) const { return origin + voxel * Vec3d{x, y, z}; }
    Vec3d middle(const Cell& cell) const {
      const double half = 0.5 * static_cast<double>(std::int64_t{1} << cell.level);
      return place(static_cast<double>(cell.x) + half, static_cast<double>(cell.y) + half,
                   static_cast<double>(cell.z) + half);
    }
  };

  std::vector<Cell> split(const Grid& grid, Cell& cell, SampleTally& tally) const;
  std::size_t few_for_walking() const;
  bool may_touch(Index triangle, Vec3d middle, double half) const;
  double winding_at(Vec3d point, SampleTally& tally) const;
  std::optional<double> change_between(const Cell& cell, Vec3d start, Vec3d point,
                                       SampleTally& tally) const;
  double winding_from(const Grid& grid, const Cell& cell, Vec3d point, SampleTally& tally) const;
  bool agrees_throughout(const Grid& grid, const Cell& cell, SampleTally& tally) const;
  void descend(const Grid& grid, Cell& cell, SampleTally& tally, WorkLimit& limit,
               const std::function<void(const SampleBlock&)>& visit_block) const;
  void fill(const Grid& grid, Cell& cell, SampleBlock& block, SampleTally& tally) const;
  void add_sample(const Grid& grid, const Cell& parent, const Cell& cell, SampleBlock& block,
                  SampleTally& tally) const;

  const Surface& surface_;
  bool closed_;
  WindingNumber winding_number_;
  Vec3d middle_;
  std::size_t few_ = 0;  ///< Number of triangles up to which walking from a known point is faster.
  double extent_ = 0;
  double area_ = 0;    ///< Sum of the triangles' areas [m^2].
  double length_ = 0;  ///< Sum of the triangles' longest sides [m].
};

}  // namespace phyxel
