#include "model/closure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "model/closing_areas.hpp"
#include "model/closing_sums.hpp"
#include "model/loads.hpp"
#include "phyxel/error.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

using closing::Bodies;
using closing::Body;
using closing::ease_area;
using closing::Sums;
using closing::Unknown;

/// After so many the sums are as closed as they get: 1,500 phyxels take 2,600 to 1e-10.
constexpr int most_iterations = 10'000;
/// Iterations that have to take a tenth of what is left.
constexpr int patience = 500;
/// The same before all phyxels have unknowns.
constexpr int limited_patience = 50;

/// What is left of a body's sums, by their areas; nothing if all phyxels are supported.
double left_of(const Body& body) {
  return body.areas > 0 ? std::sqrt(body.residual_squared / body.areas) : 0;
}

/// Updates what is left of a body's sums.
/// @returns whether they are as closed as is asked or as they get
bool update_and_check(Body& body) {
  body.left = left_of(body);
  if (body.iterations == 0) body.left_first = body.left;
  if (!(body.left > body.tolerance) || !(body.gradient_squared > 0) ||
      body.iterations == most_iterations) {
    return true;
  }
  if (body.iterations % (body.is_limited ? limited_patience : patience) != 0) return false;
  const bool slow = !(body.left < 0.9 * body.left_before);
  body.left_before = body.left;
  return slow;
}

/// The share of the way to its tolerance that a body has come.
double way_of(const Body& body) {
  return std::log(body.left_first / body.left) / std::log(body.left_first / body.tolerance);
}

/// The search for the smallest unknowns that close the sums: conjugate gradients for least squares
/// (Björck 1996, algorithm 7.4.1), of all bodies at once, each with its own steps. Smooth unknowns,
/// which take the most of them, matter the least: a few iterations do most of what can be done.
class Search {
 public:
  /// @param n number of phyxels of the model
  Search(Sums& sums, const Bodies& all, std::size_t n)
      : sums_(sums), all_(all), x_(n), gradient_(n), direction_(n), residual_(n) {}

  /// Returns the unknowns. What is left of each body's sums is summed anew at the end.
  std::vector<Unknown> run() {
    Stage stage("closed gradients");
    sums_.open(all_, [&](Index i, Vec3d sum) { residual_[i] = -sum; });
    sums_.limit_to_irregular(all_, residual_);
    iterate(all_, stage);
    // For a small tolerance the regular phyxels of a body may have to take part.
    Bodies open = all_;
    open.erase_if(
        [](const Body& body) { return !body.is_limited || !(body.left > body.tolerance); });
    if (!open.empty()) {
      sums_.find_means(open, x_);
      sums_.widen(open, x_);
      find_residual(open);
      iterate(open, stage);
    }
    find_residual(all_);
    all_.sum(&Body::residual_squared, [&](const Body&, Index i) { return square_of(i); });
    for (Body* body : all_) body->left = left_of(*body);
    stage.finish();
    return std::move(x_);
  }

 private:
  double square_of(Index i) const { return dot(residual_[i], residual_[i]); }

  /// Finds the residual of the present unknowns, and the mean change of volume of each body.
  void find_residual(const Bodies& bodies) {
    bodies.for_each([&](const Body&, Index i) { residual_[i] = {}; });
    sums_.apply(bodies, x_, &Body::image_squared, [&](Index i, Vec3d image) {
      residual_[i] = -image;
      return 0.0;
    });
    sums_.open(bodies, [&](Index i, Vec3d sum) { residual_[i] -= sum; });
    sums_.find_means(bodies, x_);
  }

  /// Iterates from the present unknowns and their residual.
  void iterate(Bodies active, Stage& stage) {
    active.sum(&Body::residual_squared, [&](const Body&, Index i) { return square_of(i); });
    sums_.apply_transpose(active, residual_, gradient_, &Body::gradient_squared);
    active.for_each([&](const Body&, Index i) {
      if (sums_.is_sought(i)) direction_[i] = gradient_[i];
    });
    for (;;) {
      active.erase_if(update_and_check);
      if (active.empty()) return;
      double way = 1;
      for (const Body* body : active) way = std::min(way, way_of(*body));
      stage.reach(way);
      // The gradient is used up, and its memory takes the image of the direction.
      sums_.apply(active, direction_, &Body::image_squared, [&](Index i, Vec3d image) {
        gradient_[i].closing = image;
        return dot(image, image);
      });
      active.erase_if([](const Body& body) { return !(body.image_squared > 0); });
      active.sum(&Body::residual_squared, [&](const Body& body, Index i) {
        const double step = body.gradient_squared / body.image_squared;
        if (sums_.is_sought(i)) add(x_[i], step, direction_[i]);
        if (sums_.is_changed(i)) residual_[i] -= step * gradient_[i].closing;
        return square_of(i);
      });
      sums_.apply_transpose(active, residual_, gradient_, &Body::next_gradient_squared);
      active.for_each([&](const Body& body, Index i) {
        if (!sums_.is_sought(i)) return;
        Unknown turned = gradient_[i];
        add(turned, body.next_gradient_squared / body.gradient_squared, direction_[i]);
        direction_[i] = turned;
      });
      for (Body* body : active) {
        body->gradient_squared = body->next_gradient_squared;
        ++body->iterations;
      }
    }
  }

  Sums& sums_;
  const Bodies& all_;
  std::vector<Unknown> x_, gradient_, direction_;
  std::vector<Vec3d> residual_;
};

/// The first phyxel of all ranks whose volume would have to change too far, and how far.
struct Excess {
  double phyxel = HUGE_VAL;  ///< Index in the whole model; infinite: none.
  double change = 0;         ///< Relative; infinite: it is no number.
};
/// @param change(body, i) relative change of the volume of phyxel i
template <class Change>
Excess first_excess(const Model& model, const Bodies& bodies, Change&& change) {
  Excess first;
  for (const Body* body : bodies) {
    for (const Part& part : body->parts) {
      for (Index i = part.begin; i < part.owned_end(); ++i) {
        // Half is far beyond what closes clouds that are any good; NaN is none of these.
        const double found = change(*body, i);
        if (std::abs(found) < 0.5 || model.global_id(i) >= first.phyxel) continue;
        // A NaN would get lost among ranks.
        first = {static_cast<double>(model.global_id(i)), std::isnan(found) ? HUGE_VAL : found};
      }
    }
  }
  if (!model.share) return first;
  const Communicator& ranks = *model.share->communicator;
  const double phyxel = ranks.smallest(first.phyxel);
  return {phyxel, ranks.smallest(first.phyxel == phyxel ? first.change : HUGE_VAL)};
}

/// A body that cannot be closed.
struct Unclosable {
  const Part* body;    ///< Its first part.
  std::string reason;  ///< "phyxel 7 would have to change its volume by 80%"
};
Unclosable unclosable(const Model& model, const Excess& excess) {
  const Part* body = model.parts.data();
  double first = 0, end = 0;  // the body's first phyxel, and the end of the part
  for (const Part& part : model.parts) {
    if (part.body != body->body) {
      body = &part;
      first = end;
    }
    end += part.size;
    if (excess.phyxel < end) break;
  }
  return {body,
          fmt::format("phyxel {} would have to change its volume {}", excess.phyxel - first,
                      std::isfinite(excess.change) ? fmt::format("by {:.0f}%", 100 * excess.change)
                                                   : "beyond all bounds")};
}

/// Leaves a body as it was. @param before volume of each phyxel of the model [m³]
void leave_open(Model& model, Bodies& bodies, const Unclosable& found,
                const std::vector<double>& before) {
  model.warnings.push_back(fmt::format(
      "body \"{}\": gradients are not closed, as {}: stresses may be off by some 10%; more phyxels "
      "where the body is thin help",
      found.body->name, found.reason));
  const Index number = found.body->body;
  bodies.erase_if([&](const Body& body) { return body.parts.front().body == number; });
  for (Part& part : model.parts) {
    if (part.body != number) continue;
    part.closure = 0;
    std::copy(before.begin() + part.begin, before.begin() + part.end,
              model.volume.begin() + part.begin);
  }
}

void warn_of(Model& model, const Body& body) {
  if (body.left <= body.tolerance) return;
  model.warnings.push_back(fmt::format(
      "body \"{}\": sums over neighbourhoods are closed to {:.2g} after {} iterations, asked was "
      "{:g}; more phyxels across its thinnest places help",
      body.parts.front().name, body.left, body.iterations, body.tolerance));
}

/// Makes loads by volume follow the phyxels' volumes. @param before volume of each phyxel [m³]
void follow_volumes(Model& model, const std::vector<double>& before) {
  for (Load& load : model.loads) {
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
      const Index i = load.phyxels[k];
      load.force[k] += (model.volume[i] - before[i]) * load.density;
    }
  }
}

/// The surface of a body in a model that is no share.
std::vector<Facet> facets_of(const Model& model, const Part& part) {
  const std::span<const Vec3d> position =
      std::span(model.surfels.position)
          .subspan(part.surfel_begin, part.surfel_end - part.surfel_begin);
  const std::span<const Triangle> triangles = model.surfels.triangles_of(part);
  Index size = 0;
  for (const Part& of_body : model.parts_of_body(part)) size += of_body.size;
  const std::span<const double> support =
      std::span(model.neighbourhood.support).subspan(part.begin, size);
  return facets_of(position, triangles, part.surfel_begin,
                   longest_edge(facet_support(support, part.pair_length), position, triangles,
                                part.surfel_begin, size));
}

}  // namespace

std::optional<std::string> close_bodies(Model& model, const std::vector<ClosedBody>& wanted,
                                        std::vector<Vec3d> areas) {
  if (wanted.empty()) return std::nullopt;
  const Phase phase("closing gradients");
  const std::vector<double> before = model.volume;
  std::vector<Body> list, parts;
  for (const auto& [of_body, enclosed] : wanted) {
    Body& body = list.emplace_back(Body{.parts = of_body, .tolerance = of_body.front().closure});
    double volume = 0;
    for (const Part& part : of_body) volume += part.volume;
    for (Index i = body.begin(); i < body.end(); ++i) model.volume[i] *= enclosed / volume;
  }
  Bodies bodies(model, list);
  Sums sums(model, bodies, std::move(areas));
  const std::vector<Unknown> found = Search(sums, bodies, model.volume.size()).run();
  const auto change = [&](const Body& body, Index i) {
    return sums.change_of_volume(body, i, found[i]);
  };
  for (;;) {
    const Excess excess = first_excess(model, bodies, change);
    if (!(excess.phyxel < HUGE_VAL)) break;
    const Unclosable open = unclosable(model, excess);
    if (!open.body->automatic_closure) {
      return fmt::format(
          "body \"{}\": gradients cannot be closed (closure = {:g}): {}; allowed are more phyxels "
          "where the body is thin, or closure = 0",
          open.body->name, open.body->closure, open.reason);
    }
    leave_open(model, bodies, open, before);
  }
  if (bodies.empty()) return std::nullopt;
  model.closing.resize(model.volume.size());
  bodies.for_each([&](const Body& body, Index i) {
    model.volume[i] *= 1 + change(body, i);
    model.closing[i] = sums.closing_vector(body, i, found[i]);
  });
  bodies.refresh_ghosts(model.volume);
  bodies.refresh_ghosts(model.closing);
  for (const Body* body : bodies) {
    for (Part& part : body->parts) parts.push_back({.parts = {&part, 1}});
  }
  Bodies(model, parts).sum(&Body::volume, [&](const Body&, Index i) { return model.volume[i]; });
  for (const Body& part : parts) part.parts.front().volume = part.volume;
  follow_volumes(model, before);
  std::vector<double> change_of_area(model.position.size());
  bodies.for_each([&](const Body&, Index i) { change_of_area[i] = ease_area * found[i].area; });
  for (Load& load : model.loads) {
    if (load.on_surface) follow_areas(model, load, change_of_area);
  }
  for (const Body* body : bodies) warn_of(model, *body);
  return std::nullopt;
}

void close_gradients(Model& model) {
  std::vector<ClosedBody> closed;
  std::vector<Vec3d> areas;
  for (auto part = model.parts.begin(); part != model.parts.end();) {
    const auto next = part + static_cast<std::ptrdiff_t>(model.parts_of_body(*part).size());
    if (part->closure > 0 && part->begin < part->end) {
      model.with_lists();
      const auto begin = static_cast<std::size_t>(part->begin),
                 count = static_cast<std::size_t>((next - 1)->end) - begin;
      const std::span<const Vec3d> position = std::span(model.position).subspan(begin, count);
      const std::span<const double> support =
          std::span(model.neighbourhood.support).subspan(begin, count);
      const std::vector<Facet> facets = facets_of(model, *part);
      std::vector<Vec3d> centroids;
      for (const Facet& f : facets) centroids.push_back(f.centroid);
      const std::vector<Vec3d> of_body =
          areas_of_phyxels(facets, phyxels_near(centroids, position, support), position, support);
      areas.resize(model.position.size());
      std::copy(of_body.begin(), of_body.end(), areas.begin() + part->begin);
      closed.push_back({{part, next}, enclosed_by(facets).volume});
    }
    part = next;
  }
  if (const auto refusal = close_bodies(model, closed, std::move(areas))) {
    throw InputError(*refusal);
  }
}

}  // namespace phyxel
