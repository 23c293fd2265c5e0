#include "model/closure.hpp"

#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "exact_sum.hpp"
#include "model/closing_areas.hpp"
#include "model/owned_vectors.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/weight.hpp"
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
/// area and of its volume, over `ease_area` and
/// `ease_volume`.
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

/// A value of each phyxel of a body.
template <class T>
class BodyVector {
 public:
  explicit BodyVector(const OwnedVectors& own, const T& value = {})
      : BodyVector(own, std::vector<T>(static_cast<std::size_t>(own.end() - own.begin()), value)) {}
  BodyVector(const OwnedVectors& own, std::vector<T> values)
      : begin_(own.begin()), values_(std::move(values)) {}

  /// The value of phyxel i of the model.
  T& operator[](Index i) { return values_[static_cast<std::size_t>(i - begin_)]; }
  const T& operator[](Index i) const { return values_[static_cast<std::size_t>(i - begin_)]; }
  std::span<T> all() { return values_; }

 private:
  Index begin_;
  std::vector<T> values_;
};
using Unknowns = BodyVector<Unknown>;
using Vectors = BodyVector<Vec3d>;

/// The sums of one body, per s², as a linear function of the unknowns:
///   R_j = Σ_k w_jk (c_k (1 + a_k x_jk) - M_k x_jk (1 + σ_k)) - c_j Σ_k w_jk (1 - a_j x_jk)
///         - M_j b_j (1 + σ_j) - S_j (1 + y_j),   M = v A⁻¹, a = A⁻¹ b.
/// Of the changes σ only what leaves the whole volume as it is counts: by Σ x Sᵀ = V I, areas of
/// whole faces stay, too. Ranks hold their shares of all vectors.
class Sums {
 public:
  /// @param areas S of each phyxel of the body, those of ghosts undefined [m²]
  Sums(const Model& model, std::span<const Part> parts, std::vector<Vec3d> areas)
      : model_(model),
        own_(model, parts, omp_get_max_threads()),
        areas_(own_, std::move(areas)),
        tilt_(own_),
        weight_(own_) {
    double volume = 0;
    Index size = 0;
    for (const Part& part : parts) {
      volume += part.volume;
      size += part.size;
    }
    const double spacing = std::cbrt(volume / size);
    unit_ = spacing * spacing;
    whole_ = own_.sum([&](Index i) { return model_.volume[i]; });
    own_.for_each([&](Index i) { areas_[i] = areas_[i] / unit_; });
#pragma omp parallel for schedule(static)
    for (Index i = own_.begin(); i < own_.end(); ++i) {
      tilt_[i] = model_.inverse_moment[i] * model_.moment_offset[i];
    }
    own_.for_each([&](Index i) {
      double sum = 0;
      visit(i, [&](Index, Vec3d, double w) { sum += w; });
      weight_[i] = sum - dot(tilt_[i], model_.moment_offset[i]);
    });
  }
  double unit() const { return unit_; }
  const OwnedVectors& own() const { return own_; }
  const Vectors& areas() const { return areas_; }

  /// The sums without closing, as they are to be 0.
  Vectors open() const {
    Vectors sums(own_);
    const Unknowns ones(own_, {{}, 1 / ease_area, 1 / ease_volume});
    apply(ones, 0, sums);
    return sums;
  }
  /// @param x its ghosts receive their owners' values
  void apply(Unknowns& x, Vectors& sums) const {
    own_.refresh_ghosts(x.all());
    apply(x, mean_volume(x), sums);
  }
  /// The change of all volumes that takes no part [over `ease_volume`].
  double mean_volume(const Unknowns& x) const {
    return own_.sum([&](Index i) { return model_.volume[i] * x[i].volume; }) / whole_;
  }
  /// @param sums their ghosts receive their owners' values
  void apply_transpose(Vectors& sums, Unknowns& x) const {
    own_.refresh_ghosts(sums.all());
    own_.for_each([&](Index i) {
      Unknown out;
      visit(i, [&](Index k, Vec3d x_ik, double w) {
        const Vec3d difference = sums[k] - sums[i];
        out.closing += (w * (1 - dot(tilt_[i], x_ik))) * difference;
        out.volume += w * dot(own_share(i, x_ik), difference);
      });
      out.volume *= ease_volume;
      out.area = -ease_area * dot(areas_[i], sums[i]);
      x[i] = out;
    });
    const double all = own_.sum([&](Index i) { return x[i].volume; });
    own_.for_each([&](Index i) { x[i].volume -= model_.volume[i] / whole_ * all; });
  }

 private:
  void apply(const Unknowns& x, double mean, Vectors& sums) const {
    own_.for_each([&](Index j) {
      Vec3d sum = -weight_[j] * x[j].closing - ease_area * x[j].area * areas_[j] -
                  ease_volume * (x[j].volume - mean) * own_share(j, model_.moment_offset[j]);
      visit(j, [&](Index k, Vec3d x_jk, double w) {
        sum += w * ((1 + dot(tilt_[k], x_jk)) * x[k].closing -
                    (ease_volume * (x[k].volume - mean)) * own_share(k, x_jk));
      });
      sums[j] = sum;
    });
  }
  template <class Visit>
  void visit(Index i, Visit&& visit) const {
    const double h = model_.neighbourhood.support[i];
    for (const Index k : model_.neighbourhood.neighbours.row(i)) {
      const Vec3d x = model_.position[k] - model_.position[i];
      visit(k, x, weight_shape(dot(x, x), 1 / (h * h)));
    }
  }
  /// M_i x per s².
  Vec3d own_share(Index i, Vec3d x) const {
    return (model_.volume[i] / unit_) * (model_.inverse_moment[i] * x);
  }

  const Model& model_;
  OwnedVectors own_;
  Vectors areas_;                ///< S / s²
  Vectors tilt_;                 ///< a
  BodyVector<double> weight_;    ///< Σ_k w_jk (1 - a_j x_jk)
  double unit_ = 1, whole_ = 1;  ///< s² [m²], all volumes [m³]
};

/// The smallest unknowns that close the sums: conjugate gradients for least squares (Björck 1996,
/// algorithm 7.4.1). Smooth unknowns, which take the most of them, matter the least: a few
/// iterations do most of what can be done.
/// @param tolerance share of the areas
struct Solution {
  Unknowns x;
  int iterations = 0;
  double left = 0;  ///< Root mean square of the sums over that of the areas, summed anew.
};
Solution close(const Sums& sums, double tolerance) {
  Stage stage("closed gradients");
  const OwnedVectors& own = sums.own();
  Solution solution{Unknowns(own)};
  const auto squares = [&](const auto& values) {
    return own.sum([&](Index i) { return dot(values[i], values[i]); });
  };
  const double areas = squares(sums.areas());
  const Vectors open = sums.open();
  Vectors residual(own), image(own);
  own.for_each([&](Index i) { residual[i] = -open[i]; });
  Unknowns slope(own);
  sums.apply_transpose(residual, slope);
  Unknowns direction = slope;
  double left_before = HUGE_VAL, left_first = 0;
  double steepness = squares(slope);
  for (;; ++solution.iterations) {
    const double left = std::sqrt(squares(residual) / areas);
    if (solution.iterations == 0) left_first = left;
    stage.reach(std::log(left_first / left) / std::log(left_first / tolerance));
    if (!(left > tolerance) || !(steepness > 0) || solution.iterations == most_iterations) break;
    if (solution.iterations % patience == 0) {
      if (!(left < 0.9 * left_before)) break;
      left_before = left;
    }
    sums.apply(direction, image);
    const double length = squares(image);
    if (!(length > 0)) break;
    const double step = steepness / length;
    own.for_each([&](Index i) {
      add(solution.x[i], step, direction[i]);
      residual[i] -= step * image[i];
    });
    sums.apply_transpose(residual, slope);
    const double next = squares(slope);
    const double keep = next / steepness;
    own.for_each([&](Index i) {
      Unknown turned = slope[i];
      add(turned, keep, direction[i]);
      direction[i] = turned;
    });
    steepness = next;
  }
  sums.apply(solution.x, image);
  own.for_each([&](Index i) { image[i] += open[i]; });
  solution.left = std::sqrt(squares(image) / areas);
  stage.finish();
  return solution;
}

/// The first phyxel of all ranks whose volume would have to change too far, and how far.
struct Excess {
  double phyxel = HUGE_VAL;  ///< Index in the whole model; infinite: none.
  double change = 0;         ///< Relative; infinite: it is no number.
};
/// @param change(i) relative change of the volume of phyxel i
template <class Change>
Excess first_excess(const Model& model, std::span<const Part> parts, Change&& change) {
  Excess first;
  for (const Part& part : parts) {
    for (Index i = part.begin; i < part.owned_end() && first.phyxel == HUGE_VAL; ++i) {
      // Half is far beyond what closes clouds that are any good; NaN is none of these.
      if (std::abs(change(i)) < 0.5) continue;
      first.phyxel = static_cast<double>(model.global_id(i));
      // A NaN would get lost among ranks.
      first.change = std::isnan(change(i)) ? HUGE_VAL : change(i);
    }
  }
  if (!model.share) return first;
  const Communicator& ranks = *model.share->communicator;
  const double phyxel = ranks.smallest(first.phyxel);
  return {phyxel, ranks.smallest(first.phyxel == phyxel ? first.change : HUGE_VAL)};
}

/// The surface of a body in a model that is no share. Triangles stand body by body.
std::vector<Facet> facets_of(const Model& model, const Part& part) {
  const std::vector<Triangle>& all = model.surfels.triangle;
  const auto before = [&](Index surfel) {
    return std::lower_bound(all.begin(), all.end(), surfel,
                            [](const Triangle& t, Index s) { return t[0] < s; });
  };
  const std::span<const Vec3d> position =
      std::span(model.surfels.position)
          .subspan(part.surfel_begin, part.surfel_end - part.surfel_begin);
  return facets_of(position, {before(part.surfel_begin), before(part.surfel_end)},
                   part.surfel_begin, longest_edge(model.neighbourhood.support[part.begin]));
}

}  // namespace

std::optional<std::string> close_body(Model& model, std::span<Part> parts, double enclosed,
                                      std::vector<Vec3d> areas) {
  const Phase phase("closing gradients");
  const Part& first = parts.front();
  const auto of_body = [&](auto& values) {
    return std::span(values).subspan(static_cast<std::size_t>(first.begin),
                                     static_cast<std::size_t>(parts.back().end - first.begin));
  };
  double volume = 0;
  for (const Part& part : parts) volume += part.volume;
  for (double& v : of_body(model.volume)) v *= enclosed / volume;
  const Sums sums(model, parts, std::move(areas));
  const OwnedVectors& own = sums.own();
  const Solution solution = close(sums, first.closure);
  const double mean = sums.mean_volume(solution.x);
  const auto change = [&](Index i) { return ease_volume * (solution.x[i].volume - mean); };
  if (const Excess excess = first_excess(model, parts, change); excess.phyxel < HUGE_VAL) {
    double number = excess.phyxel;  // in the body
    for (const Part& part : model.parts) {
      if (part.body < first.body) number -= part.size;
    }
    return fmt::format(
        "body \"{}\": gradients cannot be closed (closure = {:g}): phyxel {} would have to change "
        "its volume {}; allowed are more phyxels where the body is thin, or closure = 0",
        first.name, first.closure, number,
        std::isfinite(excess.change) ? fmt::format("by {:.0f}%", 100 * excess.change)
                                     : "beyond all bounds");
  }
  model.closing.resize(model.volume.size());
  own.for_each([&](Index i) {
    model.volume[i] *= 1 + change(i);
    model.closing[i] = (sums.unit() / model.volume[i]) * solution.x[i].closing;
  });
  own.refresh_ghosts(of_body(model.volume));
  own.refresh_ghosts(of_body(model.closing));
  for (Part& part : parts) {
    part.volume = OwnedVectors(model, {&part, 1}, omp_get_max_threads()).sum([&](Index i) {
      return model.volume[i];
    });
  }
  if (!(solution.left <= first.closure)) {
    model.warnings.push_back(fmt::format(
        "body \"{}\": sums over neighbourhoods are closed to {:.2g} after {} iterations, asked was "
        "{:g}; more phyxels across its thinnest places help",
        first.name, solution.left, solution.iterations, first.closure));
  }
  return std::nullopt;
}

void loads_follow_volumes(Model& model, const std::vector<double>& before) {
  for (Load& load : model.loads) {
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
      const Index i = load.phyxels[k];
      load.force[k] += (model.volume[i] - before[i]) * load.density;
    }
  }
}

void close_gradients(Model& model) {
  const std::vector<double> before = model.volume;
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
      const std::optional<std::string> refusal = close_body(
          model, {part, next}, enclosed_by(facets).volume,
          areas_of_phyxels(facets, phyxels_near(centroids, position, support), position, support));
      if (refusal) throw InputError(*refusal);
    }
    part = next;
  }
  loads_follow_volumes(model, before);
}

}  // namespace phyxel
