#include "mesh/scattered_filling.hpp"

#include <algorithm>
#include <cmath>

#include "mesh/darts.hpp"
#include "mesh/nearest_site.hpp"
#include "mesh/relaxation.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// Moves sites that relaxation has left outside to a sample point of their cells: in a thin or
/// hollow body, the centroid of a cell may lie outside.
void bring_inside(const InsideSampler& sampler, SampledVoronoi& voronoi, std::vector<Vec3d>& site,
                  double spacing) {
  std::vector<std::uint8_t> outside(site.size());
  const auto n = static_cast<std::ptrdiff_t>(site.size());
#pragma omp parallel for schedule(dynamic, 256)
  for (std::ptrdiff_t i = 0; i < n; ++i) outside[i] = !sampler.inside(site[i]);
  if (std::count(outside.begin(), outside.end(), 1) > 0) voronoi.snap(site, spacing, outside);
}

}  // namespace

double samples_per_phyxel(Index phyxels) { return std::max(64.0, 20000.0 / phyxels); }

// A sample takes 16 bytes, in vectors that grow; a phyxel about 12 candidates of 40 bytes, and
// 200 bytes in sums, hashes and results.
double bytes_scattered(double samples) { return 24 * samples + 12 * 40 + 200; }

void fill_scattered(const InsideSampler& sampler, InsideFilling& filling,
                    const SampleRequest& request, double spacing, Cloud& cloud) {
  cloud.position = throw_darts(filling.blocks, request.phyxels, spacing, request.seed + 1);
  SampledVoronoi voronoi(std::move(filling.blocks));
  Stage relaxing("evening out distances");
  voronoi.relax(cloud.position, spacing, request.relaxations, 0, &relaxing);
  relaxing.finish();
  bring_inside(sampler, voronoi, cloud.position, spacing);
  Stage measuring("volumes of phyxels");
  cloud.volume =
      NearestSite(cloud.position, spacing)
          .volumes(sampler, {.voxel = 0.5 * filling.voxel, .seed = request.seed + 2}, measuring);
  measuring.finish();
}

}  // namespace phyxel
