/// Search for the nearest of a set of sites for each of many sample points.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "mesh/inside_samples.hpp"
#include "model/spatial_hash.hpp"

namespace phyxel {

/// Makes a table of sites with cells at least 1.2 spacings wide, and wider if the sites are sparse:
/// in a sheet or thread thinner than a spacing, sites are many spacings apart, and a search would
/// visit empty cells.
/// @param make make(cell_size) makes a table
template <class Make>
auto widened_table(std::size_t sites, double spacing, Make&& make) {
  auto table = make(1.2 * spacing);
  // Occupied cells have 1.9 sites on average if the sites fill space, more than 1.05 on a face.
  while (table.mean_occupancy() < 1.05 && sites > 1) table = make(2 * table.cell_size());
  return table;
}

/// The volumes [m^3] of sites that got so many sample points; one without any gets half of one's.
/// @param voxel side of the voxels [m]
std::vector<double> volumes_of_samples(const std::vector<std::uint32_t>& count, double voxel);

/// Search for the nearest of a set of sites for each point of a block.
class NearestSite {
 public:
  /// @param site must outlive the search
  /// @param spacing typical distance between sites [m]
  NearestSite(const std::vector<Vec3d>& site, double spacing);

  /// Sites, in arrays for vector units. @tparam Real type of the coordinates
  template <class Real>
  struct Sites {
    std::vector<Index> index;
    std::vector<Real> x, y, z;  ///< [m]

    std::size_t size() const { return index.size(); }
    Vec3d at(std::size_t k) const { return {x[k], y[k], z[k]}; }
    void clear();
    void add(Index site, Vec3d place);
  };
  /// Work space that one thread reuses from block to block, with one search only.
  struct Scratch {
    std::vector<Index> owner;  ///< Result: the nearest site of each point, shape [n].

    /// Middle of the region whose sites were found last [m].
    Vec3d region{NAN, NAN, NAN};
    Sites<double> of_region;  ///< Sites that may be nearest to a point of the region.
    Sites<float> candidate;   ///< Sites of the region that may be nearest to a point of the block.
    std::vector<float> x, y, z, best;
    std::vector<std::int32_t> slot;
  };
  /// Finds the nearest site of each point of a block.
  void find(const SampleBlock& block, Scratch& scratch) const;

  /// Finds the volume [m^3] that sample points give to each site, the nearest one; a site without
  /// sample points gets half of one's. @param stage is told the progress
  /// @param counts tells whether a sample point counts, on many threads; null: all do
  std::vector<double> volumes(const InsideSampler& sampler, const SampleSweep& sweep, Stage& stage,
                              const std::function<bool(Vec3d)>& counts = nullptr) const;
  /// The number of sample points that each site gets, likewise.
  std::vector<std::uint32_t> samples_of_sites(
      const InsideSampler& sampler, const SampleSweep& sweep, Stage& stage,
      const std::function<bool(Vec3d)>& counts = nullptr) const;

 private:
  void find_region(Vec3d middle, double radius, Scratch& scratch) const;

  SpatialHash hash_;
  std::size_t sites_;
};

}  // namespace phyxel
