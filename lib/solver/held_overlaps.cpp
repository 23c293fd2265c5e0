#include "phyxel/held_overlaps.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "mesh/distance_field.hpp"
#include "model/body_contact.hpp"
#include "model/box_overlaps.hpp"
#include "model/contact_groups.hpp"
#include "model/parts.hpp"
#include "model/spatial_hash.hpp"
#include "phyxel/physics/body_contact.hpp"
#include "phyxel/physics/obstacles.hpp"
#include "rank_exchange.hpp"
#include "solver/contact_penalty.hpp"
#include "solver/step_sums.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Distance up to which a held phyxel of a surface says where another one is, in its supports.
constexpr double reach_of_surface = 2;
/// Distance between a place inside a body and the nearest phyxel, in its supports.
constexpr double reach_inside = 0.6;
/// Overlaps that count, in supports: distances are interpolated.
constexpr double tolerance = 0.01;

/// A phyxel that is held or moved along all axes.
struct HeldPhyxel {
  Vec3d rest, now;     ///< Places [m].
  Mat3d back;          ///< The inverse of the deformation gradient.
  Vec3d out;           ///< Outward normal of the body's surface there; zero on edges and inside.
  double support = 0;  ///< [m]
  double offset = -1;  ///< Its distance from its body's surface [m]; negative inside.
  Index body = 0;
};

/// Where supports lead the phyxels that they hold or move along all axes.
class HeldPlaces {
 public:
  HeldPlaces(const Model& model, const Solver& solver)
      : model_(model), is_held_(supported_phyxels(model)), now_(model.position) {
    const bool rests = solver.method() == Method::equilibrium;
    for (const Motion& motion : model.motions) {
      path_.push_back(rests ? motion.path_after(solver.steps() > 0 ? 1 : 0)
                            : motion.path_at(solver.time()));
      for (const Index i : motion.phyxels) {
        const Vec3d rest = model.position[i];
        now_[i] = motion.along_axes(rest + path_.back().at(rest), now_[i]);
      }
    }
  }
  bool is_held(Index i) const { return is_held_[i] != 0; }
  Vec3d now(Index i) const { return now_[i]; }

  /// Sets the inverse deformation gradients of some phyxels, by their numbers.
  void set_deformations(std::span<const Index> phyxels, std::vector<HeldPhyxel>& held) const {
    std::map<Index, std::size_t> number;
    for (std::size_t k = 0; k < phyxels.size(); ++k) number[phyxels[k]] = k;
    std::vector<Mat3d> gradient(phyxels.size());
    for (std::size_t m = 0; m < path_.size(); ++m) {
      const Axes axes = model_.motions[m].axes;
      const bool along[] = {axes.x, axes.y, axes.z};
      for (const Index i : model_.motions[m].phyxels) {
        const auto at = number.find(i);
        if (at == number.end()) continue;
        for (int e = 0; e < 9; ++e) {
          if (along[e / 3]) gradient[at->second](e / 3, e % 3) = path_[m].turn(e / 3, e % 3);
        }
      }
    }
    for (std::size_t k = 0; k < held.size(); ++k) held[k].back = inverse_deformation(gradient[k]);
  }

 private:
  const Model& model_;
  std::vector<char> is_held_;
  std::vector<Vec3d> now_;  // [m], shape [n]
  std::vector<Path> path_;  // of each motion
};

/// Calls each(i, body) for the phyxels of this rank that are held.
template <class Each>
void for_each_held(const Model& model, const HeldPlaces& places, Each&& each) {
  for (const Part& part : model.parts) {
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      if (places.is_held(i)) each(i, part.body);
    }
  }
}

/// True of the bodies all of whose phyxels are held. Of a share: collective.
std::vector<char> bodies_held_as_wholes(const Model& model, const HeldPlaces& places) {
  std::vector<std::int64_t> free(count_of_bodies(model));
  for (const Part& part : model.parts) {
    for (Index i = part.begin; i < part.owned_end(); ++i) free[part.body] += !places.is_held(i);
  }
  if (model.share) model.share->communicator->add(free);
  return tabulated(free.size(), [&](std::size_t b) { return static_cast<char>(free[b] == 0); });
}

/// The distance of each phyxel from its body's surface, as far as bodies or obstacles touch it [m];
/// negative for those that touch nothing, shape [n].
std::vector<double> offsets_of_layer(const Model& model) {
  std::vector<double> offset(static_cast<std::size_t>(model.size()), -1);
  const ContactLayer& layer = model.body_contact.layer;
  for (std::size_t k = 0; k < layer.phyxels.size(); ++k) offset[layer.phyxels[k]] = layer.offset[k];
  return offset;
}

/// Keeps the deeper one of two overlaps, by their shares of supports. The order does not matter.
void keep_deeper(HeldOverlap& kept, const HeldOverlap& other) {
  const auto is_deeper = [](const HeldOverlap& a, const HeldOverlap& b) {
    return std::tuple(a.share(), a.depth, -a.body, -a.other) >
           std::tuple(b.share(), b.depth, -b.body, -b.other);
  };
  if (other.depth > 0 && (kept.depth == 0 || is_deeper(other, kept))) kept = other;
}

/// Makes the deepest overlaps those of all ranks. Of a share: collective.
void keep_deepest_of_ranks(const Model& model, std::vector<HeldOverlap>& overlaps) {
  if (!model.share) return;
  const Communicator& ranks = *model.share->communicator;
  for (const std::vector<HeldOverlap>& some : allgathered(ranks, overlaps)) {
    for (std::size_t k = 0; k < overlaps.size(); ++k) keep_deeper(overlaps[k], some[k]);
  }
}

/// The nearest of some phyxels to a place, whatever their order.
struct Nearest {
  Vec3d place;  ///< [m]
  const HeldPhyxel* phyxel = nullptr;

  void see(const HeldPhyxel& other) {
    const auto rank = [&](const HeldPhyxel& k) {
      return std::tuple(norm(k.now - place), k.rest.x, k.rest.y, k.rest.z);
    };
    if (!phyxel || rank(other) < rank(*phyxel)) phyxel = &other;
  }
};

/// The held phyxels of bodies that may overlap, and their overlaps.
class HeldMeetings {
 public:
  HeldMeetings(const Model& model, const HeldPlaces& places, const std::vector<char>& is_whole)
      : model_(model), is_whole_(is_whole), boxes_(is_whole.size(), no_box) {
    for_each_held(model, places, [&](Index i, Index body) {
      const Vec3d x = places.now(i);
      boxes_[body] =
          together(boxes_[body], grown({x, x}, reach_of_surface * model.neighbourhood.support[i]));
    });
    if (model.share) {
      const Communicator& ranks = *model.share->communicator;
      for (const std::vector<Box>& some : allgathered(ranks, boxes_)) {
        for (std::size_t b = 0; b < boxes_.size(); ++b) boxes_[b] = together(boxes_[b], some[b]);
      }
    }
    NearBoxes near;
    partners_ = partners_of_bodies(model.body_contact, boxes_, near);
    own_ = candidates(places);
    all_ = own_;
    if (model.share) {
      const Communicator& ranks = *model.share->communicator;
      all_.clear();
      for (const std::vector<HeldPhyxel>& some : allgathered(ranks, own_)) {
        all_.insert(all_.end(), some.begin(), some.end());
      }
    }
  }

  /// The deepest overlap of each body, of this rank's phyxels.
  std::vector<HeldOverlap> deepest() const {
    std::vector<HeldOverlap> found(is_whole_.size());
    std::map<Index, std::vector<std::size_t>> of_body;
    for (std::size_t k = 0; k < all_.size(); ++k) of_body[all_[k].body].push_back(k);
    for (const auto& entry_of_body : of_body) {
      const Index body = entry_of_body.first;
      const std::vector<std::size_t>& numbers = entry_of_body.second;
      std::vector<Vec3d> places;
      double support = 0;
      for (const std::size_t k : numbers) {
        places.push_back(all_[k].now);
        support = std::max(support, all_[k].support);
      }
      const SpatialHash hash(places, support);
      for (const HeldPhyxel& x : own_) {
        if (x.offset < 0 || x.body == body || !may_meet(x, body)) continue;
        HeldOverlap overlap = overlap_with(x, body, [&](auto&& visit) {
          hash.visit_ball(x.now, reach_of_surface * support, [&](const SpatialHash::Entry& entry) {
            visit(all_[numbers[static_cast<std::size_t>(entry.index)]]);
          });
        });
        keep_deeper(found[x.body], overlap);
      }
    }
    return found;
  }

 private:
  bool may_meet(const HeldPhyxel& x, Index body) const {
    return contains(boxes_[body], x.now) && std::ranges::binary_search(partners_.row(x.body), body);
  }
  /// The held phyxels of this rank that are in the box of a body that theirs may touch.
  std::vector<HeldPhyxel> candidates(const HeldPlaces& places) const {
    const std::vector<double> offset = offsets_of_layer(model_);
    std::vector<HeldPhyxel> found;
    std::vector<Index> phyxels;
    for_each_held(model_, places, [&](Index i, Index body) {
      if (offset[i] < 0 && !is_whole_[body]) return;
      const HeldPhyxel held{.rest = model_.position[i],
                            .now = places.now(i),
                            .support = model_.neighbourhood.support[i],
                            .offset = offset[i],
                            .body = body};
      const std::span<const Index> others = partners_.row(body);
      if (std::none_of(others.begin(), others.end(),
                       [&](Index b) { return b != body && may_meet(held, b); })) {
        return;
      }
      found.push_back(held);
      phyxels.push_back(i);
    });
    places.set_deformations(phyxels, found);
    for (HeldPhyxel& held : found) {
      if (held.offset < 0) continue;
      const PlacedDistances field = model_.body_contact.distances[held.body].view();
      const Vec3d normal = field.gap(held.rest).normal, way = 0.2 * held.support * normal;
      const double slope =
          (field.gap(held.rest + way).distance - field.gap(held.rest - way).distance) /
          (2 * norm(way));
      constexpr double flat = 0.95;  // at an edge of a box, the slope is 0.85
      if (!(slope > flat)) continue;
      const Vec3d out = transpose(held.back) * normal;
      held.out = out / norm(out);
    }
    return found;
  }
  /// The overlap of a phyxel with a body, from the held phyxels of that body which are nearest to
  /// it: of its surface where the phyxel may have come through it, and of all if the body is held
  /// as a whole.
  template <class VisitNear>
  HeldOverlap overlap_with(const HeldPhyxel& x, Index body, VisitNear&& visit_near) const {
    const bool whole = is_whole_[body] != 0;
    Nearest of_surface{x.now}, of_all{x.now};
    visit_near([&](const HeldPhyxel& k) {
      const Vec3d apart = x.now - k.now;
      const double distance = norm(apart);
      if (whole && distance <= reach_inside * k.support) of_all.see(k);
      if (k.offset < 0 || distance > reach_of_surface * k.support || dot(x.out, k.out) > -0.2) {
        return;
      }
      if (norm(along(k.out, apart)) <= reach_inside * k.support) of_surface.see(k);
    });
    const HeldPhyxel* nearest = of_all.phyxel ? of_all.phyxel : of_surface.phyxel;
    if (!nearest) return {};
    const Vec3d at_rest = nearest->rest + nearest->back * (x.now - nearest->now);
    double depth = x.offset - model_.body_contact.distances[body].view().gap(at_rest).distance;
    if (of_surface.phyxel && depth > 0) {
      // In a thin part the nearest surface is soon another one than that which it came through.
      const HeldPhyxel& k = *of_surface.phyxel;
      const double below = x.offset + k.offset - dot(k.out, x.now - k.now);
      depth = std::max(depth, std::min(below, 2 * depth));
    }
    const double support = std::min(x.support, nearest->support);
    if (!(depth > tolerance * support)) return {};
    return {depth, support, x.body, body, whole && is_whole_[x.body]};
  }

  const Model& model_;
  const std::vector<char>& is_whole_;
  std::vector<Box> boxes_;  // of the held phyxels of each body [m]
  Csr partners_;
  std::vector<HeldPhyxel> own_, all_;  // of this rank, and of all ranks
};

/// The overlaps with obstacles, of this rank's phyxels.
std::vector<HeldOverlap> deepest_in_obstacles(const Model& model, const HeldPlaces& places,
                                              const std::vector<char>& is_whole,
                                              const PlacedObstacles& placed) {
  std::vector<HeldOverlap> found(placed.size());
  const std::vector<double> offset = offsets_of_layer(model);
  for (std::size_t o = 0; o < placed.size(); ++o) {
    const ObstacleStep rest = model.obstacles[o].step_from(0, 0);
    ObstacleShapes::with(model.obstacles[o].form, [&](const auto& shape) {
      for_each_held(model, places, [&](Index i, Index body) {
        const double at_surface = std::max(offset[i], 0.0);
        const auto depth_at = [&](const ObstacleStep& at, Vec3d x) {
          return at_surface - gap_to(shape, at, x).distance;
        };
        const double now = depth_at(placed[o], places.now(i));
        if (!(now > 0)) return;
        // Clamps may be embedded in an obstacle from the start.
        const double depth = now - std::max(0.0, depth_at(rest, model.position[i]));
        const double support = model.neighbourhood.support[i];
        if (!(depth > tolerance * support)) return;
        keep_deeper(found[o], {depth, support, body, static_cast<Index>(o), is_whole[body] != 0});
      });
    });
  }
  return found;
}

}  // namespace

void HeldOverlaps::keep_wholes(const HeldOverlaps& now) {
  const auto keep = [](std::vector<HeldOverlap>& kept, const std::vector<HeldOverlap>& others) {
    kept.resize(std::max(kept.size(), others.size()));
    for (std::size_t k = 0; k < others.size(); ++k) {
      if (others[k].is_whole) keep_deeper(kept[k], others[k]);
    }
  };
  keep(of_obstacles, now.of_obstacles);
  keep(of_bodies, now.of_bodies);
}

HeldOverlaps find_held_overlaps(const Model& model, const Solver& solver,
                                std::span<const RigidState> rigid) {
  const bool bodies_move = has_moving_supports(model);
  const bool obstacles_move =
      std::any_of(model.obstacles.begin(), model.obstacles.end(),
                  [](const Obstacle& obstacle) { return !obstacle.stands_still(); });
  if (model.motions.empty() || !(bodies_move || obstacles_move)) return {};
  if (touching_count(model) == 0) return {};
  const HeldPlaces places(model, solver);
  const std::vector<char> is_whole = bodies_held_as_wholes(model, places);
  HeldOverlaps found;
  const double share = solver.steps() > 0 ? 1 : 0;
  const PlacedObstacles placed = solver.method() == Method::equilibrium
                                     ? obstacles_after(model, share, share)
                                     : obstacles_now(model, solver.time(), 0, rigid);
  found.of_obstacles = deepest_in_obstacles(model, places, is_whole, placed);
  keep_deepest_of_ranks(model, found.of_obstacles);
  if (!model.body_contact.acts() || !bodies_move) return found;
  found.of_bodies = HeldMeetings(model, places, is_whole).deepest();
  keep_deepest_of_ranks(model, found.of_bodies);
  return found;
}

const std::string& name_of_body(const Model& model, Index body) {
  return std::find_if(model.parts.begin(), model.parts.end(),
                      [&](const Part& part) { return part.body == body; })
      ->name;
}

std::string warning_of_held_overlaps(const Model& model, const HeldOverlaps& deepest) {
  HeldOverlap found;
  std::string other;
  for (const HeldOverlap& overlap : deepest.of_bodies) {
    if (!overlap.is_whole || overlap.share() <= found.share()) continue;
    found = overlap;
    other = fmt::format("body \"{}\", which is, too", name_of_body(model, overlap.other));
  }
  for (const HeldOverlap& overlap : deepest.of_obstacles) {
    if (!overlap.is_whole || overlap.share() <= found.share()) continue;
    found = overlap;
    other = fmt::format("obstacle \"{}\"",
                        model.obstacles[static_cast<std::size_t>(overlap.other)].name);
  }
  if (found.depth == 0) return {};
  return fmt::format(
      "body \"{}\", which supports hold or move as a whole, was {:.3g} m deep in {}: no force "
      "keeps "
      "it out, and none is counted between them; motions (body.motion, obstacle.motion) that leave "
      "it room may be meant",
      name_of_body(model, found.body), found.depth, other);
}

}  // namespace phyxel
