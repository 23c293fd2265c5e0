/// The sums that closed gradients have to satisfy, and the bodies that they are of.
#pragma once

#include <omp.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "exact_sum.hpp"
#include "model/closing_gathers.hpp"
#include "model/owned_vectors.hpp"
#include "phyxel/model.hpp"
#include "rank_sums.hpp"

namespace phyxel::closing {

/// How far areas and volumes may follow, beside the closing vectors: a relative change weighs as
/// much as a closing vector 1/ease times as large.
inline constexpr double ease_area = 0.3, ease_volume = 0.1;

/// What is sought, of each phyxel: the closing vector times v / (s² ρ), and the relative changes of
/// its area and of its volume, over `ease_area` and `ease_volume`. ρ is the phyxel's support over
/// that of its body, 1 unless supports differ: then numbers do not depend on the size of a phyxel.
struct Unknown {
  Vec3d closing;
  double area = 0, volume = 0;
};
inline double dot(const Unknown& a, const Unknown& b) {
  return dot(a.closing, b.closing) + a.area * b.area + a.volume * b.volume;
}
inline void add(Unknown& to, double s, const Unknown& x) {
  to.closing += s * x.closing;
  to.area += s * x.area;
  to.volume += s * x.volume;
}

inline Sym3d symmetric_part(const Mat3d& m) {
  return {m(0, 0), 0.5 * (m(0, 1) + m(1, 0)), 0.5 * (m(0, 2) + m(2, 0)),
          m(1, 1), 0.5 * (m(1, 2) + m(2, 1)), m(2, 2)};
}

/// A body whose gradients are closed, and where its search stands.
struct Body {
  std::span<Part> parts;
  double tolerance = 0;
  double unit = 1, volume = 1;  ///< s² [m²] and the volume of all phyxels [m³].
  double areas = 0;             ///< Σ S², per s⁴ ρ⁴.
  double residual_squared = 0, gradient_squared = 0, next_gradient_squared = 0, image_squared = 0;
  double sum = 0, mean = 0;  ///< Sum and mean of the changes of volumes.
  double sought_volume = 0;  ///< Volume of the phyxels that have unknowns [m³].
  bool is_limited = false;   ///< True if some phyxels have none.
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
    on_threads([](const Part& part) { return part.end; },
               [&](const Stretch& stretch) {
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
    add_over_ranks(model_, sums);
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

/// The sums of bodies, per s² ρ², as a linear function of the unknowns:
///   R_j = Σ_k w_jk (c_k (1 + a_k x_jk) - M_k x_jk (1 + σ_k)) - c_j Σ_k w_jk (1 - a_j x_jk)
///         - M_j b_j (1 + σ_j) - S_j (1 + y_j),   M = v A⁻¹, a = A⁻¹ b.
/// R_j is the force of a uniform stress on phyxel j, which does nothing where j is supported: there
/// it may be anything, and counts as 0. Of the changes σ only what leaves a body's volume as it is
/// counts: by Σ x Sᵀ = V I, areas of whole faces stay, too. Vectors have a value for each phyxel of
/// the model, of which ranks hold their shares.
class Sums {
 public:
  /// @param areas S of each phyxel of the model, those of ghosts undefined [m²]
  Sums(const Model& model, const Bodies& bodies, std::vector<Vec3d> areas)
      : model_(model),
        areas_(std::move(areas)),
        tilt_(areas_.size()),
        weight_(areas_.size()),
        relative_size_(areas_.size(), 1),
        role_(areas_.size(), Role::sought),
        gathers_(areas_.size()),
        supported_(supported_phyxels(model)) {
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
        const double length = body->parts.front().pair_length;
        if (length > 0) relative_size_[i] = model_.neighbourhood.support[i] / length;
      }
    }
    bodies.sum(&Body::volume, [&](const Body&, Index i) { return model_.volume[i]; });
    bodies.for_each([&](const Body& body, Index i) {
      const double size = relative_size_[i];
      areas_[i] = supported_[i] ? Vec3d{} : areas_[i] / (body.unit * size * size);
      double sum = 0;
      const RowWeights weights = weights_of(body, i);
      for (const Index k : model_.neighbourhood.neighbours.row(i)) {
        const Vec3d x = model_.position[k] - model_.position[i];
        sum += weights(k, dot(x, x));
      }
      weight_[i] = sum - dot(tilt_[i], model_.moment_offset[i]);
    });
    bodies.sum(&Body::areas, [&](const Body&, Index i) { return dot(areas_[i], areas_[i]); });
  }

  /// Calls take(i, sum) for the sum of each phyxel without closing, as it is to be 0, on many
  /// threads.
  template <class Take>
  void open(const Bodies& bodies, Take&& take) {
    for (Body* body : bodies) body->mean = 0;
    const Unknown ones{{}, 1 / ease_area, 1 / ease_volume};
    set_terms(bodies, Role::none, [&](Index) { return ones; });
    bodies.for_each([&](const Body& body, Index j) { take(j, sum_at(body, j, ones)); });
  }
  /// Limits the unknowns to where sums are to change: the rest is a regular lattice.
  /// Collective.
  /// @param sums of all phyxels but ghosts
  void limit_to_irregular(const Bodies& bodies, const std::vector<Vec3d>& sums) {
    bodies.for_each([&](const Body& body, Index i) {
      const double least = regular * body.tolerance;
      role_[i] = dot(sums[i], sums[i]) > least * least ? Role::irregular : Role::none;
    });
    bodies.refresh_ghosts(role_);
    std::vector<Role> next = role_;
    for (const Role role : {Role::sought, Role::changed, Role::beside}) {
      bodies.for_each([&](const Body&, Index i) {
        // Sums of supported phyxels may be anything, but their unknowns change those beside.
        if (role_[i] != Role::none || (role == Role::sought && !supported_[i])) return;
        const auto is_inner = [&](Index k) { return role_[k] > role; };
        if (std::ranges::any_of(model_.neighbourhood.neighbours.row(i), is_inner)) next[i] = role;
      });
      bodies.refresh_ghosts(next);
      role_ = next;
    }
    bodies.sum(&Body::sought_volume,
               [&](const Body&, Index i) { return is_sought(i) ? model_.volume[i] : 0; });
    for (Body* body : bodies) body->is_limited = body->sought_volume < body->volume;
  }
  /// Gives all phyxels of bodies unknowns.
  /// @param x the unknowns so far, which are rewritten to mean the same changes of volumes
  void widen(const Bodies& bodies, std::vector<Unknown>& x) {
    bodies.for_each_with_ghosts([&](const Body& body, Index i) {
      if (is_sought(i)) x[i].volume -= body.mean;
      role_[i] = Role::sought;
    });
    for (Body* body : bodies) {
      body->mean = 0;
      body->sought_volume = body->volume;
      body->is_limited = false;
      body->left_before = HUGE_VAL;  // the search starts anew
    }
  }
  /// True if phyxel i has unknowns; those of the others are 0.
  bool is_sought(Index i) const { return role_[i] >= Role::sought; }
  /// True if unknowns change the sum of phyxel i.
  bool is_changed(Index i) const { return role_[i] >= Role::changed; }

  /// Sets a member of each body to Σ take(i, sum), which is given the sum of each phyxel that
  /// unknowns change, on many threads. Collective.
  /// @param x its ghosts receive their owners' values
  template <class Take>
  void apply(const Bodies& bodies, std::vector<Unknown>& x, double Body::*into, Take&& take) {
    bodies.refresh_ghosts(x);
    find_means(bodies, x);
    set_terms(bodies, Role::beside, [&](Index k) { return x[k]; });
    bodies.sum(into, [&](const Body& body, Index j) {
      return is_changed(j) ? take(j, sum_at(body, j, x[j])) : 0;
    });
  }
  /// Sets the mean change of volume of each body, which takes no part [over `ease_volume`].
  void find_means(const Bodies& bodies, const std::vector<Unknown>& x) const {
    bodies.sum(&Body::mean, [&](const Body&, Index i) { return model_.volume[i] * x[i].volume; });
    for (Body* body : bodies) {
      if (body->sought_volume > 0) body->mean /= body->sought_volume;
    }
  }
  /// The relative change of the volume of phyxel i, once means are found; 0 without unknowns.
  double change_of_volume(const Body& body, Index i, const Unknown& x) const {
    return ease_volume * (x.volume - (is_sought(i) ? body.mean : 0));
  }
  /// The closing vector ĉ that the unknowns of phyxel i mean [1/m].
  Vec3d closing_vector(const Body& body, Index i, const Unknown& x) const {
    return (body.unit / model_.volume[i] * relative_size_[i]) * x.closing;
  }
  /// Sets x to the transpose of `apply` times `sums`, and a member of each body to the square of x.
  /// Collective.
  /// @param sums their ghosts receive their owners' values
  void apply_transpose(const Bodies& bodies, std::vector<Vec3d>& sums, std::vector<Unknown>& x,
                       double Body::*square) {
    bodies.refresh_ghosts(sums);
    bodies.for_each_with_ghosts([&](const Body&, Index i) {
      if (is_changed(i)) gathers_.set_value(i, model_.position[i], per_size(i, sums[i]));
    });
    bodies.sum(&Body::sum, [&](const Body& body, Index i) {
      if (!is_sought(i)) return 0.0;
      const auto [total, moment] =
          gathers_.differences(i, model_.neighbourhood.neighbours.row(i), weights_of(body, i));
      x[i] = {.closing = relative_size_[i] * (total - moment * tilt_[i]),
              .area = -ease_area * dot(areas_[i], sums[i]),
              .volume = ease_volume * (model_.volume[i] / body.unit) *
                        contract(symmetric_part(moment), model_.inverse_moment[i])};
      return x[i].volume;
    });
    bodies.sum(square, [&](const Body& body, Index i) {
      if (!is_sought(i)) return 0.0;
      x[i].volume -= model_.volume[i] / body.sought_volume * body.sum;
      return dot(x[i], x[i]);
    });
  }

 private:
  /// The part of a phyxel in the search.
  enum class Role : char {
    none,
    beside,    ///< It is a neighbour of a `changed` one, whose sum reads its record.
    changed,   ///< It is a neighbour of one with unknowns, which change its sum.
    sought,    ///< It has unknowns, since it is supported and beside an irregular one.
    irregular  ///< It has unknowns, since its sum is to change.
  };
  /// A sum counts as that of a regular lattice if it is below this much of the tolerance.
  static constexpr double regular = 0.1;

  /// Sets the terms that phyxels give to the sums of their neighbours. @param x x(k): unknowns
  /// @param least role of the phyxels
  template <class X>
  void set_terms(const Bodies& bodies, Role least, X&& x) {
    bodies.for_each_with_ghosts([&](const Body& body, Index k) {
      if (role_[k] < least) return;
      const Unknown of_k = x(k);
      const double change = change_of_volume(body, k, of_k) * model_.volume[k] / body.unit;
      const Vec3d closing = relative_size_[k] * of_k.closing;
      gathers_.set_term(k, model_.position[k], closing,
                        outer(closing, tilt_[k]) - change * full(model_.inverse_moment[k]));
    });
  }
  /// The sum R_j, once terms are set. @param x unknowns of j
  Vec3d sum_at(const Body& body, Index j, const Unknown& x) const {
    if (supported_[j]) return {};
    const double size = relative_size_[j];
    // A⁻¹ b = a: what the offset of the moments takes of M_j b_j.
    const Vec3d own = gathers_.linear(j) * model_.moment_offset[j] -
                      (weight_[j] + dot(tilt_[j], model_.moment_offset[j])) * (size * x.closing) -
                      ease_area * x.area * (size * size * areas_[j]);
    return per_size(
        j, gathers_.terms(j, model_.neighbourhood.neighbours.row(j), weights_of(body, j), own));
  }
  /// A sum of phyxel j over ρ².
  Vec3d per_size(Index j, Vec3d sum) const {
    const double size = relative_size_[j];
    return sum / (size * size);
  }
  RowWeights weights_of(const Body& body, Index i) const {
    return {model_.neighbourhood.support.data(), i, body.parts.front().pair_length};
  }

  const Model& model_;
  std::vector<Vec3d> areas_;           ///< S / (s² ρ²)
  std::vector<Vec3d> tilt_;            ///< a
  std::vector<double> weight_;         ///< Σ_k w_jk (1 - a_j x_jk)
  std::vector<double> relative_size_;  ///< ρ
  std::vector<Role> role_;             ///< The role of each phyxel.
  Gathers gathers_;                    ///< What phyxels give to the sums of their neighbours.
  std::vector<char> supported_;        ///< `supported_phyxels`.
};

}  // namespace phyxel::closing
