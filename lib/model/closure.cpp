#include "model/closure.hpp"

#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "model/closing_areas.hpp"
#include "model/owned_vectors.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/weight.hpp"
#include "rank_sums.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// How far areas and volumes may follow, beside the closing vectors: a relative change weighs as
/// much as a closing vector 1/ease times as large.
constexpr double ease_area = 0.3, ease_volume = 0.1;
/// After so many the sums are as closed as they get: 1,500 phyxels take 2,600 to 1e-10.
constexpr int most_iterations = 10'000;
/// Iterations that have to take a tenth of what is left.
constexpr int patience = 500;

/// What is sought, of each phyxel: the closing vector times v / s², and the relative changes of its
/// area and of its volume, over `ease_area` and `ease_volume`.
struct Unknown {
  Vec3d closing;
  double area = 0, volume = 0;
};
double dot(const Unknown& a, const Unknown& b) {
  return dot(a.closing, b.closing) + a.area * b.area + a.volume * b.volume;
}
void add(Unknown& to, double s, const Unknown& x) {
  to.closing += s * x.closing;
  to.area += s * x.area;
  to.volume += s * x.volume;
}

Sym3d symmetric_part(const Mat3d& m) {
  return {m(0, 0), 0.5 * (m(0, 1) + m(1, 0)), 0.5 * (m(0, 2) + m(2, 0)),
          m(1, 1), 0.5 * (m(1, 2) + m(2, 1)), m(2, 2)};
}

/// A body whose gradients are closed, and where its search stands.
struct Body {
  std::span<Part> parts;
  double tolerance = 0;
  double unit = 1, volume = 1;  ///< s² [m²] and the volume of all phyxels [m³].
  double areas = 0;             ///< Σ S², per s⁴.
  double residual_squared = 0, gradient_squared = 0, next_gradient_squared = 0, image_squared = 0;
  double sum = 0, mean = 0;  ///< Sum and mean of the changes of volumes.
  double left = 0;           ///< Root mean square of the sums over that of the areas.
  double left_first = 0, left_before = HUGE_VAL;
  int iterations = 0;

  Index begin() const { return parts.front().begin; }
  Index end() const { return parts.back().end; }
};

/// Bodies in the order of their phyxels, and the loops over them. Every rank has the same.
class Bodies {
 public:
  Bodies(const Model& model, std::span<Body> bodies) : model_(model) {
    for (Body& body : bodies) list_.push_back(&body);
  }
  bool empty() const { return list_.empty(); }
  auto begin() const { return list_.begin(); }
  auto end() const { return list_.end(); }
  /// Leaves out bodies for which done(body).
  template <class Done>
  void erase_if(Done&& done) {
    std::erase_if(list_, [&](Body* body) { return done(*body); });
  }

  /// Calls each(body, i) for the phyxels that are not ghosts.
  template <class Each>
  void for_each(Each&& each) const {
    on_threads(own_end, [&](const Stretch& stretch) {
      for (Index i = stretch.begin; i < stretch.end; ++i) each(*list_[stretch.body], i);
    });
  }
  template <class Each>
  void for_each_with_ghosts(Each&& each) const {
    on_threads([](const Part& part) { return part.end; }, [&](const Stretch& stretch) {
      for (Index i = stretch.begin; i < stretch.end; ++i) each(*list_[stretch.body], i);
    });
  }
  /// Sets a member of each body to Σ term(body, i) over its phyxels of all ranks, rounded once.
  /// Collective.
  template <class Term>
  void sum(double Body::*into, Term&& term) const {
    std::vector<ExactSum> sums(list_.size());
    on_threads(own_end, [&](const Stretch& stretch) {
      ExactSum own;
      for (Index i = stretch.begin; i < stretch.end; ++i) own.add(term(*list_[stretch.body], i));
#pragma omp critical(phyxel_closure_sum)
      sums[stretch.body].add(own);
    });
    if (model_.share) add_over_ranks(*model_.share->communicator, sums);
    for (std::size_t b = 0; b < list_.size(); ++b) list_[b]->*into = sums[b].value();
  }
  /// Copies the owners' values to the ghosts of all bodies from the first to the last. Collective.
  template <class T>
  void refresh_ghosts(std::vector<T>& values) const {
    if (!model_.share || empty()) return;
    phyxel::refresh_ghosts(*model_.share, values, list_.front()->begin(), list_.back()->end());
  }

 private:
  /// Phyxels [begin, end) of one part.
  struct Stretch {
    std::size_t body;
    Index begin, end;
  };
  static Index own_end(const Part& part) { return part.owned_end(); }
  /// Calls visit(stretch) on each thread for its share of the phyxels, so that many small bodies
  /// keep all threads busy.
  /// @param end end(part): the end of the phyxels to visit
  template <class End, class Visit>
  void on_threads(End&& end, Visit&& visit) const {
    std::int64_t size = 0;
    for (const Body* body : list_) {
      for (const Part& part : body->parts) size += end(part) - part.begin;
    }
#pragma omp parallel
    {
      const std::int64_t threads = omp_get_num_threads(), thread = omp_get_thread_num();
      const std::int64_t first = size * thread / threads, last = size * (thread + 1) / threads;
      std::int64_t at = 0;
      for (std::size_t b = 0; b < list_.size(); ++b) {
        for (const Part& part : list_[b]->parts) {
          const std::int64_t length = end(part) - part.begin;
          const std::int64_t from = std::max(first - at, std::int64_t{0}),
                             to = std::min(last - at, length);
          if (from < to) {
            visit({b, part.begin + static_cast<Index>(from), part.begin + static_cast<Index>(to)});
          }
          at += length;
        }
      }
    }
  }

  const Model& model_;
  std::vector<Body*> list_;
};

/// The sums of bodies, per s², as a linear function of the unknowns:
///   R_j = Σ_k w_jk (c_k (1 + a_k x_jk) - M_k x_jk (1 + σ_k)) - c_j Σ_k w_jk (1 - a_j x_jk)
///         - M_j b_j (1 + σ_j) - S_j (1 + y_j),   M = v A⁻¹, a = A⁻¹ b.
/// Of the changes σ only what leaves a body's volume as it is counts: by Σ x Sᵀ = V I, areas of
/// whole faces stay, too. Vectors have a value for each phyxel of the model, of which ranks hold
/// their shares.
class Sums {
 public:
  /// @param areas S of each phyxel of the model, those of ghosts undefined [m²]
  Sums(const Model& model, const Bodies& bodies, std::vector<Vec3d> areas)
      : model_(model),
        areas_(std::move(areas)),
        tilt_(areas_.size()),
        weight_(areas_.size()),
        placed_sum_(areas_.size()),
        term_(areas_.size()) {
    for (Body* body : bodies) {
      double volume = 0;
      Index size = 0;
      for (const Part& part : body->parts) {
        volume += part.volume;
        size += part.size;
      }
      const double spacing = std::cbrt(volume / size);
      body->unit = spacing * spacing;
#pragma omp parallel for schedule(static)
      for (Index i = body->begin(); i < body->end(); ++i) {
        tilt_[i] = model_.inverse_moment[i] * model_.moment_offset[i];
      }
    }
    bodies.sum(&Body::volume, [&](const Body&, Index i) { return model_.volume[i]; });
    bodies.for_each([&](const Body& body, Index i) {
      areas_[i] = areas_[i] / body.unit;
      double sum = 0;
      const double inverse = inverse_support_squared(i);
      for (const Index k : model_.neighbourhood.neighbours.row(i)) {
        const Vec3d x = model_.position[k] - model_.position[i];
        sum += weight_shape(dot(x, x), inverse);
      }
      weight_[i] = sum - dot(tilt_[i], model_.moment_offset[i]);
    });
    bodies.sum(&Body::areas, [&](const Body&, Index i) { return dot(areas_[i], areas_[i]); });
  }

  /// The sums without closing, as they are to be 0.
  std::vector<Vec3d> open(const Bodies& bodies) {
    std::vector<Vec3d> sums(areas_.size());
    const std::vector<Unknown> ones(areas_.size(), {{}, 1 / ease_area, 1 / ease_volume});
    for (Body* body : bodies) body->mean = 0;
    apply_local(bodies, ones, sums);
    return sums;
  }
  /// @param x its ghosts receive their owners' values
  void apply(const Bodies& bodies, std::vector<Unknown>& x, std::vector<Vec3d>& sums) {
    bodies.refresh_ghosts(x);
    find_means(bodies, x);
    apply_local(bodies, x, sums);
  }
  /// Sets the mean change of volume of each body, which takes no part [over `ease_volume`].
  void find_means(const Bodies& bodies, const std::vector<Unknown>& x) const {
    bodies.sum(&Body::mean, [&](const Body&, Index i) { return model_.volume[i] * x[i].volume; });
    for (Body* body : bodies) body->mean /= body->volume;
  }
  /// @param sums their ghosts receive their owners' values
  void apply_transpose(const Bodies& bodies, std::vector<Vec3d>& sums,
                       std::vector<Unknown>& x) {
    bodies.refresh_ghosts(sums);
    bodies.for_each_with_ghosts(
        [&](const Body&, Index i) { placed_sum_[i] = {model_.position[i], sums[i]}; });
    bodies.for_each([&](const Body& body, Index i) {
      Vec3d total;   // Σ w (R_k - R_i)
      Mat3d moment;  // Σ w (R_k - R_i) x_ikᵀ
      const PlacedSum own = placed_sum_[i];
      const double inverse = inverse_support_squared(i);
      for (const Index k : model_.neighbourhood.neighbours.row(i)) {
        const PlacedSum& other = placed_sum_[k];
        const Vec3d apart = other.position - own.position;
        const Vec3d weighted = weight_shape(dot(apart, apart), inverse) * (other.sum - own.sum);
        total += weighted;
        moment = fused_outer(weighted, apart, moment);
      }
      x[i] = {.closing = total - moment * tilt_[i],
              .area = -ease_area * dot(areas_[i], own.sum),
              .volume = ease_volume * (model_.volume[i] / body.unit) *
                        contract(symmetric_part(moment), model_.inverse_moment[i])};
    });
    bodies.sum(&Body::sum, [&](const Body&, Index i) { return x[i].volume; });
    bodies.for_each([&](const Body& body, Index i) {
      x[i].volume -= model_.volume[i] / body.volume * body.sum;
    });
  }

 private:
  void apply_local(const Bodies& bodies, const std::vector<Unknown>& x,
                   std::vector<Vec3d>& sums) {
    bodies.for_each_with_ghosts([&](const Body& body, Index k) {
      const double change = ease_volume * (x[k].volume - body.mean) * model_.volume[k] / body.unit;
      term_[k] = {model_.position[k], x[k].closing,
                  outer(x[k].closing, tilt_[k]) - change * full(model_.inverse_moment[k])};
    });
    bodies.for_each([&](const Body&, Index j) {
      const Term& own = term_[j];
      // A⁻¹ b = a: what the offset of the moments takes of M_j b_j.
      Vec3d sum = own.linear * model_.moment_offset[j] -
                  (weight_[j] + dot(tilt_[j], model_.moment_offset[j])) * x[j].closing -
                  ease_area * x[j].area * areas_[j];
      const double inverse = inverse_support_squared(j);
      for (const Index k : model_.neighbourhood.neighbours.row(j)) {
        const Term& other = term_[k];
        const Vec3d x_jk = other.position - own.position;
        sum += weight_shape(dot(x_jk, x_jk), inverse) * (other.constant + other.linear * x_jk);
      }
      sums[j] = sum;
    });
  }
  double inverse_support_squared(Index i) const {
    const double h = model_.neighbourhood.support[i];
    return 1 / (h * h);
  }

  const Model& model_;
  std::vector<Vec3d> areas_;    ///< S / s²
  std::vector<Vec3d> tilt_;     ///< a
  std::vector<double> weight_;  ///< Σ_k w_jk (1 - a_j x_jk)
  /// What a phyxel gives to the sums of its neighbours, each in one piece of memory.
  struct PlacedSum {
    Vec3d position, sum;
  };
  struct Term {
    Vec3d position, constant;
    Mat3d linear;
  };
  std::vector<PlacedSum> placed_sum_;
  std::vector<Term> term_;
};

/// Updates what is left of a body's sums.
/// @returns whether they are as closed as is asked or as they get
bool update_and_check(Body& body) {
  body.left = std::sqrt(body.residual_squared / body.areas);
  if (body.iterations == 0) body.left_first = body.left;
  if (!(body.left > body.tolerance) || !(body.gradient_squared > 0) ||
      body.iterations == most_iterations) {
    return true;
  }
  if (body.iterations % patience != 0) return false;
  const bool slow = !(body.left < 0.9 * body.left_before);
  body.left_before = body.left;
  return slow;
}

/// The share of the way to its tolerance that a body has come.
double way_of(const Body& body) {
  return std::log(body.left_first / body.left) / std::log(body.left_first / body.tolerance);
}

/// The smallest unknowns that close the sums: conjugate gradients for least squares (Björck 1996,
/// algorithm 7.4.1), of all bodies at once, each with its own steps. Smooth unknowns, which take
/// the most of them, matter the least: a few iterations do most of what can be done. What is left
/// of each body's sums is summed anew at the end.
std::vector<Unknown> close(Sums& sums, const Bodies& all) {
  Stage stage("closed gradients");
  const std::vector<Vec3d> open = sums.open(all);
  const std::size_t n = open.size();
  std::vector<Unknown> x(n), gradient(n), direction(n);
  std::vector<Vec3d> residual(n), image(n);
  const auto residual_squares = [&](const Body&, Index i) { return dot(residual[i], residual[i]); };
  const auto gradient_squares = [&](const Body&, Index i) { return dot(gradient[i], gradient[i]); };
  all.for_each([&](const Body&, Index i) { residual[i] = -open[i]; });
  all.sum(&Body::residual_squared, residual_squares);
  sums.apply_transpose(all, residual, gradient);
  all.sum(&Body::gradient_squared, gradient_squares);
  all.for_each([&](const Body&, Index i) { direction[i] = gradient[i]; });
  Bodies active = all;
  for (;;) {
    active.erase_if(update_and_check);
    if (active.empty()) break;
    double way = 1;
    for (const Body* body : active) way = std::min(way, way_of(*body));
    stage.reach(way);
    sums.apply(active, direction, image);
    active.sum(&Body::image_squared, [&](const Body&, Index i) { return dot(image[i], image[i]); });
    active.erase_if([](const Body& body) { return !(body.image_squared > 0); });
    active.for_each([&](const Body& body, Index i) {
      const double step = body.gradient_squared / body.image_squared;
      add(x[i], step, direction[i]);
      residual[i] -= step * image[i];
    });
    active.sum(&Body::residual_squared, residual_squares);
    sums.apply_transpose(active, residual, gradient);
    active.sum(&Body::next_gradient_squared, gradient_squares);
    active.for_each([&](const Body& body, Index i) {
      Unknown turned = gradient[i];
      add(turned, body.next_gradient_squared / body.gradient_squared, direction[i]);
      direction[i] = turned;
    });
    for (Body* body : active) {
      body->gradient_squared = body->next_gradient_squared;
      ++body->iterations;
    }
  }
  sums.apply(all, x, image);
  all.for_each([&](const Body&, Index i) { image[i] += open[i]; });
  all.sum(&Body::residual_squared, [&](const Body&, Index i) { return dot(image[i], image[i]); });
  for (Body* body : all) body->left = std::sqrt(body->residual_squared / body->areas);
  stage.finish();
  return x;
}

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
  return {body, fmt::format("phyxel {} would have to change its volume {}", excess.phyxel - first,
                            std::isfinite(excess.change)
                                ? fmt::format("by {:.0f}%", 100 * excess.change)
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
  return facets_of(position, model.surfels.triangles_of(part), part.surfel_begin,
                   longest_edge(model.neighbourhood.support[part.begin]));
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
  const std::vector<Unknown> found = close(sums, bodies);
  sums.find_means(bodies, found);
  const auto change = [&](const Body& body, Index i) {
    return ease_volume * (found[i].volume - body.mean);
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
    model.closing[i] = (body.unit / model.volume[i]) * found[i].closing;
  });
  bodies.refresh_ghosts(model.volume);
  bodies.refresh_ghosts(model.closing);
  for (const Body* body : bodies) {
    for (Part& part : body->parts) parts.push_back({.parts = {&part, 1}});
  }
  Bodies(model, parts).sum(&Body::volume, [&](const Body&, Index i) { return model.volume[i]; });
  for (const Body& part : parts) part.parts.front().volume = part.volume;
  follow_volumes(model, before);
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
