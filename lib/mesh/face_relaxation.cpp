#include "mesh/face_relaxation.hpp"

#include <algorithm>
#include <optional>

#include "mesh/filling_device.hpp"
#include "mesh/filling_rules.hpp"
#include "mesh/inside_samples.hpp"
#include "mesh/repulsion.hpp"
#include "mesh/triangle.hpp"
#include "model/graded_hash.hpp"
#include "model/space_filling_curve.hpp"
#include "model/spatial_hash.hpp"
#include "stage.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Orders all points but the first `fixed` along a curve, so that those near each other are worked
/// on one after the other.
void order_along_curve(std::vector<Vec3d>& site, std::size_t fixed) {
  const std::span<const Vec3d> points = std::span(site).subspan(fixed);
  const std::vector<Index> order = curve_order(points, 0, static_cast<Index>(points.size()));
  const std::vector<Vec3d> sorted =
      tabulated(order.size(), [&](std::size_t k) { return points[order[k]]; });
  std::copy(sorted.begin(), sorted.end(), site.begin() + static_cast<std::ptrdiff_t>(fixed));
}

/// Sweeps of repulsion over all points but the first `fixed`.
/// @param move move(i, place, step) returns the place of point i after a step [m]
/// @param done done(sweeps) is told the number of sweeps done
template <class Move, class Done>
void sweep_over(std::vector<Vec3d>& site, std::size_t fixed, const SpacingField& spacing,
                int sweeps, Move&& move, Done&& done) {
  std::vector<Vec3d> moved = site;
  const auto n = static_cast<std::ptrdiff_t>(site.size());
  const auto same = [](Index) { return 1.0; };
  std::optional<GradedRepulsion> graded;
  if (!spacing.is_uniform()) graded.emplace(site, fixed, spacing);
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    if (graded) {
      graded->for_each(
          [&](std::size_t i, auto&& step_of) { moved[i] = move(i, site[i], step_of(same)); });
      graded->move_to(moved);
    } else {
      const Repulsion repulsion(site, spacing.coarsest());
#pragma omp parallel for schedule(dynamic, 256)
      for (std::ptrdiff_t i = static_cast<std::ptrdiff_t>(fixed); i < n; ++i) {
        const Vec3d step = repulsion.step(site[i], static_cast<Index>(i), same);
        moved[i] = move(static_cast<std::size_t>(i), site[i], step);
      }
    }
    site.swap(moved);
    done(sweep + 1);
  }
}

/// The pieces that sample points lie on, by the nearest of the points.
class NearestPiece {
 public:
  NearestPiece(std::span<const PointOn> sample, const SpacingField& spacing) : sample_(sample) {
    const auto place = in_bulk(sample.size(), [&](std::size_t k) { return sample[k].point; });
    if (spacing.is_uniform()) {
      uniform_.emplace(place, face_sample_cell * spacing.coarsest());
    } else {
      std::vector<double> size = spacing.at(place);
      for (double& s : size) s *= face_sample_cell;
      graded_.emplace(place, size);
    }
  }
  std::size_t at(Vec3d p) const {
    if (uniform_) return sample_[uniform_->nearest(p).index].piece;
    return sample_[graded_->nearest(p).index].piece;
  }

 private:
  std::span<const PointOn> sample_;
  std::optional<SpatialHash> uniform_;
  std::optional<GradedHash> graded_;
};

}  // namespace

void relax_on_faces(const Surface& surface, std::span<const PointOn> sample,
                    std::vector<Vec3d>& site, std::size_t fixed, const SpacingField& spacing,
                    const CutMargin& margin, int sweeps, Stage& stage,
                    const SurfaceOnDevice* device) {
  order_along_curve(site, fixed);
  if (device && margin.is_empty() && spacing.is_uniform() &&
      device->even_out(site, {surface, sample, fixed, spacing.coarsest(), sweeps})) {
    return;
  }
  const NearestPiece nearest(sample, spacing);
  // The triangle on which each point lies.
  auto piece = in_bulk(site.size(), [&](std::size_t i) { return nearest.at(site[i]); });
  const auto corners_of = [&](std::size_t triangle) {
    const Triangle& t = surface.triangle[triangle];
    return Corners{surface.position[t[0]], surface.position[t[1]], surface.position[t[2]]};
  };
  const auto nearest_piece = [&](Vec3d place) { return nearest.at(place); };
  const auto move = [&](std::size_t i, Vec3d before, Vec3d step) {
    std::size_t triangle = piece[i];
    const Vec3d on_face = moved_on_face(before, step, triangle, corners_of, nearest_piece);
    if (margin.contains(on_face)) return before;
    piece[i] = triangle;
    return on_face;
  };
  sweep_over(site, fixed, spacing, sweeps, move,
             [&](int done) { stage.reach(static_cast<double>(done) / sweeps); });
}

void relax_on_cut(const SpaceRegion& region, const InsideSampler& sampler, std::vector<Vec3d>& site,
                  std::size_t fixed, const SpacingField& spacing, int sweeps) {
  const auto move = [&](std::size_t, Vec3d before, Vec3d step) {
    const Vec3d after = region.nearest_on_boundary(before + step);
    return sampler.inside(after) ? after : before;
  };
  sweep_over(site, fixed, spacing, sweeps, move, [](int) {});
}

void relax_on_edges(std::span<const Crease> piece, std::span<const PointOn> sample,
                    std::vector<Vec3d>& site, std::size_t fixed, const SpacingField& spacing,
                    const CutMargin& margin, int sweeps) {
  const NearestPiece nearest(sample, spacing);
  const auto move = [&](std::size_t, Vec3d before, Vec3d step) {
    const auto on_piece = [&](Vec3d p) {
      const auto& [from, to] = piece[nearest.at(p)];
      const Vec3d along = to - from;
      const double size2 = dot(along, along);
      return size2 > 0 ? from + std::clamp(dot(p - from, along) / size2, 0.0, 1.0) * along : from;
    };
    const Vec3d after = on_piece(before + step);
    return margin.contains(after) ? before : after;
  };
  sweep_over(site, fixed, spacing, sweeps, move, [](int) {});
}

}  // namespace phyxel
