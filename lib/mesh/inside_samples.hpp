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

/// Neighbouring sample points, at `centre` + offset.
struct SampleBlock {
  Vec3d centre;                     ///< [m]
  std::vector<Vec3<float>> offset;  ///< [m], shape [n].

  Vec3d position(std::size_t k) const {
    return centre + Vec3d{offset[k].x, offset[k].y, offset[k].z};
  }
};

/// What sampling found, beside the points.
struct SampleTally {
  Offset samples = 0;
  Offset doubtful = 0;  ///< Those with a winding number more than 0.1 from a whole number.
  Offset repeated = 0;  ///< Those the surface winds around more than once.
  /// Work done: one unit for each sample, each triangle held against a cell or a line, and each
  /// group of triangles in a winding number; `WindingNumber::angle_work` for each solid angle.
  Offset work = 0;
  void add(const SampleTally& other);
};

/// The inside of a surface, cut into voxels with one sample point at a random place in each. Space
/// is halved down to the voxels only near triangles, so that the empty part of a large box costs
/// nothing. A point is inside where the winding number is above one half.
class InsideSampler {
 public:
  /// The surface must outlive the sampler. `closed`: see SurfaceTopology.
  InsideSampler(const Surface& surface, bool closed);

  using Visit = std::function<void(std::size_t task, const SampleBlock&)>;

  static constexpr Offset no_limit = std::numeric_limits<Offset>::max();

  /// Calls visit(task, block) for blocks of up to 4 x 4 x 4 voxels with the side `voxel` [m]. The
  /// tasks run on many threads in any order, the blocks of one task in order; the blocks depend
  /// on `voxel` and `seed` only. A sweep that takes more than `most_work` ends early: the tally's
  /// work is then above it, and the blocks are incomplete.
  /// @param stage that this is all of; may be null
  SampleTally visit(double voxel, std::uint64_t seed, const Visit& visit_block,
                    Stage* stage = nullptr, Offset most_work = no_limit) const;

  /// All blocks, by task.
  SampleTally collect(double voxel, std::uint64_t seed, std::vector<SampleBlock>& blocks,
                      Stage* stage = nullptr, Offset most_work = no_limit) const;

  bool inside(Vec3d point) const { return winding_number_(point) > 0.5; }
  /// About how many voxels the surface passes through, all of which are looked at.
  double surface_voxels(double voxel) const { return (area_ / voxel + length_) / voxel; }
  double area() const { return area_; }      ///< Area of the surface [m^2].
  double extent() const { return extent_; }  ///< Longest side of its bounding box [m].
  Vec3d middle() const { return middle_; }   ///< Of its bounding box [m].

 private:
  /// A cube of 2^level voxels a side.
  struct Cell {
    std::int64_t x = 0, y = 0, z = 0;  ///< Lower corner in units of voxels.
    int level = 0;
    std::vector<Index> triangles;  ///< Those that may touch it.
    bool known = false;            ///< Whether all of it has the same `winding`.
    bool measured = false;         ///< Whether `winding` is known in the middle at least.
    double winding = 0;
  };
  /// The work of all tasks of a sweep, and how much they may do.
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
  std::size_t few_ = 0;  ///< Triangles up to which walking from a known point is faster.
  double extent_ = 0;
  double area_ = 0, length_ = 0;  ///< Of all triangles, and of their longest sides [m^2, m].
};

}  // namespace phyxel
