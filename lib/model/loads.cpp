#include "model/loads.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "model/box.hpp"
#include "model/neighbour_search.hpp"
#include "model/selection.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/physics/moment.hpp"
#include "rank_sums.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Largest shift of a load's centroid along a principal axis, in standard deviations of the
/// phyxels' positions along it: weights then stay above -2 times the mean.
constexpr double largest_shift = 0.7;

/// The gradient g [1/m] of weights m (1 + g x) whose centroid is at `shift`.
/// @param covariance of the phyxels' positions, x from their centroid [m²]
Vec3d weight_gradient(const Eigen::Matrix3d& covariance, Vec3d shift) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(covariance);
  const Eigen::Vector3d wanted(shift.x, shift.y, shift.z);
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const double variance = axes.eigenvalues()[k];
    if (!(variance > 1e-12 * axes.eigenvalues()[2])) continue;  // all in one plane
    const double most = largest_shift * std::sqrt(variance);
    const double along = std::clamp(axes.eigenvectors().col(k).dot(wanted), -most, most);
    gradient += (along / variance) * axes.eigenvectors().col(k);
  }
  return {gradient[0], gradient[1], gradient[2]};
}

/// Adds the pieces of a triangle that lie in a region, halved until no side is longer than
/// `longest`, and at the boundary than a sixteenth of that.
/// @param tolerance distance beyond the boundary at which a piece still counts [m]
void add_facets_in(const SpaceRegion& region, const std::array<Vec3d, 3>& corner, double longest,
                   double tolerance, std::vector<Facet>& facets) {
  const Vec3d centroid = (corner[0] + corner[1] + corner[2]) / 3.0;
  const double distance = region.distance(centroid);
  double reach = 0;
  bool is_inside = true;  // regions are convex
  for (const Vec3d c : corner) {
    reach = std::max(reach, norm(c - centroid));
    is_inside = is_inside && region.distance(c) <= tolerance;
  }
  if (distance >= reach + tolerance) return;
  std::array<double, 3> side;
  for (int k = 0; k < 3; ++k) side[k] = norm(corner[(k + 1) % 3] - corner[k]);
  const auto at = std::max_element(side.begin(), side.end()) - side.begin();
  if (side[at] <= (is_inside ? longest : longest / 16)) {
    const Vec3d area = 0.5 * cross(corner[1] - corner[0], corner[2] - corner[0]);
    if (distance <= tolerance && norm(area) > 0) facets.push_back({centroid, area});
    return;
  }
  const Vec3d a = corner[at], b = corner[(at + 1) % 3], c = corner[(at + 2) % 3];
  const Vec3d middle = 0.5 * (a + b);
  add_facets_in(region, {a, middle, c}, longest, tolerance, facets);
  add_facets_in(region, {middle, b, c}, longest, tolerance, facets);
}

/// A vector's direction, whatever its length is.
Vec3d direction_of(Vec3d v) {
  const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  return largest > 0 ? normalised(v / largest) : Vec3d{};
}

}  // namespace

std::string entry_name(const char* kind, std::size_t number) {
  return fmt::format("{} {}", kind, number + 1);
}

void LoadSums::add(double m, Vec3d x) {
  mass.add(m);
  moment.add(m * x);
  const double terms[6] = {x.x * x.x, x.x * x.y, x.x * x.z, x.y * x.y, x.y * x.z, x.z * x.z};
  for (int k = 0; k < 6; ++k) second[k].add(m * terms[k]);
}

Sym3d LoadSums::second_moment() const {
  return {second[0].value(), second[1].value(), second[2].value(),
          second[3].value(), second[4].value(), second[5].value()};
}

std::vector<ExactSum*> LoadSums::all() {
  std::vector<ExactSum*> sums{&mass, &moment.x, &moment.y, &moment.z};
  for (ExactSum& sum : second) sums.push_back(&sum);
  return sums;
}

ForceBalance ForceBalance::adding(const LoadSums& sizes, Vec3d force, Vec3d torque) {
  const double size = sizes.mass.value();
  if (!(size > 0)) return {};
  const Vec3d mean = sizes.moment.value() / size;
  const Sym3d second = sizes.second_moment() + moment_term(mean, -size);
  const double t = trace(second);
  const Sym3d inertia = Sym3d{t, 0, 0, t, 0, t} + -1.0 * second;
  return {force / size, pseudo_inverse(inertia).matrix * (torque - cross(mean, force)), mean};
}

std::vector<std::optional<BodyPiece>> loaded_pieces(const BodyRequest& request,
                                                    const Surface& surface) {
  std::vector<std::optional<BodyPiece>> pieces(request.loads.size());
  const bool needs_none =
      std::none_of(request.loads.begin(), request.loads.end(),
                   [](const LoadRequest& load) { return region_of(load.select).has_value(); });
  if (needs_none || !request.inclusions.empty() || !encloses_volume(surface)) return pieces;
  for (std::size_t l = 0; l < pieces.size(); ++l) {
    const auto region = region_of(request.loads[l].select);
    if (!region) continue;
    const BodyPiece piece = piece_in(surface, *region);
    // The volume of a flat box is a rounding error.
    const double least = 1e-12 * std::pow(box_around(surface.position).extent(), 3);
    if (piece.volume > least) {
      pieces[l] = piece;
    } else if (request.loads[l].force_density != Vec3d{}) {
      throw InputError(fmt::format(
          "{}: this {} holds no part of the inside of body \"{}\", on which "
          "body.load.force_density acts; allowed: one that does, or body.load.force",
          request.loads[l].select.where.empty() ? request.where : request.loads[l].select.where,
          region->is_ball ? "ball" : "box", request.name));
    }
  }
  return pieces;
}

Load load_of(const BodyRequest& request, std::size_t number, std::vector<Index> phyxels,
             const Model& model, LoadSums sums, Vec3d origin,
             const std::optional<BodyPiece>& piece) {
  const LoadRequest& asked = request.loads[number];
  Load load{.phyxels = std::move(phyxels),
            .total = asked.force,
            .density = asked.force_density,
            .curve = LoadCurve::of(asked.ramp, asked.curve),
            .body = request.name,
            .set = entry_name("load", number)};
  const double mass = sums.mass.value();
  const Vec3d mean = sums.moment.value() / mass;
  load.centroid = origin + mean;
  Vec3d gradient;
  if (piece) {
    Eigen::Matrix3d covariance;
    const Mat3d second = full(sums.second_moment());
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        covariance(row, column) =
            second(row, column) / mass - component(mean, row) * component(mean, column);
      }
    }
    gradient = weight_gradient(covariance, piece->centroid - load.centroid);
    const Eigen::Vector3d shift = covariance * Eigen::Vector3d(gradient.x, gradient.y, gradient.z);
    load.total += piece->volume * asked.force_density;
    load.density = {};
    load.centroid += Vec3d{shift[0], shift[1], shift[2]};
  }
  for (const Index i : load.phyxels) {
    const double weight =
        model.mass[i] / mass * (1 + dot(gradient, model.position[i] - origin - mean));
    load.force.push_back(weight * load.total + model.volume[i] * load.density);
  }
  return load;
}

namespace {

/// The triangles on which a traction may act: those of its group, or all.
std::vector<Triangle> chosen_triangles(const BodyRequest& request, const TractionRequest& traction,
                                       const BodySurface& surface) {
  if (traction.select.indices || !traction.select.mesh.empty()) {
    throw InputError(fmt::format(
        "{}: a traction of body \"{}\" acts on phyxels; allowed: a group, a box, a ball or all, "
        "which select a part of the surface",
        traction.select.where, request.name));
  }
  if (!traction.select.region) return {surface.triangle.begin(), surface.triangle.end()};
  const auto found = surface.groups.find(*traction.select.region);
  if (found == surface.groups.end()) {
    throw InputError(fmt::format("{}: the surface of body \"{}\" has no group \"{}\"{}",
                                 traction.select.where, request.name, *traction.select.region,
                                 alternatives_to(*traction.select.region, surface.groups)));
  }
  return tabulated(found->second.size(),
                   [&](std::size_t k) { return surface.triangle[found->second[k]]; });
}

/// Properties of a part of a surface, as a surface of its own.
struct Piece {
  bool closed = false, inside_out = false;
};
Piece piece_of(const BodySurface& surface, const std::vector<Triangle>& triangles) {
  Surface piece{.position = {surface.position.begin(), surface.position.end()}};
  for (const Triangle& t : triangles) {
    piece.triangle.push_back({t[0] - surface.first, t[1] - surface.first, t[2] - surface.first});
  }
  const SurfaceDefects defects = inspect_surface(piece);
  return {
      .closed = defects.open_edges == 0 && defects.crowded_edges == 0 && defects.flipped_edges == 0,
      .inside_out = defects.inside_out};
}

/// Checks that triangles are the whole surface of a cavity, or of several.
/// @throws InputError
void check_cavity(const BodyRequest& request, const TractionRequest& traction,
                  const BodySurface& surface, const std::vector<Triangle>& triangles) {
  if (triangles.empty()) return;  // refused as a traction on nothing
  const auto [closed, inside_out] = piece_of(surface, triangles);
  if (closed && inside_out) return;
  throw InputError(fmt::format(
      "{}: key body.traction.gas: the {} selected triangles of the surface of body \"{}\" {}; "
      "allowed: those of the whole surface of a cavity in the body",
      traction.select.where, triangles.size(), request.name,
      closed ? "are not around a cavity: their normals point out of the space inside"
             : "are not closed"));
}

}  // namespace

LoadedFacets loaded_facets(const BodyRequest& request, const TractionRequest& traction,
                           const BodySurface& surface, double longest) {
  LoadedFacets loaded;
  const std::optional<SpaceRegion> region = region_of(traction.select);
  const double least = std::cos(traction.angle * std::numbers::pi / 180);
  const Vec3d direction = direction_of(traction.normal);
  constexpr double digits = 1e-9;  // of cosines, and of places in units of the surface's size
  const auto corner = [&](Index vertex) { return surface.position[vertex - surface.first]; };
  std::vector<Triangle> facing;
  for (const Triangle& t : chosen_triangles(request, traction, surface)) {
    const Vec3d a = corner(t[0]);
    const Vec3d area = cross(corner(t[1]) - a, corner(t[2]) - a);
    const bool is_facing =
        direction == Vec3d{} || dot(area, direction) >= (least - digits) * norm(area);
    if (is_facing) facing.push_back(t);
  }
  if (traction.gas) {
    if (region) {
      std::erase_if(facing, [&](const Triangle& t) {
        return !std::all_of(t.begin(), t.end(),
                            [&](Index vertex) { return region->contains(corner(vertex)); });
      });
    }
    check_cavity(request, traction, surface, facing);
  }
  if (region && !traction.gas) {
    const double tolerance = digits * box_around(surface.position).extent();
    for (const Triangle& t : facing) {
      add_facets_in(*region, {corner(t[0]), corner(t[1]), corner(t[2])}, longest, tolerance,
                    loaded.facets);
    }
  } else {
    loaded.facets = facets_of(surface.position, facing, surface.first, longest);
    loaded.closed =
        traction.follower && !facing.empty() && (traction.gas || piece_of(surface, facing).closed);
  }
  if (loaded.facets.empty()) {
    throw InputError(fmt::format(
        "{}: this traction acts on no part of the surface of body \"{}\"{}; allowed: a group, a "
        "box, a ball "
        "or a normal that some of its {} triangles are in or have",
        traction.select.where.empty() ? request.where : traction.select.where, request.name,
        surface.triangle.empty() ? ", which has no triangles" : "", surface.triangle.size()));
  }
  for (const Facet& facet : loaded.facets) {
    loaded.force.push_back(norm(facet.area) * traction.traction - traction.pressure * facet.area);
  }
  return loaded;
}

Load traction_load(const BodyRequest& request, std::size_t number, const LoadedFacets& loaded) {
  const TractionRequest& asked = request.tractions[number];
  Load load{.curve = LoadCurve::of(asked.ramp, asked.curve),
            .body = request.name,
            .set = entry_name("traction", number),
            .on_surface = true,
            .follows = asked.follower,
            .closed = loaded.closed,
            .pressure = asked.pressure,
            .gas = asked.gas};
  double sizes = 0;
  Vec3d moment;
  const Vec3d origin = loaded.facets.front().centroid;
  for (std::size_t f = 0; f < loaded.facets.size(); ++f) {
    const double size = norm(loaded.force[f]);
    load.total += loaded.force[f];
    sizes += size;
    moment += size * (loaded.facets[f].centroid - origin);
  }
  load.centroid = origin;
  if (sizes > 0) load.centroid += moment / sizes;
  return load;
}

namespace {

/// Sums over the forces of a load on all ranks, about its centroid.
struct ForceSums {
  Vec3d force, torque;  ///< [N], [N m]
  LoadSums sizes;       ///< Of the forces' sizes in place of masses.
};
ForceSums sums_of(const Model& model, const Load& load) {
  ForceSums sums;
  ExactVector force, torque;
  for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
    const Vec3d f = load.force[k], x = model.position[load.phyxels[k]] - load.centroid;
    force.add(f);
    torque.add(cross(x, f));
    sums.sizes.add(norm(f), x);
  }
  std::vector<ExactSum*> all = sums.sizes.all();
  all.insert(all.end(), {&force.x, &force.y, &force.z, &torque.x, &torque.y, &torque.z});
  add_over_ranks(model, all);
  sums.force = force.value();
  sums.torque = torque.value();
  return sums;
}

}  // namespace

void follow_areas(const Model& model, Load& load, const std::vector<double>& change) {
  const ForceSums before = sums_of(model, load);
  for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
    load.force[k] = (1 + change[load.phyxels[k]]) * load.force[k];
  }
  const ForceSums now = sums_of(model, load);
  const ForceBalance balance =
      ForceBalance::adding(now.sizes, before.force - now.force, before.torque - now.torque);
  for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
    const Vec3d x = model.position[load.phyxels[k]] - load.centroid;
    load.force[k] += balance.change(x, norm(load.force[k]));
  }
}

void add_tractions(Model& model, const Scene& scene) {
  for (const Part& part : model.parts) {
    const bool is_first = &part == model.parts_of_body(part).data();
    const BodyRequest& request = scene.bodies[static_cast<std::size_t>(part.body)];
    if (!is_first || request.tractions.empty()) continue;
    const std::span<const Part> parts = model.parts_of_body(part);
    const auto begin = static_cast<std::size_t>(part.begin),
               count = static_cast<std::size_t>(parts.back().end) - begin;
    const std::span<const Vec3d> place = std::span(model.position).subspan(begin, count);
    const std::span<const double> support =
        std::span(model.neighbourhood.support).subspan(begin, count);
    const std::span<const Vec3d> surfel =
        std::span(model.surfels.position)
            .subspan(part.surfel_begin, part.surfel_end - part.surfel_begin);
    const std::span<const Triangle> triangles = model.surfels.triangles_of(part);
    const double longest =
        triangles.empty() ? 1
                          : longest_edge(facet_support(support, part.pair_length), surfel,
                                         triangles, part.surfel_begin, static_cast<Index>(count));
    for (std::size_t t = 0; t < request.tractions.size(); ++t) {
      const LoadedFacets loaded =
          loaded_facets(request, request.tractions[t],
                        {surfel, triangles, part.surfel_begin,
                         model.surfels.groups[static_cast<std::size_t>(part.body)]},
                        longest);
      std::vector<Vec3d> centroids;
      for (const Facet& f : loaded.facets) centroids.push_back(f.centroid);
      const std::vector<Vec3d> force = distribute(
          loaded.facets, loaded.force, phyxels_near(centroids, place, support), place, support);
      Load& load = model.loads.emplace_back(traction_load(request, t, loaded));
      for (std::size_t i = 0; i < force.size(); ++i) {
        if (force[i] == Vec3d{}) continue;
        load.phyxels.push_back(static_cast<Index>(begin + i));
        load.force.push_back(force[i]);
      }
    }
  }
}

}  // namespace phyxel
