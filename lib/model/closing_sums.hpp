/// The sums that closed gradients have to satisfy.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "model/closing_bodies.hpp"
#include "model/closing_gathers.hpp"
#include "phyxel/model.hpp"

/// Marks functions that `Loops` call, which may be those of a device.
#if defined(__CUDACC__)
#define PHYXEL_LOOPED __device__
#else
#define PHYXEL_LOOPED
#endif

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
PHYXEL_HD double dot(const Unknown& a, const Unknown& b) {
  return dot(a.closing, b.closing) + a.area * b.area + a.volume * b.volume;
}
PHYXEL_HD void add(Unknown& to, double s, const Unknown& x) {
  to.closing += s * x.closing;
  to.area += s * x.area;
  to.volume += s * x.volume;
}

PHYXEL_HD Sym3d symmetric_part(const Mat3d& m) {
  return {m(0, 0), 0.5 * (m(0, 1) + m(1, 0)), 0.5 * (m(0, 2) + m(2, 0)),
          m(1, 1), 0.5 * (m(1, 2) + m(2, 1)), m(2, 2)};
}

/// The part of a phyxel in the search.
enum class Role : char {
  none,
  beside,    ///< It is a neighbour of a `changed` one, whose sum reads its record.
  changed,   ///< It is a neighbour of one with unknowns, which change its sum.
  sought,    ///< It has unknowns, since it is supported and beside an irregular one.
  irregular  ///< It has unknowns, since its sum is to change.
};

/// What the sums of phyxels are made of, and their terms, phyxel by phyxel. Arrays have a value for
/// each phyxel of the model.
struct SumTerms : Neighbourhoods {
  const double* volume;   ///< [m³]
  const char* supported;  ///< `supported_phyxels`.
  Vec3d* areas;           ///< S / (s² ρ²)
  Vec3d* tilt;            ///< a
  double* weight;         ///< Σ_k w_jk (1 - a_j x_jk)
  double* relative_size;  ///< ρ
  Role* role;
  Gathers gathers;  ///< What phyxels give to the sums of their neighbours.

  PHYXEL_HD Row row(Index i) const {
    return {neighbours + offsets[i], neighbours + offsets[i + 1]};
  }
  PHYXEL_HD RowWeights weights_of(const Standing& body, Index i) const {
    return {support, i, body.pair_length};
  }
  /// True if phyxel i has unknowns; those of the others are 0.
  PHYXEL_HD bool is_sought(Index i) const { return role[i] >= Role::sought; }
  /// True if unknowns change the sum of phyxel i.
  PHYXEL_HD bool is_changed(Index i) const { return role[i] >= Role::changed; }
  /// A sum of phyxel j over ρ².
  PHYXEL_HD Vec3d per_size(Index j, Vec3d sum) const {
    const double size = relative_size[j];
    return sum / (size * size);
  }

  /// Sets a phyxel's values that do not change, but for its area.
  PHYXEL_HD void set_up(const Standing& body, Index i) const {
    tilt[i] = inverse_moment[i] * moment_offset[i];
    const double length = body.pair_length;
    relative_size[i] = length > 0 ? support[i] / length : 1;
  }
  /// Sets the area and the weight of an own phyxel. @param area S [m²]
  PHYXEL_HD void set_weight(const Standing& body, Index i, Vec3d area) const {
    const double size = relative_size[i];
    areas[i] = supported[i] ? Vec3d{} : area / (body.unit * size * size);
    double sum = 0;
    const RowWeights weights = weights_of(body, i);
    for (const Index k : row(i)) {
      const Vec3d x = position[k] - position[i];
      sum += weights(k, dot(x, x));
    }
    weight[i] = sum - dot(tilt[i], moment_offset[i]);
  }

  /// The relative change of the volume of phyxel i, once means are found; 0 without unknowns.
  PHYXEL_HD double change_of_volume(const Standing& body, Index i, const Unknown& x) const {
    return ease_volume * (x.volume - (is_sought(i) ? body.mean : 0));
  }
  /// The closing vector ĉ that the unknowns of phyxel i mean [1/m]. @param of_volume [m³]
  PHYXEL_HD Vec3d closing_vector(const Standing& body, Index i, const Unknown& x,
                                 double of_volume) const {
    return (body.unit / of_volume * relative_size[i]) * x.closing;
  }

  /// Sets the terms that phyxel k gives to the sums of its neighbours.
  PHYXEL_HD void set_term(const Standing& body, Index k, const Unknown& x) const {
    const double change = change_of_volume(body, k, x) * volume[k] / body.unit;
    const Vec3d closing = relative_size[k] * x.closing;
    gathers.set_term(k, position[k], closing,
                     outer(closing, tilt[k]) - change * full(inverse_moment[k]));
  }
  /// The sum R_j, once terms are set. @param x unknowns of j
  template <class Loops>
  PHYXEL_HD Vec3d sum_at(const Standing& body, Index j, const Unknown& x) const {
    if (supported[j]) return {};
    const double size = relative_size[j];
    // A⁻¹ b = a: what the offset of the moments takes of M_j b_j.
    const Vec3d own = gathers.linear(j) * moment_offset[j] -
                      (weight[j] + dot(tilt[j], moment_offset[j])) * (size * x.closing) -
                      ease_area * x.area * (size * size * areas[j]);
    return per_size(j, Loops::terms(gathers, j, row(j), weights_of(body, j), own));
  }
  /// The transpose of the sums at phyxel i, but for the mean change of volumes.
  /// @param sum of phyxel i
  template <class Loops>
  PHYXEL_HD Unknown transposed_at(const Standing& body, Index i, Vec3d sum) const {
    const Differences d = Loops::differences(gathers, i, row(i), weights_of(body, i));
    return {.closing = relative_size[i] * (d.total - d.moment * tilt[i]),
            .area = -ease_area * dot(areas[i], sum),
            .volume = ease_volume * (volume[i] / body.unit) *
                      contract(symmetric_part(d.moment), inverse_moment[i])};
  }
};

/// The sums of bodies, per s² ρ², as a linear function of the unknowns:
///   R_j = Σ_k w_jk (c_k (1 + a_k x_jk) - M_k x_jk (1 + σ_k)) - c_j Σ_k w_jk (1 - a_j x_jk)
///         - M_j b_j (1 + σ_j) - S_j (1 + y_j),   M = v A⁻¹, a = A⁻¹ b.
/// R_j is the force of a uniform stress on phyxel j, which does nothing where j is supported: there
/// it may be anything, and counts as 0. Of the changes σ only what leaves a body's volume as it is
/// counts: by Σ x Sᵀ = V I, areas of whole faces stay, too. Vectors have a value for each phyxel of
/// the model, of which ranks hold their shares.
///
/// `Loops` run on the host or on a device (closing_loops.hpp). All functions with loops are public,
/// as compilers for devices ask.
template <class Loops>
class Sums {
 public:
  template <class T>
  using Vector = typename Loops::template Vector<T>;

  /// @param areas S of each phyxel of the model, those of ghosts undefined [m²]
  Sums(const Loops& loops, const Model& model, const Bodies& bodies,
       const std::vector<Vec3d>& areas)
      : loops_(loops),
        volume_(loops.input(model.volume)),
        supported_(loops.vector(supported_phyxels(model))),
        areas_(loops.vector(areas)),
        tilt_(loops.template make<Vec3d>()),
        weight_(loops.template make<double>()),
        relative_size_(loops.template make<double>()),
        role_(loops.template make<Role>()),
        records_(loops.template make<double>(Gathers::term_size, Gathers::line)),
        terms_{loops.neighbourhoods(), volume_.data(), supported_.data(),
               areas_.data(),          tilt_.data(),   weight_.data(),
               relative_size_.data(),  role_.data(),   Gathers(records_.data())} {
    set_up(bodies);
  }
  Sums(const Sums&) = delete;
  Sums& operator=(const Sums&) = delete;

  const SumTerms& terms() const { return terms_; }

  void set_up(const Bodies& bodies) {
    for (Body* body : bodies) {
      double volume = 0;
      Index size = 0;
      for (const Part& part : body->parts) {
        volume += part.volume;
        size += part.size;
      }
      const double spacing = std::cbrt(volume / size);
      body->unit = spacing * spacing;
      body->pair_length = body->parts.front().pair_length;
    }
    const SumTerms terms = terms_;
    loops_.for_each_with_ghosts(bodies, [=] PHYXEL_LOOPED(const Standing& body, Index i) {
      terms.set_up(body, i);
      terms.role[i] = Role::sought;
    });
    loops_.sum(bodies, &Standing::volume,
               [=] PHYXEL_LOOPED(const Standing&, Index i) -> double { return terms.volume[i]; });
    loops_.sum(bodies, &Standing::areas,
               [=] PHYXEL_LOOPED(const Standing& body, Index i) -> double {
                 terms.set_weight(body, i, terms.areas[i]);
                 return dot(terms.areas[i], terms.areas[i]);
               });
  }

  /// Sets `residual` to -1 times the sum of each phyxel without closing, as it is to be 0, or adds
  /// that to what it is.
  void open(const Bodies& bodies, Vec3d* residual, bool adds) {
    for (Body* body : bodies) body->mean = 0;
    const Unknown ones{{}, 1 / ease_area, 1 / ease_volume};
    const SumTerms terms = terms_;
    loops_.for_each_with_ghosts(bodies, [=] PHYXEL_LOOPED(const Standing& body, Index k) {
      terms.set_term(body, k, ones);
    });
    loops_.for_each(bodies, [=] PHYXEL_LOOPED(const Standing& body, Index j) {
      const Vec3d sum = terms.template sum_at<Loops>(body, j, ones);
      residual[j] = adds ? residual[j] - sum : -sum;
    });
  }

  /// Limits the unknowns to where sums are to change: the rest is a regular lattice.
  /// Collective.
  /// @param sums of all phyxels but ghosts
  void limit_to_irregular(const Bodies& bodies, const Vec3d* sums) {
    const SumTerms terms = terms_;
    loops_.for_each(bodies, [=] PHYXEL_LOOPED(const Standing& body, Index i) {
      const double least = regular * body.tolerance;
      terms.role[i] = dot(sums[i], sums[i]) > least * least ? Role::irregular : Role::none;
    });
    loops_.refresh_ghosts(bodies, role_);
    Vector<Role> next_role = loops_.template make<Role>();
    Role* const next = next_role.data();
    for (const Role role : {Role::sought, Role::changed, Role::beside}) {
      loops_.for_each(bodies, [=] PHYXEL_LOOPED(const Standing&, Index i) {
        next[i] = terms.role[i];
        // Sums of supported phyxels may be anything, but their unknowns change those beside.
        if (next[i] != Role::none || (role == Role::sought && !terms.supported[i])) return;
        for (const Index k : terms.row(i)) {
          if (terms.role[k] <= role) continue;
          next[i] = role;
          return;
        }
      });
      loops_.for_each(bodies,
                      [=] PHYXEL_LOOPED(const Standing&, Index i) { terms.role[i] = next[i]; });
      loops_.refresh_ghosts(bodies, role_);
    }
    loops_.sum(bodies, &Standing::sought_volume,
               [=] PHYXEL_LOOPED(const Standing&, Index i) -> double {
                 return terms.is_sought(i) ? terms.volume[i] : 0;
               });
    for (Body* body : bodies) body->is_limited = body->sought_volume < body->volume;
  }
  /// Gives all phyxels of bodies unknowns.
  /// @param x the unknowns so far, which are rewritten to mean the same changes of volumes
  void widen(const Bodies& bodies, Unknown* x) {
    const SumTerms terms = terms_;
    loops_.for_each_with_ghosts(bodies, [=] PHYXEL_LOOPED(const Standing& body, Index i) {
      if (terms.is_sought(i)) x[i].volume -= body.mean;
      terms.role[i] = Role::sought;
    });
    for (Body* body : bodies) {
      body->mean = 0;
      body->sought_volume = body->volume;
      body->is_limited = false;
      body->left_before = HUGE_VAL;  // the search starts anew
    }
  }

  /// Sets `image` to the sums that unknowns add, of the phyxels whose sums they change, and a
  /// member of each body to the square of `image`. Collective.
  /// @param x its ghosts receive their owners' values
  /// @param image image(i): where to put the sum of phyxel i
  template <class Image>
  void apply(const Bodies& bodies, Vector<Unknown>& x, double Standing::*square, Image&& image) {
    loops_.refresh_ghosts(bodies, x);
    find_means(bodies, x.data());
    const SumTerms terms = terms_;
    const Unknown* const unknowns = x.data();
    loops_.for_each_with_ghosts(bodies, [=] PHYXEL_LOOPED(const Standing& body, Index k) {
      if (terms.role[k] >= Role::beside) terms.set_term(body, k, unknowns[k]);
    });
    loops_.sum(bodies, square, [=] PHYXEL_LOOPED(const Standing& body, Index j) -> double {
      if (!terms.is_changed(j)) return 0;
      const Vec3d sum = terms.template sum_at<Loops>(body, j, unknowns[j]);
      image.put(j, sum);
      return dot(sum, sum);
    });
  }
  /// Sets the mean change of volume of each body, which takes no part [over `ease_volume`].
  void find_means(const Bodies& bodies, const Unknown* x) {
    const SumTerms terms = terms_;
    loops_.sum(bodies, &Standing::mean, [=] PHYXEL_LOOPED(const Standing&, Index i) -> double {
      return terms.volume[i] * x[i].volume;
    });
    for (Body* body : bodies) {
      if (body->sought_volume > 0) body->mean /= body->sought_volume;
    }
  }
  /// Sets x to the transpose of `apply` times `sums`, and a member of each body to the square of x.
  /// Collective.
  /// @param sums their ghosts receive their owners' values
  void apply_transpose(const Bodies& bodies, Vector<Vec3d>& sums, Unknown* x,
                       double Standing::*square) {
    loops_.refresh_ghosts(bodies, sums);
    const SumTerms terms = terms_;
    const Vec3d* const values = sums.data();
    loops_.for_each_with_ghosts(bodies, [=] PHYXEL_LOOPED(const Standing&, Index i) {
      if (terms.is_changed(i)) {
        terms.gathers.set_value(i, terms.position[i], terms.per_size(i, values[i]));
      }
    });
    loops_.sum(bodies, &Standing::sum, [=] PHYXEL_LOOPED(const Standing& body, Index i) -> double {
      if (!terms.is_sought(i)) return 0;
      x[i] = terms.template transposed_at<Loops>(body, i, values[i]);
      return x[i].volume;
    });
    loops_.sum(bodies, square, [=] PHYXEL_LOOPED(const Standing& body, Index i) -> double {
      if (!terms.is_sought(i)) return 0;
      x[i].volume -= terms.volume[i] / body.sought_volume * body.sum;
      return dot(x[i], x[i]);
    });
  }

 private:
  /// A sum counts as that of a regular lattice if it is below this much of the tolerance.
  static constexpr double regular = 0.1;

  const Loops& loops_;
  typename Loops::template Input<double> volume_;
  Vector<char> supported_;
  Vector<Vec3d> areas_, tilt_;
  Vector<double> weight_, relative_size_;
  Vector<Role> role_;
  Vector<double> records_;
  SumTerms terms_;
};

}  // namespace phyxel::closing
