#include "mesh/lattice_filling.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>

#include "mesh/filling_device.hpp"
#include "mesh/nearest_site.hpp"
#include "mesh/repulsion.hpp"
#include "mesh/rooms.hpp"
#include "mesh/small_volumes.hpp"
#include "mesh/surface_points.hpp"
#include "mesh/surface_sites.hpp"
#include "stage.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

// Distances below are in lattice constants, and were chosen by the accuracy of the clouds.

/// Clearance of the nodes nearest to the surface beyond which a coarser lattice is tried.
constexpr double most_clearance = 0.8;
/// Sample points for a volume along a lattice constant. Errors of bodies of 2,000 to 40,000 phyxels
/// are the same with 4; in small bodies, 6 take no time.
double samples_along(Index phyxels) { return phyxels > 100'000 ? 4 : 6; }

/// The device that tells which places are inside; null where the host does so sooner.
const SurfaceOnDevice* inside_device(const LatticeRequest& request) {
  return request.sampler.winding_work() <= most_winding_work ? request.device : nullptr;
}

/// Sample points on the surface and on cuts, from which nodes keep a distance [m].
std::vector<Vec3d> marks_on_surface(const LatticeRequest& request, double spacing) {
  std::vector<Vec3d> points;
  for (const PointOn& p :
       points_over(request.surface, SpacingField(spacing), surface_samples, request.seed + 1)) {
    points.push_back(p.point);
  }
  const std::vector<Vec3d>& on_cuts = request.sites.cut_points;
  points.insert(points.end(), on_cuts.begin(), on_cuts.end());
  return points;
}

/// The sweep over the nodes of a lattice.
SampleSweep lattice_sweep(const LatticeRequest& request, double spacing) {
  return {.voxel = spacing, .seed = request.seed, .at_random = false, .turn = turn_of_lattice()};
}

/// All nodes of the lattice inside, task by task.
LatticeNodes nodes_on_host(const LatticeRequest& request, const SurfaceMarks& marks) {
  const double spacing = marks.spacing;
  const SpatialHash deep_site(marks.sites, depth_cell * spacing),
      site(marks.sites, site_cell * spacing), sample(marks.samples, sample_cell * spacing);
  std::vector<LatticeNodes> by_task(InsideSampler::most_tasks);
  request.sampler.visit(
      lattice_sweep(request, spacing), [&](std::size_t task, const SampleBlock& block) {
        LatticeNodes& nodes = by_task[task];
        const bool deep = is_deep(deep_site, block.centre, radius_of_nodes(spacing),
                                  largest_clearance * spacing, marks.farthest);
        for (std::size_t k = 0; k < block.offset.size(); ++k) {
          const Vec3d p = block.position(k);
          nodes.position.push_back(p);
          nodes.clearance.push_back(static_cast<float>(
              deep ? largest_clearance : clearance_at(site, sample, p, spacing)));
        }
      });
  std::vector<std::size_t> first{0};  // of each task
  for (const LatticeNodes& nodes : by_task) first.push_back(first.back() + nodes.position.size());
  LatticeNodes all{Bulk<Vec3d>(first.back()), Bulk<float>(first.back())};
#pragma omp parallel for schedule(dynamic)
  for (std::size_t task = 0; task < by_task.size(); ++task) {
    LatticeNodes& nodes = by_task[task];
    const auto to = static_cast<std::ptrdiff_t>(first[task]);
    std::ranges::copy(nodes.position, all.position.begin() + to);
    std::ranges::copy(nodes.clearance, all.clearance.begin() + to);
    nodes = {};
  }
  return all;
}

/// All nodes of the lattice inside.
LatticeNodes nodes_inside(const LatticeRequest& request, double spacing) {
  const std::vector<Vec3d> sites = all_sites(request.sites),
                           samples = marks_on_surface(request, spacing);
  const SurfaceMarks marks{sites, samples, spacing, request.sites.spacing.coarsest()};
  if (const SurfaceOnDevice* const device = inside_device(request)) {
    const auto regions = request.sampler.regions(lattice_sweep(request, spacing));
    if (std::optional<LatticeNodes> nodes = device->nodes(regions, marks)) {
      return std::move(*nodes);
    }
  }
  return nodes_on_host(request, marks);
}

/// The elements of an array that are to be kept.
template <class T>
Bulk<T> kept_of(const Bulk<T>& values, const std::vector<Index>& kept) {
  return in_bulk(kept.size(), [&](std::size_t k) { return values[kept[k]]; });
}

/// Keeps the n nodes of largest clearance, in their order; of equal ones the first.
/// @returns the smallest clearance kept
float keep_farthest(LatticeNodes& nodes, std::size_t n) {
  // Most nodes are so deep inside that all of them have the same clearance.
  const Bulk<float>& clearance = nodes.clearance;
  const auto all = static_cast<Index>(clearance.size());
  const auto is_near = [&](Index i) { return clearance[i] < largest_clearance; };
  Bulk<float> near = kept_of(clearance, chosen(0, all, is_near));
  const std::size_t deep = clearance.size() - near.size();
  float least = largest_clearance;
  if (n > deep) {
    const auto nth = near.begin() + static_cast<std::ptrdiff_t>(n - deep) - 1;
    std::nth_element(near.begin(), nth, near.end(), std::greater<>());
    least = *nth;
  }
  const auto is_above = [&](float found) { return found > least; };
  const auto above = static_cast<std::size_t>(std::ranges::count_if(near, is_above)) +
                     (least < largest_clearance ? deep : 0);
  std::vector<Index> ties = chosen(0, all, [&](Index i) { return clearance[i] == least; });
  const Index end = ties.size() > n - above ? ties[n - above] : all;  // of the ties that stay
  const std::vector<Index> kept = chosen(
      0, all, [&](Index i) { return clearance[i] > least || (clearance[i] == least && i < end); });
  nodes = {kept_of(nodes.position, kept), kept_of(nodes.clearance, kept)};
  return least;
}

/// The lattice constant a that solves n a³ = V - a A/2: a layer half as thick as the lattice
/// constant belongs to the phyxels on the surface. The area of cuts, which have two sides, counts
/// twice.
double lattice_constant(double volume, double area, Index n) {
  double low = 0, high = std::cbrt(volume / n);
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (low + high);
    (volume - 0.5 * middle * area > n * middle * middle * middle ? low : high) = middle;
  }
  return high;
}

/// The phyxels on the surface and on cuts, and the nodes near them.
class Skin {
 public:
  Skin(const LatticeRequest& request, LatticeNodes& nodes, double spacing)
      : request_(request),
        nodes_(nodes),
        spacing_(spacing),
        device_(request.device),
        near_(chosen(0, static_cast<Index>(nodes.position.size()),
                     [&](Index i) { return nodes.clearance[i] < largest_clearance; })),
        point_(all_sites(request.sites)) {
    point_.resize(sites() + near_.size());
#pragma omp parallel for schedule(static)
    for (std::size_t k = 0; k < near_.size(); ++k) point_[sites() + k] = nodes.position[near_[k]];
  }

  /// Moves the nodes near the surface by sweeps of repulsion.
  void even_out(Stage& stage) {
    if (device_ && is_evened_out_by_device()) return;
    ball_.resize(near_.size());
    for (int done = 0; done < request_.sweeps; ++done) {
      sweep();
      stage.reach((done + 1.0) / request_.sweeps);
    }
    release(ball_);
  }

  void write_back() {
#pragma omp parallel for schedule(static)
    for (std::size_t k = 0; k < near_.size(); ++k) nodes_.position[near_[k]] = point_[sites() + k];
  }

  /// The distance from each phyxel on the surface, on cuts, then of all nodes to the nearest other
  /// one [m]. Of those deep inside it is the lattice constant.
  std::vector<double> gaps() const {
    // Those that are nearest to a node of less clearance are among the points.
    constexpr double known_clearance = largest_clearance - 1;
    const std::vector<char> wanted = tabulated(point_.size(), [&](std::size_t k) {
      return static_cast<char>(k < sites() || clearance_of(k - sites()) < known_clearance);
    });
    std::optional<std::vector<double>> found;
    if (device_) found = device_->gaps(point_, spacing_, wanted);
    if (!found) {
      const SpatialHash hash(point_, spacing_);
      found = tabulated(point_.size(), [&](std::size_t k) {
        if (!wanted[k]) return 0.0;
        return std::sqrt(hash.nearest(point_[k], HUGE_VAL, static_cast<Index>(k)).distance2);
      });
    }
    std::vector<double> gap(sites() + nodes_.position.size(), spacing_);
#pragma omp parallel for schedule(static)
    for (std::size_t k = 0; k < point_.size(); ++k) {
      if (wanted[k]) gap[place_of(k)] = (*found)[k];
    }
    return gap;
  }

  /// Volumes of the phyxels on the surface, on cuts, then of all nodes [m^3].
  std::vector<double> volumes(Stage& stage) const {
    const double cell = std::pow(spacing_, 3);
    std::vector<double> sampled = sampled_volumes(stage);
    // Regular points have the volumes of lattice cells.
    const auto is_irregular = [&](std::size_t k) {
      return k < sites() || clearance_of(k - sites()) < regular_clearance;
    };
    raise_small_volumes(point_, request_.sites.cuts, request_.sites.spacing, sampled, is_irregular);
    std::vector<double> volume(sites() + nodes_.position.size(), cell);
    std::vector<std::size_t> irregular;
    double sum = 0;
    for (std::size_t k = 0; k < point_.size(); ++k) {
      if (!is_irregular(k)) continue;
      irregular.push_back(place_of(k));
      volume[irregular.back()] = sampled[k];
      sum += sampled[k];
    }
    if (!request_.exact_volume) return volume;
    const double rest = static_cast<double>(volume.size() - irregular.size()) * cell;
    for (const std::size_t i : irregular) volume[i] *= (request_.volume - rest) / sum;
    return volume;
  }

 private:
  /// Moves each node by the sum of the forces at the places before the sweep.
  void sweep() {
    const Repulsion repulsion(point_, spacing_);
    Bulk<Vec3d> moved(near_.size());
    const auto n = static_cast<std::ptrdiff_t>(near_.size());
#pragma omp parallel
    {
#pragma omp for schedule(dynamic, 256)
      for (std::ptrdiff_t k = 0; k < n; ++k) {
        const Vec3d before = point_[sites() + k];
        const auto step_of = [&](auto&& strength) {
          return repulsion.step(before, static_cast<Index>(sites() + k), strength);
        };
        moved[k] = moves(k) ? repelled_inside(request_, before, ball_[k], step_of) : before;
      }
#pragma omp for schedule(static)
      for (std::ptrdiff_t k = 0; k < n; ++k) point_[sites() + k] = moved[k];
    }
  }

  std::size_t on_surface() const { return request_.sites.position.size(); }
  /// Phyxels on the surface and on cuts.
  std::size_t sites() const { return on_surface() + request_.sites.on_cuts.size(); }
  /// The clearance that the k-th node of the skin had in the lattice.
  float clearance_of(std::size_t k) const { return nodes_.clearance[near_[k]]; }
  /// True if the k-th node of the skin moves.
  bool moves(std::size_t k) const { return clearance_of(k) < moving_clearance; }
  /// The number of a point of the skin among the sites and all nodes.
  std::size_t place_of(std::size_t k) const {
    return k < sites() ? k : sites() + static_cast<std::size_t>(near_[k - sites()]);
  }

  /// Shares of the inside by sample points [m^3]. Cells end at cuts: a phyxel on a cut has none of
  /// the space in its region, unless no other phyxel is there.
  std::vector<double> sampled_volumes(Stage& stage) const {
    const Rooms rooms(request_.sites.cuts, point_);
    const SpatialHash all(all_sites(request_.sites), depth_cell * spacing_);
    std::vector<double> volume(point_.size());
    for (std::size_t room = 0; room < rooms.size(); ++room) {
      const std::vector<std::size_t>& here = rooms.points_in(room);
      if (here.empty()) continue;
      std::vector<Vec3d> site;
      for (const std::size_t k : here) site.push_back(point_[k]);
      const auto wanted = [&](Vec3d middle, double half) {
        const double radius = std::numbers::sqrt3 * half;
        if (!rooms.may_reach(room, middle, radius)) return false;
        // Smaller cells are parts of one that is wanted; larger ones would need a long search.
        if (half < 0.5 * spacing_ || half > 4 * spacing_) return true;
        // Cells of a Voronoi diagram reach one spacing from their phyxels.
        return !is_deep(all, middle, radius, (regular_clearance + 1) * spacing_,
                        request_.sites.spacing.coarsest());
      };
      std::function<bool(Vec3d)> counts;
      if (rooms.size() > 1) counts = [&](Vec3d p) { return rooms.room_of(p) == room; };
      const SampleSweep sweep{.voxel = spacing_ / samples_along(request_.phyxels),
                              .seed = request_.seed + 2,
                              .wanted = wanted};
      std::vector<double> shares;
      if (!counts) shares = volumes_by_device(sweep, site);
      if (shares.empty()) {
        shares = NearestSite(site, spacing_).volumes(request_.sampler, sweep, stage, counts);
      }
      for (std::size_t k = 0; k < site.size(); ++k) volume[here[k]] = shares[k];
    }
    return volume;
  }

  bool is_evened_out_by_device() {
    const std::vector<char> moving =
        tabulated(near_.size(), [&](std::size_t k) { return static_cast<char>(moves(k)); });
    return device_->repel(point_, {.moves = moving,
                                   .fixed = sites(),
                                   .on_surface = static_cast<Index>(on_surface()),
                                   .spacing = spacing_,
                                   .clear = request_.sites.spacing.coarsest(),
                                   .sweeps = request_.sweeps});
  }
  /// The volumes [m^3] that sample points give to sites; none if the device has none.
  std::vector<double> volumes_by_device(const SampleSweep& sweep,
                                        std::span<const Vec3d> site) const {
    const SurfaceOnDevice* const device = inside_device(request_);
    if (!device) return {};
    const auto count = device->samples_of_sites(request_.sampler.regions(sweep), site, spacing_);
    return count ? volumes_of_samples(*count, sweep.voxel) : std::vector<double>{};
  }

  const LatticeRequest& request_;
  LatticeNodes& nodes_;
  double spacing_;
  const SurfaceOnDevice* device_;
  std::vector<Index> near_;      ///< Nodes whose clearance is known.
  std::vector<Vec3d> point_;     ///< Phyxels on surface and cuts, then the nodes of `near_` [m].
  std::vector<ClearBall> ball_;  ///< Ball of each node of `near_` (`repelled_inside`).
};

}  // namespace

std::vector<Vec3d> all_sites(const SurfaceSites& sites) {
  std::vector<Vec3d> all = sites.position;
  all.insert(all.end(), sites.on_cuts.begin(), sites.on_cuts.end());
  return all;
}

Mat3d turn_of_lattice() {
  constexpr double w = 30, x = 8, y = 6, z = -9, all = w * w + x * x + y * y + z * z;
  Mat3d turn;
  const double rows[3][3] = {
      {w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
      {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
      {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}};
  for (int e = 0; e < 9; ++e) turn(e / 3, e % 3) = rows[e / 3][e % 3] / all;
  return turn;
}

LatticeFilling fill_by_lattice(const LatticeRequest& request) {
  Stage placing("placing phyxels");
  const auto n = static_cast<std::size_t>(request.phyxels);
  double spacing = lattice_constant(
      request.volume, request.sampler.area() + 2 * request.sites.cut_area, request.phyxels);
  LatticeNodes nodes;
  constexpr int most_coarser = 12, most_attempts = 40;
  for (int attempt = 0;; ++attempt) {
    nodes = nodes_inside(request, spacing);
    const auto roomy = std::count_if(nodes.clearance.begin(), nodes.clearance.end(),
                                     [](float found) { return found >= usual_clearance; });
    if (nodes.position.size() >= n) {
      const float least = keep_farthest(nodes, n);
      // Thin parts hold fewer nodes than their volume would, and thick parts then have room for all
      // with a coarser lattice; or there is no room for nodes that keep off the surface.
      if (least > most_clearance && attempt < most_coarser) {
        const double ratio = static_cast<double>(roomy) / static_cast<double>(n);
        spacing *= std::clamp(std::cbrt(ratio), 1.005, 2.0);
        continue;
      }
      if (least >= least_clearance || attempt >= most_attempts) break;
    }
    spacing *= 0.98;
  }
  placing.finish();

  Stage relaxing("evening out distances");
  Skin skin(request, nodes, spacing);
  skin.even_out(relaxing);
  skin.write_back();
  relaxing.finish();

  LatticeFilling filling;
  filling.spacing = spacing;
  Stage measuring("volumes of phyxels");
  filling.volume = skin.volumes(measuring);
  measuring.finish();
  filling.gap = skin.gaps();
  filling.position = std::move(nodes.position);
  return filling;
}

}  // namespace phyxel
