#include "solver/surface_layer.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mesh/distance_field.hpp"
#include "model/body_contact.hpp"
#include "model/box_overlaps.hpp"
#include "model/parts.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/physics/verlet.hpp"
#include "rank_exchange.hpp"
#include "solver/boundary_conditions.hpp"
#include "tabulated.hpp"
#include "timeline.hpp"

namespace phyxel {
namespace {

/// The sine of the angle by which a body's surface falls away beside a place, as it does from edges
/// and corners. @param normal of the surface there. @param spacing of phyxels [m]
double fall_beside(const PlacedDistances& own, Vec3d place, Vec3d normal, double spacing) {
  const double along_x = dot(normal, own.turn * Vec3d{1, 0, 0});
  const Vec3d axis = own.turn * (std::abs(along_x) < 0.6 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0});
  const Vec3d a = cross(normal, axis) / norm(cross(normal, axis)), b = cross(normal, a);
  const double here = own.gap(place).distance;
  double most = 0;
  constexpr int ways = 8;  // in half a circle
  for (int k = 0; k < ways; ++k) {
    const double angle = k * std::numbers::pi / ways;
    const Vec3d way = spacing * (std::cos(angle) * a + std::sin(angle) * b);
    const double mean =
        0.5 * (own.gap(place + way).distance + own.gap(place - way).distance) - here;
    most = std::max(most, mean / spacing);
  }
  return most;
}

/// Sets the direction inwards of a phyxel and, if it lies on its body's surface, the level and the
/// fall of the surface there, from the distances of places around it.
void look_around(SurfaceSite& site, const PlacedDistances& own) {
  const double spacing = 0.45 * site.range;
  // Along axes that turn with the body, so that copies find the same.
  const auto slope = [&](Vec3d axis) {
    const Vec3d way = spacing * (own.turn * axis);
    return (own.gap(site.rest + way).distance - own.gap(site.rest - way).distance) / (2 * spacing);
  };
  const Vec3d normal = own.turn * Vec3d{slope({1, 0, 0}), slope({0, 1, 0}), slope({0, 0, 1})};
  const double size = norm(normal);
  if (!(size > 0.1)) return;                             // a body so thin that it has no inside
  constexpr double share_of_spacing = 0.5, flat = 0.95;  // at an edge of a box, the size is 0.71
  const Vec3d out = normal / size;
  site.inward = -share_of_spacing * spacing * out;
  if (site.offset > 0) return;
  site.fall = fall_beside(own, site.rest, out, spacing);
  if (size > flat) site.level = own.gap(site.rest).distance;
}

}  // namespace

SurfaceLayer::SurfaceLayer(const Model& model) : model_(model) {
  if (!model.body_contact.acts()) return;
  const std::vector<Vec3d> free = free_axes(model);
  bodies_ =
      tabulated(phyxels().size(), [&](std::size_t k) { return part_of(model, phyxels()[k]).body; });
  sites_ = tabulated(phyxels().size(), [&](std::size_t k) {
    const Index i = phyxels()[k];
    const double range = model.neighbourhood.support[i];
    return SurfaceSite{.rest = model.position[i],
                       .mobility = free.empty() ? Vec3d{1, 1, 1} : free[i],
                       .area = model.volume[i] / range,
                       .offset = model.body_contact.layer.offset[k],
                       .range = range,
                       .wave_speed = pressure_wave_speed(part_of(model, i).material)};
  });
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < sites_.size(); ++k) {
    look_around(sites_[k], model.body_contact.distances[bodies_[k]].view());
  }
  ranges_.assign(model.body_contact.distances.size(), HUGE_VAL);
  const auto keep_smaller = [](double& kept, double other) { kept = std::min(kept, other); };
  for (std::size_t k = 0; k < sites_.size(); ++k)
    keep_smaller(ranges_[bodies_[k]], sites_[k].range);
  if (model.share) {
    const Communicator& ranks = *model.share->communicator;
    for (const std::vector<double>& some : allgathered(ranks, ranges_)) {
      for (std::size_t b = 0; b < ranges_.size(); ++b) keep_smaller(ranges_[b], some[b]);
    }
  }
  least_range_ = HUGE_VAL;
  for (const double range : ranges_) keep_smaller(least_range_, range);
  groups_ = groups_of(model, model.body_contact.layer);
  for (const LayerGroup& group : groups_) body_of_group_.push_back(bodies_[group.begin]);
}

std::vector<double> SurfaceLayer::gains(double dt) const {
  std::vector<double> gains;
  for (const Index i : phyxels()) {
    gains.push_back(damped_flow(part_of(model_, i).material.damping, dt).gain / model_.mass[i]);
  }
  return gains;
}

std::vector<double> SurfaceLayer::regains(double dt) const {
  std::vector<double> regains;
  for (const Index i : phyxels()) {
    regains.push_back(1 / damped_flow(part_of(model_, i).material.damping, dt).keep);
  }
  return regains;
}

std::vector<double> SurfaceLayer::wave_moduli() const {
  std::vector<double> moduli;
  for (const Index i : phyxels()) {
    moduli.push_back(wave_stiffness_at_rest(part_of(model_, i).material));
  }
  return moduli;
}

Box SurfaceLayer::box_of(const LayerGroup& group, std::span<const Vec3d> position) const {
  Box box = no_box;
  for (std::size_t k = group.begin; k < group.end; ++k) {
    box = together(box, grown({position[k], position[k]}, sites_[k].range));
  }
  return box;
}

BodyReach SurfaceLayer::reach_at(std::span<const Vec3d> position, std::span<const double> skins,
                                 NearBoxes& near) const {
  return reach_of(
      tabulated(groups_.size(), [&](std::size_t g) { return box_of(groups_[g], position); }), skins,
      near);
}

BodyReach SurfaceLayer::reach_of(std::span<const Box> boxes, std::span<const double> skins,
                                 NearBoxes& near) const {
  const Phase phase("bodies near each other");
  BodyReach reach{.boxes = std::vector(model_.body_contact.distances.size(), no_box),
                  .partners = {}};
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    Box& box = reach.boxes[body_of_group_[g]];
    box = together(box, boxes[g]);
  }
  if (model_.share) {
    const Communicator& ranks = *model_.share->communicator;
    const std::vector<std::vector<Box>> all = allgathered(ranks, reach.boxes);
    for (const std::vector<Box>& some : all) {
      for (std::size_t b = 0; b < some.size(); ++b) {
        reach.boxes[b] = together(reach.boxes[b], some[b]);
      }
    }
  }
  std::vector<Box> with_skin;
  with_skin.reserve(reach.boxes.size());
  for (std::size_t b = 0; b < skins.size(); ++b) {
    with_skin.push_back(grown(reach.boxes[b], 0.5 * skins[b]));
  }
  reach.partners = partners_of_bodies(model_.body_contact, with_skin, near);
  return reach;
}

}  // namespace phyxel
