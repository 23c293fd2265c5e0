#include "model/closure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "model/closing_areas.hpp"
#include "model/closing_loops.hpp"
#include "model/closing_search.hpp"
#include "model/loads.hpp"
#include "phyxel/error.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

using closing::Bodies;
using closing::Body;

/// The first phyxel of all ranks whose volume would have to change too far, and how far.
struct Excess {
  double phyxel = HUGE_VAL;  ///< Index in the whole model; infinite: none.
  double change = 0;         ///< Relative; infinite: it is no number.
};
/// @param change relative change of the volume of each phyxel
Excess first_excess(const Model& model, const Bodies& bodies, const std::vector<double>& change) {
  Excess first;
  for (const Body* body : bodies) {
    for (const Part& part : body->parts) {
      for (Index i = part.begin; i < part.owned_end(); ++i) {
        // Half is far beyond what closes clouds that are any good; NaN is none of these.
        const double found = change[i];
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
                const std::vector<double>& before, Closing& closing) {
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
    std::fill(closing.area.begin() + part.begin, closing.area.begin() + part.end, 0);
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

Closing search_on_host(const Model& model, const Bodies& bodies, const std::vector<Vec3d>& areas) {
  const closing::HostLoops loops(model);
  return closing::Search(loops, model, bodies, areas).run();
}

std::optional<std::string> close_bodies(Model& model, const std::vector<ClosedBody>& wanted,
                                        const std::vector<Vec3d>& areas,
                                        const ClosingSearch& search) {
  if (wanted.empty()) return std::nullopt;
  const Phase phase("closing gradients");
  const std::vector<double> before = model.volume;
  std::vector<Body> list, parts;
  for (const auto& [of_body, enclosed] : wanted) {
    const Body& body = list.emplace_back(of_body, of_body.front().closure);
    double volume = 0;
    for (const Part& part : of_body) volume += part.volume;
    for (Index i = body.begin(); i < body.end(); ++i) model.volume[i] *= enclosed / volume;
  }
  Bodies bodies(list);
  Closing closing = search(model, bodies, areas);
  for (;;) {
    const Excess excess = first_excess(model, bodies, closing.volume);
    if (!(excess.phyxel < HUGE_VAL)) break;
    const Unclosable open = unclosable(model, excess);
    if (!open.body->automatic_closure) {
      return fmt::format(
          "body \"{}\": gradients cannot be closed (closure = {:g}): {}; allowed are more phyxels "
          "where the body is thin, or closure = 0",
          open.body->name, open.body->closure, open.reason);
    }
    leave_open(model, bodies, open, before, closing);
  }
  if (bodies.empty()) return std::nullopt;
  const closing::HostLoops loops(model);
  model.closing.resize(model.volume.size());
  loops.for_each(bodies, [&](const closing::Standing&, Index i) {
    model.volume[i] *= 1 + closing.volume[i];
    model.closing[i] = closing.vector[i];
  });
  loops.refresh_ghosts(bodies, model.volume);
  loops.refresh_ghosts(bodies, model.closing);
  for (const Body* body : bodies) {
    for (Part& part : body->parts) parts.emplace_back(std::span(&part, 1), part.closure);
  }
  loops.sum(Bodies(parts), &closing::Standing::volume,
            [&](const closing::Standing&, Index i) { return model.volume[i]; });
  for (const Body& part : parts) part.parts.front().volume = part.volume;
  follow_volumes(model, before);
  for (Load& load : model.loads) {
    if (load.on_surface) follow_areas(model, load, closing.area);
  }
  for (const Body* body : bodies) warn_of(model, *body);
  return std::nullopt;
}

void close_gradients(Model& model, const ClosingSearch& search) {
  std::vector<ClosedBody> closed;
  std::vector<Vec3d> areas;
  for (auto part = model.parts.begin(); part != model.parts.end();) {
    const auto next = part + static_cast<std::ptrdiff_t>(model.parts_of_body(*part).size());
    if (part->closure > 0 && part->begin < part->end) {
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
  if (const auto refusal = close_bodies(model, closed, areas, search)) {
    throw InputError(*refusal);
  }
}

}  // namespace phyxel
