#include "model/body_contact.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mesh/distance_field.hpp"
#include "mesh/rigid_copy.hpp"
#include "mesh/surface_topology.hpp"
#include "model/box_overlaps.hpp"
#include "model/contact.hpp"
#include "model/lists_from_pairs.hpp"
#include "model/parts.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "scene/scene_error.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

Index body_named(const Scene& scene, const std::string& name) {
  const auto found = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                  [&](const BodyRequest& body) { return body.name == name; });
  return static_cast<Index>(found - scene.bodies.begin());
}

bool touches_all(const ContactRequest& request) {
  return request.all.value_or(request.pairs.empty());
}

/// The laws of contact of a scene, without surfaces.
BodyContact laws_of(const Scene& scene) {
  const ContactRequest& request = *scene.contact;
  BodyContact contact{.law = {request.friction, request.kinetic_friction.value_or(request.friction),
                              request.restitution},
                      .all = touches_all(request),
                      .self = request.self,
                      .sweeps = request.sweeps,
                      .penalty = request.method == ContactMethod::penalty ? request.stiffness : 0};
  for (const ContactPairRequest& pair : request.pairs) {
    const Index a = body_named(scene, pair.first), b = body_named(scene, pair.second);
    const double friction = pair.friction.value_or(request.friction);
    const double kinetic = pair.kinetic_friction ? *pair.kinetic_friction
                           : pair.friction       ? friction
                                                 : contact.law.kinetic_friction;
    contact.pairs.push_back({std::min(a, b),
                             std::max(a, b),
                             {friction, kinetic, pair.restitution.value_or(request.restitution)}});
  }
  std::sort(contact.pairs.begin(), contact.pairs.end(),
            [](const BodyContact::Pair& p, const BodyContact::Pair& q) {
              return std::pair(p.first, p.second) < std::pair(q.first, q.second);
            });
  return contact;
}

LayerSupports supports_of_layer(const Model& model, Index body) {
  LayerSupports found;
  const std::vector<Index>& layer = model.body_contact.layer.phyxels;
  for (const Part& part : model.parts) {
    if (part.body != body) continue;
    const auto first = std::lower_bound(layer.begin(), layer.end(), part.begin);
    const auto last = std::lower_bound(first, layer.end(), part.end);
    for (auto i = first; i != last; ++i) {
      const double h = model.neighbourhood.support[*i];
      found = {std::min(found.least, h), std::max(found.most, h)};
    }
  }
  if (!model.share) return found;
  const Communicator& ranks = *model.share->communicator;
  return {ranks.smallest(found.least), ranks.largest(found.most)};
}

/// The distances from a body's surface, as finely as its phyxels are spaced.
/// @param largest support of a phyxel of any body's surface [m]
std::shared_ptr<const DistanceArrays> distances_of(const BodyRequest& request, Surface surface,
                                                   const LayerSupports& supports, double largest) {
  const SurfaceDefects defects = inspect_surface(surface);
  if (!connect(surface).closed) {
    throw InputError(named(
        request, fmt::format("body \"{}\" cannot touch other bodies: its surface is not closed "
                             "({}); allowed: a closed one, or pairs that leave it out",
                             request.name, defects.describe())));
  }
  orient(surface);
  // Points of other bodies look a distance up half of their own spacing away from the surface. The
  // limit keeps grids small beside far coarser bodies.
  constexpr double of_support = 0.5, most = 8;
  const double margin = std::min(of_support * largest, most * supports.most);
  return std::make_shared<const DistanceArrays>(
      distances_from(surface, nodes_over_support * supports.least, supports.most, margin));
}

/// The box of the phyxels of a body's surface at rest, with a margin.
Box box_of(const BodyDistances& distances) {
  const DistanceField& field = distances.arrays->shape;
  const double cell = DistanceField::edge * field.spacing;
  std::vector<Vec3d> corners;
  for (int c = 0; c < 8; ++c) {
    const Vec3d size{cell * field.count.x * (c & 1), cell * field.count.y * (c >> 1 & 1),
                     cell * field.count.z * (c >> 2)};
    corners.push_back(distances.turn * (field.low + size) + distances.place);
  }
  return box_around(corners);
}

/// The first of some bodies that are copies of each other.
struct Original {
  std::size_t body = 0;
  Surface surface;
  LayerSupports supports;  ///< Its own: its field does not depend on whether there are copies.
};

/// The rigid motion from a body to its copy. Copies have phyxels as far apart, but for rounding and
/// for what clouds of another rotation differ by.
std::optional<RigidMotion> motion_to(const Original& original, const Surface& surface,
                                     const LayerSupports& supports) {
  const auto are_alike = [](double a, double b) {
    constexpr double tolerance = 0.01;
    return std::abs(a - b) <= tolerance * b;
  };
  if (!are_alike(supports.least, original.supports.least) ||
      !are_alike(supports.most, original.supports.most)) {
    return std::nullopt;
  }
  return rigid_motion_between(original.surface, surface);
}

/// A phyxel that is inside another body.
struct Overlap {
  double depth = 0;  ///< [m]
  Index phyxel = 0, body = 0;
};

/// The phyxel of this rank that is deepest inside another body at rest.
Overlap deepest_overlap(const Model& model) {
  const BodyContact& contact = model.body_contact;
  const std::vector<Box> boxes = tabulated(contact.distances.size(), [&](std::size_t b) {
    return contact.distances[b] ? box_of(contact.distances[b]) : Box{};
  });
  NearBoxes near;
  const Csr partners = partners_of_bodies(contact, boxes, near);
  Overlap found;
  // A body whose deepest place is inside another one, as that of a body twice at the same place.
  for (const Part& part : model.parts) {
    if (part.begin == part.owned_end() || !contact.distances[part.body]) continue;
    const Vec3d middle = contact.distances[part.body].deepest();
    for (const Index other : partners.row(part.body)) {
      if (other == part.body) continue;
      const double depth = -contact.distances[other].view().gap(middle).distance;
      if (depth > found.depth) found = {depth, part.begin, other};
    }
  }
  for (std::size_t k = 0; k < contact.layer.phyxels.size(); ++k) {
    const Index i = contact.layer.phyxels[k];
    const Index body = part_of(model, i).body;
    for (const Index other : partners.row(body)) {
      if (other == body || !contains(boxes[other], model.position[i])) continue;
      const double depth =
          contact.layer.offset[k] - contact.distances[other].view().gap(model.position[i]).distance;
      if (depth > found.depth) found = {depth, i, other};
    }
  }
  return found;
}

}  // namespace

PlacedDistances BodyDistances::view() const { return view(arrays->view()); }

Vec3d BodyDistances::deepest() const { return turn * arrays->deepest + place; }

const ContactLaw* BodyContact::law_of(Index a, Index b) const {
  if (a == b && !self) return nullptr;
  const std::pair wanted(std::min(a, b), std::max(a, b));
  const auto found = std::lower_bound(pairs.begin(), pairs.end(), wanted,
                                      [](const Pair& pair, const std::pair<Index, Index>& other) {
                                        return std::pair(pair.first, pair.second) < other;
                                      });
  if (found != pairs.end() && std::pair(found->first, found->second) == wanted) return &found->law;
  return all || a == b ? &law : nullptr;
}

bool touches_bodies(const Scene& scene, std::size_t body) {
  if (!scene.contact) return false;
  if (scene.contact->self) return true;
  if (touches_all(*scene.contact)) return scene.bodies.size() > 1;
  const std::string& name = scene.bodies[body].name;
  return std::any_of(
      scene.contact->pairs.begin(), scene.contact->pairs.end(),
      [&](const ContactPairRequest& pair) { return pair.first == name || pair.second == name; });
}

std::vector<LayerSupports> add_body_layer(Model& model, const Scene& scene,
                                          std::span<const double> offset) {
  if (!scene.contact) return {};
  model.body_contact = laws_of(scene);
  BodyContact& contact = model.body_contact;
  const auto touches = tabulated(scene.bodies.size(), [&](std::size_t b) {
    return static_cast<char>(touches_bodies(scene, b));
  });
  if (std::none_of(touches.begin(), touches.end(), [](char t) { return t != 0; })) {
    model.warnings.push_back(
        "[contact] has nothing to act on: the scene has one body, which self = true lets touch "
        "itself");
    return {};
  }
  for (const Part& part : model.parts) {
    if (!touches[part.body]) continue;
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      if (offset[i] < 0) continue;
      contact.layer.phyxels.push_back(i);
      contact.layer.offset.push_back(offset[i]);
    }
  }
  std::vector<LayerSupports> supports(scene.bodies.size());
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    if (touches[b]) supports[b] = supports_of_layer(model, static_cast<Index>(b));
  }
  return supports;
}

void add_body_surfaces(Model& model, const Scene& scene, std::span<const LayerSupports> supports,
                       const std::function<Surface(std::size_t body)>& surface_of) {
  std::vector<BodyDistances>& distances = model.body_contact.distances;
  distances.resize(supports.size());
  std::vector<Original> originals;
  std::vector<std::size_t> original_of(supports.size());
  for (std::size_t b = 0; b < supports.size(); ++b) {
    if (!(supports[b].most > 0)) continue;  // it touches nothing
    Surface surface = surface_of(b);
    std::size_t o = 0;
    for (; o < originals.size(); ++o) {
      const std::optional<RigidMotion> motion = motion_to(originals[o], surface, supports[b]);
      if (!motion) continue;
      distances[b] = {nullptr, motion->turn, motion->place};
      break;
    }
    if (o == originals.size()) originals.push_back({b, std::move(surface), supports[b]});
    original_of[b] = o;
  }
  double largest = 0;
  for (const LayerSupports& s : supports) largest = std::max(largest, s.most);
  std::vector<std::shared_ptr<const DistanceArrays>> made;
  for (Original& original : originals) {
    made.push_back(distances_of(scene.bodies[original.body], std::move(original.surface),
                                original.supports, largest));
  }
  for (std::size_t b = 0; b < supports.size(); ++b) {
    if (supports[b].most > 0) distances[b].arrays = made[original_of[b]];
  }
}

Csr partners_of_bodies(const BodyContact& contact, std::span<const Box> boxes, NearBoxes& near) {
  std::vector<std::pair<Index, Index>> pairs;
  near.for_each_overlap(boxes, [&](std::size_t a, std::size_t b) {
    const auto first = static_cast<Index>(a), second = static_cast<Index>(b);
    if (!contact.distances[a] || !contact.distances[b] || !contact.law_of(first, second)) return;
    pairs.emplace_back(first, second);
    pairs.emplace_back(second, first);
  });
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    const auto itself = static_cast<Index>(b);
    if (contact.distances[b] && contact.law_of(itself, itself)) pairs.emplace_back(itself, itself);
  }
  Csr partners;
  group(boxes.size(), pairs, partners.offsets, partners.indices);
  for (std::size_t b = 0; b < boxes.size(); ++b) {
    std::sort(partners.indices.begin() + partners.offsets[b],
              partners.indices.begin() + partners.offsets[b + 1]);
  }
  return partners;
}

std::string bodies_overlap_at_start(const Model& model, const Scene& scene) {
  if (!model.body_contact.acts()) return {};
  const Overlap found = deepest_overlap(model);
  // Distances are interpolated, and from bent surfaces off by a hundredth of a spacing.
  constexpr double tolerance = 0.01;
  if (!is_deepest_overlap(model, found.depth, found.phyxel, tolerance)) return {};
  const Vec3d x = model.position[found.phyxel];
  const std::string& where = scene.contact->where;
  return fmt::format(
      "{}{}body \"{}\" is {:.3g} m deep in body \"{}\" at the start, at ({:.6g}, {:.6g}, {:.6g}) "
      "m; "
      "allowed: bodies that do not overlap, or pairs that do not touch",
      where, where.empty() ? "" : ": ", part_of(model, found.phyxel).name, found.depth,
      scene.bodies[static_cast<std::size_t>(found.body)].name, x.x, x.y, x.z);
}

}  // namespace phyxel
