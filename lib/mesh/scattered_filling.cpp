#include "mesh/scattered_filling.hpp"

#include <algorithm>
#include <cmath>

#include "mesh/relaxation.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// Share of each phyxel in the volume [m^3], from sample points on voxels half as large as those of
/// the relaxation.
std::vector<double> voronoi_shares(const InsideSampler& sampler, const std::vector<Vec3d>& site,
                                   double voxel, double spacing, std::uint64_t seed) {
  Stage stage("volumes of phyxels");
  const double fine = 0.5 * voxel;
  const NearestSite nearest(site, spacing);
  std::vector<std::uint32_t> count(site.size(), 0);
  sampler.visit({.voxel = fine, .seed = seed}, nearest.count_into(count), &stage);
  std::vector<double> share(site.size());
  // A phyxel without sample points gets the volume of half a sample.
  for (std::size_t i = 0; i < site.size(); ++i) {
    share[i] = std::max(0.5, double(count[i])) * std::pow(fine, 3);
  }
  stage.finish();
  return share;
}

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
  Stage evening("evening out distances");
  voronoi.relax(cloud.position, spacing, request.relaxations, 0, &evening);
  evening.finish();
  bring_inside(sampler, voronoi, cloud.position, spacing);
  cloud.volume = voronoi_shares(sampler, cloud.position, filling.voxel, spacing, request.seed + 2);
}

}  // namespace phyxel
