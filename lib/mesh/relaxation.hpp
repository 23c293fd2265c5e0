/// Spreading a given number of points evenly over a set of sample points.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "mesh/inside_samples.hpp"
#include "model/spatial_hash.hpp"

namespace phyxel {

/// Picks exactly n of the sample points, far from each other: random points are taken or refused
/// by their distance to those taken before, and the distance asked for shrinks until n are found.
/// Source: McCool and Fiume 1992 (dart throwing with a shrinking radius). `spacing`: cube root of
/// the volume of one point [m]. `before`: points that are there already.
std::vector<Vec3d> throw_darts(const std::vector<SampleBlock>& blocks, Index n, double spacing,
                               std::uint64_t seed, std::span<const Vec3d> before = {});

/// As many sample points as fit with `gap` [m] between them, and between them and those `before`.
std::vector<Vec3d> fill_with_darts(const std::vector<SampleBlock>& blocks, double gap,
                                   std::uint64_t seed, std::span<const Vec3d> before);

/// Finds the nearest of a set of sites for all points of a block at once.
class NearestSite {
 public:
  /// `spacing`: typical distance between sites [m]. The sites must outlive this.
  NearestSite(const std::vector<Vec3d>& site, double spacing);

  /// Space that one thread reuses from block to block.
  struct Scratch {
    std::vector<float> x, y, z, best;
    std::vector<std::int32_t> slot;
    std::vector<Index> owner;  ///< The answer, shape [n].
    std::vector<Index> candidate;
    std::vector<Vec3<float>> candidate_offset;
  };
  void find(const SampleBlock& block, Scratch& scratch) const;

 private:
  SpatialHash hash_;
};

/// The sample points with the site that each is nearest to: a Voronoi diagram cut to the inside.
class SampledVoronoi {
 public:
  explicit SampledVoronoi(std::vector<SampleBlock> blocks);

  const std::vector<SampleBlock>& blocks() const { return blocks_; }

  /// Moves every site to the centroid of its cell, `sweeps` times (Lloyd 1982); sites that own no
  /// sample point are put into the largest cells. The first `fixed` sites stay.
  void relax(std::vector<Vec3d>& site, double spacing, int sweeps, std::size_t fixed = 0);

  /// Moves the sites named to the nearest sample point of their cells; those without any as
  /// relax() does. The first `fixed` stay.
  void snap(std::vector<Vec3d>& site, double spacing, const std::vector<std::uint8_t>& which,
            std::size_t fixed = 0);

 private:
  void assign(const std::vector<Vec3d>& site, double spacing);
  void settle_homeless(std::vector<Vec3d>& site, const std::vector<Offset>& count,
                       std::size_t fixed) const;

  std::vector<SampleBlock> blocks_;
  std::vector<Offset> first_;  ///< Sample points before each block, shape [n_blocks + 1].
  std::vector<Index> owner_;   ///< Nearest site, shape [n_samples].
};

}  // namespace phyxel
