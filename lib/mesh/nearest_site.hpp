/// Search for the nearest of a set of sites for each of many sample points.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "mesh/inside_samples.hpp"
#include "model/spatial_hash.hpp"

namespace phyxel {

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
