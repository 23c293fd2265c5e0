#include "mesh/relaxation.hpp"

#include <omp.h>

#include <algorithm>
#include <cmath>

#include "mesh/nearest_site.hpp"
#include "stage.hpp"
#include "tabulated.hpp"

namespace phyxel {

SampledVoronoi::SampledVoronoi(std::vector<SampleBlock> blocks) : blocks_(std::move(blocks)) {
  first_.push_back(0);
  for (const SampleBlock& block : blocks_) {
    first_.push_back(first_.back() + static_cast<Offset>(block.offset.size()));
  }
  owner_.resize(static_cast<std::size_t>(first_.back()));
}

void SampledVoronoi::assign(const std::vector<Vec3d>& site, double spacing) {
  const NearestSite nearest(site, spacing);
  const auto n_blocks = static_cast<std::ptrdiff_t>(blocks_.size());
#pragma omp parallel
  {
    NearestSite::Scratch scratch;
#pragma omp for schedule(dynamic, 64)
    for (std::ptrdiff_t b = 0; b < n_blocks; ++b) {
      nearest.find(blocks_[b], scratch);
      std::copy(scratch.owner.begin(), scratch.owner.end(), owner_.begin() + first_[b]);
    }
  }
}

void SampledVoronoi::add_up_cells(Vec3d origin, std::vector<Vec3d>& sum,
                                  std::vector<Offset>& count) const {
  // Each thread has a range of the sites and goes through all samples, so that the rounding of the
  // sums does not depend on the number of threads.
#pragma omp parallel
  {
    const auto thread = static_cast<std::size_t>(omp_get_thread_num()),
               threads = static_cast<std::size_t>(omp_get_num_threads());
    const auto first = static_cast<Index>(sum.size() * thread / threads),
               last = static_cast<Index>(sum.size() * (thread + 1) / threads);
    std::fill(sum.begin() + first, sum.begin() + last, Vec3d{});
    std::fill(count.begin() + first, count.begin() + last, 0);
    for (std::size_t b = 0; b < blocks_.size(); ++b) {
      const SampleBlock& block = blocks_[b];
      const Index* const owner = owner_.data() + first_[b];
      for (std::size_t k = 0; k < block.offset.size(); ++k) {
        const Index i = owner[k];
        if (i < first || i >= last) continue;
        sum[i] += block.position(k) - origin;
        ++count[i];
      }
    }
  }
}

void SampledVoronoi::relax(std::vector<Vec3d>& site, double spacing, int sweeps, std::size_t fixed,
                           Stage* stage) {
  const Vec3d origin = blocks_.front().centre;
  std::vector<Vec3d> sum(site.size());
  std::vector<Offset> count(site.size());
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    assign(site, spacing);
    add_up_cells(origin, sum, count);
    bool homeless = false;
    for (std::size_t i = fixed; i < site.size(); ++i) {
      if (count[i] > 0) site[i] = origin + sum[i] / static_cast<double>(count[i]);
      homeless |= count[i] == 0;
    }
    if (homeless) settle_homeless(site, count, fixed);
    if (stage) stage->reach((sweep + 1.0) / sweeps);
  }
}

void SampledVoronoi::settle_homeless(std::vector<Vec3d>& site, const std::vector<Offset>& count,
                                     std::size_t fixed) const {
  std::vector<Index> order(site.size() - fixed);
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<Index>(fixed + i);
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return count[a] > count[b]; });
  const auto homeless = static_cast<std::size_t>(
      std::count_if(order.begin(), order.end(), [&](Index i) { return count[i] == 0; }));
  // Each empty site moves to the sample point farthest from the site of one of the largest cells.
  std::vector<Index> guest(site.size(), -1);
  std::vector<double> farthest(site.size(), -1);
  std::vector<Vec3d> place(site.size());
  for (std::size_t k = 0; k < std::min(homeless, order.size() - homeless); ++k) {
    guest[order[k]] = order[order.size() - 1 - k];
  }
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    for (std::size_t k = 0; k < blocks_[b].offset.size(); ++k) {
      const Index host = owner_[first_[b] + k];
      if (guest[host] < 0) continue;
      const Vec3d d = blocks_[b].position(k) - site[host];
      if (dot(d, d) <= farthest[host]) continue;
      farthest[host] = dot(d, d);
      place[host] = blocks_[b].position(k);
    }
  }
  for (std::size_t host = 0; host < site.size(); ++host) {
    if (guest[host] >= 0 && farthest[host] >= 0) site[guest[host]] = place[host];
  }
}

void SampledVoronoi::snap(std::vector<Vec3d>& site, double spacing,
                          const std::vector<std::uint8_t>& which, std::size_t fixed) {
  assign(site, spacing);
  std::vector<double> nearest2(site.size(), HUGE_VAL);
  std::vector<Vec3d> place = site;
  std::vector<Offset> count(site.size(), 0);
  for (std::size_t b = 0; b < blocks_.size(); ++b) {
    for (std::size_t k = 0; k < blocks_[b].offset.size(); ++k) {
      const Index i = owner_[first_[b] + k];
      ++count[i];
      if (!which[i]) continue;
      const Vec3d d = blocks_[b].position(k) - site[i];
      if (dot(d, d) >= nearest2[i]) continue;
      nearest2[i] = dot(d, d);
      place[i] = blocks_[b].position(k);
    }
  }
  site.swap(place);
  const auto begin = count.begin() + static_cast<std::ptrdiff_t>(fixed);
  if (std::find(begin, count.end(), 0) != count.end()) settle_homeless(site, count, fixed);
}

}  // namespace phyxel
