#include "phyxel/recovery.hpp"

#include <algorithm>
#include <array>

#include "model/neighbour_search.hpp"
#include "model/owned_vectors.hpp"
#include "model/parts.hpp"
#include "model/row_weights.hpp"
#include "phyxel/physics/moment.hpp"

namespace phyxel {
namespace {

constexpr int sweeps = 4;
/// Shift, in supports, from which on a phyxel counts as one on the surface, where it is 0.2.
constexpr double least_shift = 0.1;

/// The neighbours of the phyxels of one body, counted from its first.
Csr lists_of_body(const Model& model, Index begin, Index end) {
  const auto first = static_cast<std::ptrdiff_t>(begin), last = static_cast<std::ptrdiff_t>(end);
  const std::vector<double>& support = model.neighbourhood.support;
  const std::span<const Vec3d> position =
      std::span(model.position).subspan(begin, static_cast<std::size_t>(end - begin));
  return neighbours_within(position, {support.begin() + first, support.begin() + last}, {})
      .neighbours;
}

/// The second derivatives of a displacement [1/m]: of component k, row k.
using Curvature = std::array<Sym3d, 3>;

/// The symmetric part of the derivative of a gradient. @param slope of component k along a and b:
/// slope[a](k, b)
Curvature curvature_of(const std::array<Mat3d, 3>& slope) {
  Curvature h;
  for (int k = 0; k < 3; ++k) {
    const auto mean = [&](int a, int b) { return 0.5 * (slope[a](k, b) + slope[b](k, a)); };
    h[k] = {mean(0, 0), mean(0, 1), mean(0, 2), mean(1, 1), mean(1, 2), mean(2, 2)};
  }
  return h;
}

}  // namespace

Recovery::Recovery(const Model& model)
    : model_(model),
      inverse_moment_(model.position.size()),
      share_(model.position.size()),
      normal_(model.position.size()) {
  find_rows();
#pragma omp parallel for schedule(static)
  for (Index i = 0; i < rows_.rows(); ++i) {
    const auto begin = rows_.indices.begin() + rows_.offsets[i],
               end = rows_.indices.begin() + rows_.offsets[i + 1];
    std::sort(begin, end,
              [&](Index a, Index b) { return model.global_id(a) < model.global_id(b); });
    const double h = model.neighbourhood.support[i];
    const RowWeights weights(model.neighbourhood.support.data(), i, part_of(model, i).pair_length);
    Sym3d moment, of_part;
    Vec3d third;  // Σ w x |x|²
    std::for_each(begin, end, [&](Index j) {
      const Vec3d x = model.position[j] - model.position[i];
      const double w = weights(j, dot(x, x));
      moment += moment_term(x, w);
      if (!are_of_one_part(model, i, j)) return;
      of_part += moment_term(x, w);
      third += w * dot(x, x) * x;
    });
    const PseudoInverse<double> inverse = pseudo_inverse(of_part);
    inverse_moment_[i] = inverse.matrix;
    // In half of a ball the fit of a displacement that is quadratic along the normal, or whose
    // slopes along the surface change along the normal, is its gradient at this distance.
    const Vec3d shift = 0.25 * (inverse.matrix * third);
    const double distance = norm(shift);
    if (distance > 0) normal_[i] = -shift / distance;
    if (inverse.rank == pseudo_inverse(moment).rank) {
      share_[i] = std::min(1.0, distance / (least_shift * h));
    }
  }
}

void Recovery::find_rows() {
  rows_.offsets.reserve(model_.position.size() + 1);
  for (auto part = model_.parts.begin(); part != model_.parts.end();) {
    const std::span<const Part> parts = model_.parts_of_body(*part);
    const Index first = parts.front().begin;
    Csr found;
    if (!model_.has_lists()) found = lists_of_body(model_, first, parts.back().end);
    for (const Part& own : parts) {
      for (Index i = own.begin; i < own.end; ++i) {
        if (i < own.owned_end()) {
          const bool has_lists = model_.has_lists();
          for (const Index j :
               has_lists ? model_.neighbourhood.neighbours.row(i) : found.row(i - first)) {
            rows_.indices.push_back(has_lists ? j : first + j);
          }
        }
        rows_.offsets.push_back(static_cast<Offset>(rows_.indices.size()));
      }
    }
    part += static_cast<std::ptrdiff_t>(parts.size());
  }
}

std::vector<Mat3d> Recovery::gradients(std::vector<Vec3d> displacement) const {
  const bool several = model_.has_inclusions();
  // For each neighbour of the same part: use(its index, x, w x).
  const auto for_each_neighbour = [&](Index i, auto&& use) {
    const RowWeights weights(model_.neighbourhood.support.data(), i,
                             part_of(model_, i).pair_length);
    for (const Index j : rows_.row(i)) {
      if (several && !are_of_one_part(model_, i, j)) continue;
      const Vec3d x = model_.position[j] - model_.position[i];
      use(j, x, weights(j, dot(x, x)) * x);
    }
  };
  const auto refresh = [&](auto& values) {
    if (model_.share) refresh_ghosts(*model_.share, values);
  };
  refresh(displacement);
  const Index n = rows_.rows();
  std::vector<Mat3d> fit(static_cast<std::size_t>(n));
#pragma omp parallel for schedule(static)
  for (Index i = 0; i < n; ++i) {
    Mat3d sum{};
    for_each_neighbour(i, [&](Index j, Vec3d, Vec3d weighted) {
      sum = fused_outer(displacement[j] - displacement[i], weighted, sum);
    });
    fit[i] = sum * inverse_moment_[i];
  }
  std::vector<Mat3d> gradient = fit, next(fit.size());
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    refresh(gradient);
#pragma omp parallel for schedule(static)
    for (Index i = 0; i < n; ++i) {
      // Column a of the gradient is a vector, whose fit is as that of the displacement.
      std::array<Mat3d, 3> slope{};
      for_each_neighbour(i, [&](Index j, Vec3d, Vec3d weighted) {
        const Mat3d change = gradient[j] - gradient[i];
        for (int a = 0; a < 3; ++a) {
          const Vec3d column{change(0, a), change(1, a), change(2, a)};
          slope[a] = fused_outer(column, weighted, slope[a]);
        }
      });
      for (Mat3d& of_column : slope) of_column = of_column * inverse_moment_[i];
      const Curvature h = curvature_of(slope);
      Mat3d left{};
      for_each_neighbour(i, [&](Index, Vec3d x, Vec3d weighted) {
        left = fused_outer(0.5 * Vec3d{dot(x, h[0] * x), dot(x, h[1] * x), dot(x, h[2] * x)},
                           weighted, left);
      });
      next[i] = fit[i] - left * inverse_moment_[i];
    }
    gradient.swap(next);
  }
  for (std::size_t i = 0; i < gradient.size(); ++i) gradient[i] += gradient[i] - next[i];
  return gradient;
}

}  // namespace phyxel
