#include "model/closure.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "exact_sum.hpp"
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

/// A flat piece of the surface. Areas at centroids carry constants and linear functions exactly,
/// however triangles are split.
struct Facet {
  Vec3d centroid, area;  ///< [m], outward [m²]
};

void add_facets(std::vector<Facet>& facets, Vec3d a, Vec3d b, Vec3d c, double longest) {
  const double ab = norm(b - a), bc = norm(c - b), ca = norm(a - c);
  if (std::max({ab, bc, ca}) <= longest) {
    facets.push_back({(a + b + c) / 3.0, 0.5 * cross(b - a, c - a)});
  } else if (ab >= bc && ab >= ca) {
    const Vec3d middle = 0.5 * (a + b);
    add_facets(facets, a, middle, c, longest);
    add_facets(facets, middle, b, c, longest);
  } else {
    add_facets(facets, b, c, a, longest);  // the longest comes first within two turns
  }
}
/// @param first the number of the surface's first vertex in `triangles`
/// @param longest edges [m]
std::vector<Facet> facets_of(std::span<const Vec3d> position, std::span<const Triangle> triangles,
                             Index first, double longest) {
  std::vector<Facet> facets;
  for (const Triangle& t : triangles) {
    add_facets(facets, position[t[0] - first], position[t[1] - first], position[t[2] - first],
               longest);
  }
  return facets;
}
/// A body's own surface. Triangles stand body by body.
std::vector<Facet> facets_of(const Model& model, const Part& part) {
  const std::vector<Triangle>& all = model.surfels.triangle;
  const auto before = [&](Index surfel) {
    return std::lower_bound(all.begin(), all.end(), surfel,
                            [](const Triangle& t, Index s) { return t[0] < s; });
  };
  const std::span<const Vec3d> position =
      std::span(model.surfels.position)
          .subspan(part.surfel_begin, part.surfel_end - part.surfel_begin);
  // Small against a support, so that each goes to the phyxels beside it.
  const double longest = 0.5 * model.neighbourhood.support[part.begin];
  return facets_of(position, {before(part.surfel_begin), before(part.surfel_end)},
                   part.surfel_begin, longest);
}

/// Shares facets out to the phyxels near them, so that Σ S = 0 and Σ x Sᵀ = V I hold as they do for
/// the facets: by weights that reproduce linear functions, where phyxels span space. Where phyxels
/// in the facet's plane span it, they are the ones, and none below the surface gets a share.
std::vector<Vec3d> areas_of_phyxels(const Model& model, const Part& part,
                                    const std::vector<Facet>& facets) {
  std::vector<Vec3d> centroids;
  for (const Facet& f : facets) centroids.push_back(f.centroid);
  const auto begin = static_cast<std::size_t>(part.begin),
             count = static_cast<std::size_t>(part.end - part.begin);
  const std::span<const Vec3d> position = std::span(model.position).subspan(begin, count);
  const std::span<const double> support =
      std::span(model.neighbourhood.support).subspan(begin, count);
  const Csr near = phyxels_near(centroids, position, support);
  std::vector<double> share(near.indices.size());
#pragma omp parallel for schedule(static)
  for (Index f = 0; f < near.rows(); ++f) {
    const Facet& facet = facets[f];
    const double area = norm(facet.area);
    const Vec3d normal = area > 0 ? facet.area / area : Vec3d{};
    const auto x_of = [&](Index i) { return position[i] - facet.centroid; };
    const auto weigh = [&](bool in_plane) {
      // Moments about the weighted mean: 1 and x - mean are then orthogonal.
      double sum = 0;
      Vec3d first;
      const auto weight_of = [&](Index i) {
        const Vec3d x = x_of(i);
        const double h = support[i];
        // Whole units of rounding: a lattice's nodes are put on its faces by arithmetic.
        if (in_plane && std::abs(dot(x, normal)) > 1e-6 * h) return 0.0;
        return weight_shape(dot(x, x), 1 / (h * h));
      };
      for (const Index i : near.row(f)) {
        sum += weight_of(i);
        first += weight_of(i) * x_of(i);
      }
      if (!(sum > 0)) return -1;
      const Vec3d mean = first / sum;
      Sym3d moment;
      for (const Index i : near.row(f)) moment += moment_term(x_of(i) - mean, weight_of(i));
      const PseudoInverse<double> inverse = pseudo_inverse(moment);
      const Vec3d slope = inverse.matrix * mean;
      for (Offset k = near.offsets[f]; k < near.offsets[f + 1]; ++k) {
        const Index i = near.indices[k];
        share[k] = weight_of(i) * (1 / sum - dot(slope, x_of(i) - mean));
      }
      return inverse.rank;
    };
    if (weigh(true) == 2) continue;
    if (weigh(false) < 0) {  // only the nearest, beyond its support
      for (Offset k = near.offsets[f]; k < near.offsets[f + 1]; ++k) {
        share[k] = 1.0 / near.length(f);
      }
    }
  }
  std::vector<Vec3d> areas(count);
  for (Index f = 0; f < near.rows(); ++f) {
    for (Offset k = near.offsets[f]; k < near.offsets[f + 1]; ++k) {
      areas[near.indices[k]] += share[k] * facets[f].area;
    }
  }
  return areas;
}

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

template <class Term>
double exact_sum(Index n, Term&& term) {
  ExactSum all;
#pragma omp parallel
  {
    ExactSum own;
#pragma omp for schedule(static) nowait
    for (Index i = 0; i < n; ++i) own.add(term(i));
#pragma omp critical
    all.add(own);
  }
  return all.value();
}

/// The sums of one body, per s², as a linear function of the unknowns:
///   R_j = Σ_k w_jk (c_k (1 + a_k x_jk) - M_k x_jk (1 + σ_k)) - c_j Σ_k w_jk (1 - a_j x_jk)
///         - M_j b_j (1 + σ_j) - S_j (1 + y_j),   M = v A⁻¹, a = A⁻¹ b.
/// Of the changes σ only what leaves the whole volume as it is counts: by Σ x Sᵀ = V I, areas of
/// whole faces stay, too.
class Sums {
 public:
  Sums(const Model& model, const Part& part, std::vector<Vec3d> areas)
      : model_(model), begin_(part.begin), size_(part.end - part.begin), areas_(std::move(areas)) {
    const double spacing = std::cbrt(part.volume / part.size);
    unit_ = spacing * spacing;
    whole_ = exact_sum(size_, [&](Index i) { return model_.volume[begin_ + i]; });
    for (Vec3d& s : areas_) s = s / unit_;
    tilt_.resize(areas_.size());
    weight_.resize(areas_.size());
#pragma omp parallel for schedule(static)
    for (Index i = 0; i < size_; ++i) {
      tilt_[i] = model_.inverse_moment[begin_ + i] * model_.moment_offset[begin_ + i];
      double sum = 0;
      visit(i, [&](Index, Vec3d, double w) { sum += w; });
      weight_[i] = sum - dot(tilt_[i], model_.moment_offset[begin_ + i]);
    }
  }
  double unit() const { return unit_; }
  const std::vector<Vec3d>& areas() const { return areas_; }
  Index size() const { return size_; }

  /// The sums without closing, as they are to be 0.
  std::vector<Vec3d> open() const {
    std::vector<Vec3d> sums(areas_.size());
    std::vector<Unknown> ones(areas_.size());
    for (Unknown& x : ones) x.area = 1 / ease_area;
    for (Unknown& x : ones) x.volume = 1 / ease_volume;
    apply(ones, 0, sums);
    return sums;
  }
  void apply(const std::vector<Unknown>& x, std::vector<Vec3d>& sums) const {
    apply(x, mean_volume(x), sums);
  }
  /// The change of all volumes that takes no part [over `ease_volume`].
  double mean_volume(const std::vector<Unknown>& x) const {
    return exact_sum(size_, [&](Index i) { return model_.volume[begin_ + i] * x[i].volume; }) /
           whole_;
  }
  void apply_transpose(const std::vector<Vec3d>& sums, std::vector<Unknown>& x) const {
#pragma omp parallel for schedule(static)
    for (Index i = 0; i < size_; ++i) {
      Unknown out;
      visit(i, [&](Index k, Vec3d x_ik, double w) {
        const Vec3d difference = sums[k] - sums[i];
        out.closing += (w * (1 - dot(tilt_[i], x_ik))) * difference;
        out.volume += w * dot(own_share(i, x_ik), difference);
      });
      out.volume *= ease_volume;
      out.area = -ease_area * dot(areas_[i], sums[i]);
      x[i] = out;
    }
    const double all = exact_sum(size_, [&](Index i) { return x[i].volume; });
    for (Index i = 0; i < size_; ++i) x[i].volume -= model_.volume[begin_ + i] / whole_ * all;
  }

 private:
  void apply(const std::vector<Unknown>& x, double mean, std::vector<Vec3d>& sums) const {
#pragma omp parallel for schedule(static)
    for (Index j = 0; j < size_; ++j) {
      Vec3d sum =
          -weight_[j] * x[j].closing - ease_area * x[j].area * areas_[j] -
          ease_volume * (x[j].volume - mean) * own_share(j, model_.moment_offset[begin_ + j]);
      visit(j, [&](Index k, Vec3d x_jk, double w) {
        sum += w * ((1 + dot(tilt_[k], x_jk)) * x[k].closing -
                    (ease_volume * (x[k].volume - mean)) * own_share(k, x_jk));
      });
      sums[j] = sum;
    }
  }
  template <class Visit>
  void visit(Index i, Visit&& visit) const {
    const double h = model_.neighbourhood.support[begin_ + i];
    for (const Index k : model_.neighbourhood.neighbours.row(begin_ + i)) {
      const Vec3d x = model_.position[k] - model_.position[begin_ + i];
      visit(k - begin_, x, weight_shape(dot(x, x), 1 / (h * h)));
    }
  }
  /// M_i x per s².
  Vec3d own_share(Index i, Vec3d x) const {
    return (model_.volume[begin_ + i] / unit_) * (model_.inverse_moment[begin_ + i] * x);
  }

  const Model& model_;
  Index begin_, size_;
  std::vector<Vec3d> areas_;     ///< S / s²
  std::vector<Vec3d> tilt_;      ///< a
  std::vector<double> weight_;   ///< Σ_k w_jk (1 - a_j x_jk)
  double unit_ = 1, whole_ = 1;  ///< s² [m²], all volumes [m³]
};

/// The smallest unknowns that close the sums: conjugate gradients for least squares (Björck 1996,
/// algorithm 7.4.1). Smooth unknowns, which take the most of them, matter the least: a few
/// iterations do most of what can be done.
/// @param tolerance share of the areas
struct Solution {
  std::vector<Unknown> x;
  int iterations = 0;
  double left = 0;  ///< Root mean square of the sums over that of the areas, summed anew.
};
Solution close(const Sums& sums, double tolerance) {
  Stage stage("closed gradients");
  const Index n = sums.size();
  const auto count = static_cast<std::size_t>(n);
  Solution solution{std::vector<Unknown>(count)};
  const double areas = exact_sum(n, [&](Index i) { return dot(sums.areas()[i], sums.areas()[i]); });
  const std::vector<Vec3d> open = sums.open();
  std::vector<Vec3d> residual(count), image(count);
  for (std::size_t i = 0; i < count; ++i) residual[i] = -open[i];
  const auto left_by = [&](auto&& sum) {
    return std::sqrt(exact_sum(n, [&](Index i) { return dot(sum(i), sum(i)); }) / areas);
  };
  std::vector<Unknown> slope(count), direction;
  sums.apply_transpose(residual, slope);
  direction = slope;
  double left_before = HUGE_VAL, left_first = 0;
  double steepness = exact_sum(n, [&](Index i) { return dot(slope[i], slope[i]); });
  for (;; ++solution.iterations) {
    const double left = left_by([&](Index i) { return residual[i]; });
    if (solution.iterations == 0) left_first = left;
    stage.reach(std::log(left_first / left) / std::log(left_first / tolerance));
    if (!(left > tolerance) || !(steepness > 0) || solution.iterations == most_iterations) break;
    if (solution.iterations % patience == 0) {
      if (!(left < 0.9 * left_before)) break;
      left_before = left;
    }
    sums.apply(direction, image);
    const double length = exact_sum(n, [&](Index i) { return dot(image[i], image[i]); });
    if (!(length > 0)) break;
    const double step = steepness / length;
#pragma omp parallel for schedule(static)
    for (Index i = 0; i < n; ++i) {
      add(solution.x[i], step, direction[i]);
      residual[i] -= step * image[i];
    }
    sums.apply_transpose(residual, slope);
    const double next = exact_sum(n, [&](Index i) { return dot(slope[i], slope[i]); });
    const double keep = next / steepness;
#pragma omp parallel for schedule(static)
    for (Index i = 0; i < n; ++i) {
      Unknown turned = slope[i];
      add(turned, keep, direction[i]);
      direction[i] = turned;
    }
    steepness = next;
  }
  sums.apply(solution.x, image);
  solution.left = left_by([&](Index i) { return open[i] + image[i]; });
  stage.finish();
  return solution;
}

/// What facets say of the space inside.
struct Enclosed {
  double volume = 0;  ///< [m³]
  double open = 0;    ///< How far Σ x Sᵀ is from V I, and Σ S from 0, as shares.
};
Enclosed enclosed_by(const std::vector<Facet>& facets) {
  Enclosed found;
  if (facets.empty()) return found;
  Vec3d sum;
  Mat3d moment{};
  double area = 0;
  for (const Facet& f : facets) {
    sum += f.area;
    area += norm(f.area);
    moment = fused_outer(f.centroid - facets[0].centroid, f.area, moment);
  }
  found.volume = (moment(0, 0) + moment(1, 1) + moment(2, 2)) / 3;
  found.open = area > 0 ? norm(sum) / area : 1;
  for (int e = 0; e < 9; ++e) {
    const double off = moment(e / 3, e % 3) - (e % 4 == 0 ? found.volume : 0);
    found.open = std::max(found.open, std::abs(off / found.volume));
  }
  return found;
}

/// All parts of a body as if they were one.
Part whole_of(std::span<const Part> parts) {
  Part whole = parts.front();
  for (const Part& part : parts.subspan(1)) {
    whole.end = part.end;
    whole.size += part.size;
    whole.volume += part.volume;
  }
  return whole;
}

/// @param parts of one body
void close_body(Model& model, std::span<Part> parts) {
  const Part part = whole_of(parts);
  const Phase phase("closing gradients");
  const std::vector<Facet> facets = facets_of(model, part);
  const auto begin = static_cast<std::size_t>(part.begin), end = static_cast<std::size_t>(part.end);
  const std::vector<double> before(model.volume.begin() + part.begin,
                                   model.volume.begin() + part.end);
  const double scale = enclosed_by(facets).volume / part.volume;
  for (std::size_t i = begin; i < end; ++i) model.volume[i] *= scale;
  const Sums sums(model, part, areas_of_phyxels(model, part, facets));
  const Solution solution = close(sums, part.closure);
  const double mean = sums.mean_volume(solution.x);
  for (std::size_t i = begin; i < end; ++i) {
    const Unknown& x = solution.x[i - begin];
    const double change = ease_volume * (x.volume - mean);
    // Half is far beyond what closes clouds that are any good; NaN is none of these.
    if (!(std::abs(change) < 0.5)) {
      throw InputError(fmt::format(
          "body \"{}\": gradients cannot be closed (closure = {:g}): phyxel {} would have to "
          "change "
          "its volume by {:.0f}%; allowed are more phyxels where the body is thin, or closure = 0",
          part.name, part.closure, i - begin, 100 * change));
    }
    model.volume[i] *= 1 + change;
    model.closing[i] = (sums.unit() / model.volume[i]) * x.closing;
  }
  for (Part& own : parts) {
    ExactSum sum;
    for (Index i = own.begin; i < own.end; ++i) sum.add(model.volume[i]);
    own.volume = sum.value();
  }
  for (Load& load : model.loads) {
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
      const Index i = load.phyxels[k];
      if (i < part.begin || i >= part.end) continue;
      load.force[k] += (model.volume[i] - before[i - part.begin]) * load.density;
    }
  }
  if (!(solution.left <= part.closure)) {
    model.warnings.push_back(fmt::format(
        "body \"{}\": sums over neighbourhoods are closed to {:.2g} after {} iterations, asked was "
        "{:g}; more phyxels across its thinnest places help",
        part.name, solution.left, solution.iterations, part.closure));
  }
}

}  // namespace

void check_closure(const BodyRequest& request, const Surface& surface,
                   std::optional<double> volume) {
  if (!(request.closure > 0)) return;
  const auto refuse = [&](const std::string& why) {
    throw InputError(fmt::format(
        "{}: body \"{}\" has closed gradients (closure = {:g}), which need its whole surface, but "
        "{}; "
        "allowed are a mesh, a shape with surfels, a file with such a surface, or closure = 0",
        request.where, request.name, request.closure, why));
  };
  if (surface.triangle.empty()) refuse("it has no triangles");
  const Enclosed found = enclosed_by(facets_of(surface.position, surface.triangle, 0, HUGE_VAL));
  // Coordinates of a file may be floats.
  if (!(found.open <= 1e-5)) refuse("its triangles do not enclose a volume");
  if (!(found.volume > 0)) refuse("its triangles face inward");
  if (volume && !(std::abs(found.volume / *volume - 1) < 0.3)) {
    refuse(fmt::format("that encloses {:.4g} m^3, and its phyxels have {:.4g}", found.volume,
                       *volume));
  }
}

void close_gradients(Model& model) {
  for (auto part = model.parts.begin(); part != model.parts.end();) {
    const auto next = part + static_cast<std::ptrdiff_t>(model.parts_of_body(*part).size());
    if (part->closure > 0 && part->begin < part->end) {
      model.closing.resize(static_cast<std::size_t>(model.with_lists().size()));
      close_body(model, {part, next});
    }
    part = next;
  }
}

}  // namespace phyxel
