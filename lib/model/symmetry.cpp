#include "model/symmetry.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "model/loads.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

constexpr double on_plane = 0.01;    // largest distance of phyxels on a plane, in spacings
constexpr double near_plane = 0.75;  // that of the outermost layer of a body without them

/// Share of the phyxels near a plane from which on those on it are a layer, and lie there by no
/// chance.
constexpr double layer_share = 0.3;

double along(PlaneNormal normal, Vec3d place) { return component(place, static_cast<int>(normal)); }
char letter_of(PlaneNormal normal) { return "xyz"[static_cast<int>(normal)]; }

/// Returns the edge of the cubes that fill a box which reaches half an edge beyond points, one cube
/// to a point: the spacing of a lattice [m].
double cell_around(const Box& box, double size) {
  const Vec3d d = box.high - box.low;
  double cell = box.extent();
  for (int k = 0; k < 60; ++k) {
    cell = std::cbrt((d.x + cell) * (d.y + cell) * (d.z + cell) / size);
  }
  return cell;
}

/// Checks that a body ends at a plane. @throws InputError if it does not
void check_end(const BodyRequest& request, const SymmetryRequest& plane, const BodyExtent& extent) {
  const double low = along(plane.normal, extent.box.low),
               high = along(plane.normal, extent.box.high);
  const double below = plane.at - low, above = high - plane.at;
  const double past = on_plane * extent.spacing,
               short_of = extent.has_surface ? past : near_plane * extent.spacing;
  const double beyond = std::min(below, above);
  if (beyond <= past && beyond >= -short_of) return;
  const char axis = letter_of(plane.normal);
  const std::string found =
      beyond > 0 ? fmt::format("cuts the body, which extends {:g} m to {}- and {:g} m to {}+ of it",
                               below, axis, above, axis)
                 : fmt::format("is {:g} m away from the body", -beyond);
  throw InputError(fmt::format(
      "{}: key body.symmetry.at: the plane {} = {:g} m {}; allowed: an end of body \"{}\", {} = "
      "{:g} or {:g} m, to within {:g} m",
      plane.where.empty() ? request.where : plane.where, axis, plane.at, found, request.name, axis,
      low, high, past));
}

}  // namespace

BodyExtent extent_of(const Box& phyxels, const Surface& surface, Index size) {
  BodyExtent extent{phyxels, cell_around(phyxels, static_cast<double>(size)),
                    !surface.position.empty()};
  if (!extent.has_surface) return extent;
  extent.box = box_around(surface.position);
  const double volume = surface.triangle.empty() ? 0 : enclosed_volume(surface);
  if (volume > 0) extent.spacing = std::cbrt(volume / static_cast<double>(size));
  return extent;
}

double local_spacing(const NeighbourhoodRule& rule, double support) {
  // The mean distance to the ten nearest is that many spacings, inside a body and out.
  constexpr double distance_to_ten = 1.15;
  return support / (rule.factor * distance_to_ten);
}

std::vector<PlaneCounts> count_at_planes(const BodyRequest& request,
                                         std::span<const double> spacing,
                                         std::span<const Vec3d> position) {
  std::vector<PlaneCounts> counts;
  for (const SymmetryRequest& plane : request.symmetries) {
    PlaneCounts& count = counts.emplace_back();
    for (std::size_t i = 0; i < position.size(); ++i) {
      const double distance = std::abs(along(plane.normal, position[i]) - plane.at);
      const double s = spacing[spacing.size() == 1 ? 0 : i];
      count.on += distance <= on_plane * s;
      count.near += distance <= near_plane * s;
    }
  }
  return counts;
}

bool SymmetryPlane::holds(Vec3d place) const {
  return std::abs(along(normal, place) - at) <= reach;
}

Axes SymmetryPlane::axes() const {
  return {normal == PlaneNormal::x, normal == PlaneNormal::y, normal == PlaneNormal::z};
}

std::vector<SymmetryPlane> symmetry_planes(const BodyRequest& request, const BodyExtent& extent,
                                           std::span<const PlaneCounts> counts,
                                           std::vector<std::string>& warnings) {
  std::vector<SymmetryPlane> planes;
  for (std::size_t k = 0; k < request.symmetries.size(); ++k) {
    const SymmetryRequest& asked = request.symmetries[k];
    check_end(request, asked, extent);
    const auto near = static_cast<double>(counts[k].near);
    const bool is_layer =
        counts[k].on > 0 && static_cast<double>(counts[k].on) >= layer_share * near;
    planes.push_back({asked.normal, asked.at, (is_layer ? on_plane : near_plane) * extent.spacing});
    if (is_layer) continue;
    if (counts[k].near == 0) {
      throw InputError(fmt::format(
          "{}: key body.symmetry.at: no phyxel of body \"{}\" lies within {:g} m of the plane {} = "
          "{:g} m; allowed: a plane with phyxels on it, or within 0.75 spacings of it",
          asked.where.empty() ? request.where : asked.where, request.name,
          near_plane * extent.spacing, letter_of(asked.normal), asked.at));
    }
    warnings.push_back(fmt::format(
        "body \"{}\", {}: no layer of phyxels lies on the plane {} = {:g} m; the {} within {:g} m "
        "of it are held instead, at a distance from the plane. Phyxels on the surface (lattice = "
        "\"nodes\", on_surface = true) lie on it",
        request.name, entry_name("symmetry", k), letter_of(asked.normal), asked.at, counts[k].near,
        near_plane * extent.spacing));
  }
  return planes;
}

}  // namespace phyxel
