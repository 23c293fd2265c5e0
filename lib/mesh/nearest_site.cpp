#include "mesh/nearest_site.hpp"

#include <omp.h>

#include <algorithm>

#include "mesh/filling_rules.hpp"
#include "mesh/nearest_points.hpp"
#include "stage.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

SpatialHash hash_of(const std::vector<Vec3d>& site, double spacing) {
  return widened_table(site.size(), spacing,
                       [&](double cell_size) { return SpatialHash(site, cell_size); });
}

}  // namespace

NearestSite::NearestSite(const std::vector<Vec3d>& site, double spacing)
    : hash_(hash_of(site, spacing)), sites_(site.size()) {}

template <class Real>
void NearestSite::Sites<Real>::clear() {
  index.clear();
  x.clear();
  y.clear();
  z.clear();
}

template <class Real>
void NearestSite::Sites<Real>::add(Index site, Vec3d place) {
  index.push_back(site);
  x.push_back(static_cast<Real>(place.x));
  y.push_back(static_cast<Real>(place.y));
  z.push_back(static_cast<Real>(place.z));
}

/// Finds the sites that may be nearest to a point of a ball, unless they were found last.
void NearestSite::find_region(Vec3d middle, double radius, Scratch& s) const {
  if (s.region.x == middle.x && s.region.y == middle.y && s.region.z == middle.z) return;
  s.region = middle;
  s.of_region.clear();
  visit_nearest_sites(hash_, middle, radius, [&](const SpatialHash::Entry& entry) {
    s.of_region.add(entry.index, entry.position);
  });
}

void NearestSite::find(const SampleBlock& block, Scratch& s) const {
  const std::size_t n = block.offset.size();
  s.x.resize(n);
  s.y.resize(n);
  s.z.resize(n);
  float ball2 = 0;  // squared radius of the block about its centre
  for (std::size_t k = 0; k < n; ++k) {
    const Vec3<float> p = block.offset[k];
    s.x[k] = p.x;
    s.y[k] = p.y;
    s.z[k] = p.z;
    ball2 = std::max(ball2, dot(p, p));
  }
  const double ball = radius_of_block(ball2);

  if (block.region_radius > 0) {
    find_region(block.region, block.region_radius, s);
  } else {
    find_region(block.centre, ball, s);
  }
  const Sites<double>& near = s.of_region;
  Vec3d nearest = near.at(0) - block.centre;
  for (std::size_t k = 1; k < near.size(); ++k) {
    const Vec3d d = near.at(k) - block.centre;
    if (dot(d, d) < dot(nearest, nearest)) nearest = d;
  }
  s.candidate.clear();
  for (std::size_t k = 0; k < near.size(); ++k) {
    const Vec3d d = near.at(k) - block.centre;
    if (may_be_nearest(d, nearest, ball)) s.candidate.add(near.index[k], d);
  }

  s.best.resize(n);
  s.slot.resize(n);
  find_nearest(
      {n, s.x.data(), s.y.data(), s.z.data()},
      {s.candidate.size(), s.candidate.x.data(), s.candidate.y.data(), s.candidate.z.data()},
      s.best.data(), s.slot.data());
  s.owner.resize(n);
  for (std::size_t k = 0; k < n; ++k) s.owner[k] = s.candidate.index[s.slot[k]];
}

std::vector<std::uint32_t> NearestSite::samples_of_sites(
    const InsideSampler& sampler, const SampleSweep& sweep, Stage& stage,
    const std::function<bool(Vec3d)>& counts) const {
  std::vector<std::uint32_t> count(sites_, 0);
  std::vector<Scratch> of_thread(static_cast<std::size_t>(omp_get_max_threads()));
  sampler.visit(
      sweep,
      [&](std::size_t, const SampleBlock& block) {
        Scratch& scratch = of_thread[static_cast<std::size_t>(omp_get_thread_num())];
        find(block, scratch);
        // Samples of a site mostly follow one another.
        const std::vector<Index>& owner = scratch.owner;
        for (std::size_t k = 0; k < owner.size();) {
          const Index site = owner[k];
          std::uint32_t samples = 0;
          for (; k < owner.size() && owner[k] == site; ++k) {
            samples += !counts || counts(block.position(k)) ? 1 : 0;
          }
          if (samples == 0) continue;
#pragma omp atomic
          count[site] += samples;
        }
      },
      &stage);
  return count;
}

std::vector<double> NearestSite::volumes(const InsideSampler& sampler, const SampleSweep& sweep,
                                         Stage& stage,
                                         const std::function<bool(Vec3d)>& counts) const {
  return volumes_of_samples(samples_of_sites(sampler, sweep, stage, counts), sweep.voxel);
}

std::vector<double> volumes_of_samples(const std::vector<std::uint32_t>& count, double voxel) {
  return tabulated(count.size(), [&](std::size_t i) {
    return std::max(0.5, double(count[i])) * std::pow(voxel, 3);
  });
}

}  // namespace phyxel
