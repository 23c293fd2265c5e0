/// Even distribution of a given number of points over a set of sample points.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "mesh/inside_samples.hpp"
#include "mesh/spacing_field.hpp"
#include "model/spatial_hash.hpp"

namespace phyxel {

/// A Voronoi diagram of sites, restricted to the inside of a surface and represented by sample
/// points, each with its nearest site.
class SampledVoronoi {
 public:
  explicit SampledVoronoi(std::vector<SampleBlock> blocks);

  const std::vector<SampleBlock>& blocks() const { return blocks_; }

  /// Moves each site to the centroid of its cell, `sweeps` times (Lloyd 1982). A site that owns no
  /// sample point is moved into one of the largest cells. The first `fixed` sites stay.
  /// @param stage is told the share of sweeps that is done; may be null
  void relax(std::vector<Vec3d>& site, double spacing, int sweeps, std::size_t fixed = 0,
             Stage* stage = nullptr);

  /// Moves each site with a nonzero `which` to the nearest sample point of its cell; a site without
  /// sample points is moved as in relax(). The first `fixed` sites stay.
  void snap(std::vector<Vec3d>& site, double spacing, const std::vector<std::uint8_t>& which,
            std::size_t fixed = 0);

 private:
  void assign(const std::vector<Vec3d>& site, double spacing);
  void add_up_cells(Vec3d origin, std::vector<Vec3d>& sum, std::vector<Offset>& count) const;
  void settle_homeless(std::vector<Vec3d>& site, const std::vector<Offset>& count,
                       std::size_t fixed) const;

  std::vector<SampleBlock> blocks_;
  std::vector<Offset> first_;  ///< Sample points before each block, shape [n_blocks + 1].
  std::vector<Index> owner_;   ///< Nearest site, shape [n_samples].
};

}  // namespace phyxel
