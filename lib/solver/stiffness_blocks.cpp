#include "solver/stiffness_blocks.hpp"

#include <algorithm>
#include <cmath>

#include "model/parts.hpp"
#include "model/row_weights.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/physics/hooke.hpp"
#include "solver/hourglass.hpp"

namespace phyxel {
namespace {

/// What a phyxel gives to the blocks of its neighbours.
struct Giver {
  Sym3d back;                 // A⁻¹
  Vec3d offset;               // b
  double lambda = 0, mu = 0;  // times its volume [J]
};

std::vector<Giver> givers_of(const Model& model, const OwnedVectors& vectors) {
  std::vector<Giver> givers(static_cast<std::size_t>(model.size()));
  for (const Part& part : model.parts) {
    const LameParameters lame = small_strain_parameters(part);
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      const double v = model.volume[i];
      givers[i] = {model.inverse_moment[i], model.moment_offset[i], v * lame.lambda, v * lame.mu};
    }
  }
  vectors.refresh_ghosts(givers);
  return givers;
}

/// Adds v [(λ + μ) g gᵀ + μ |g|² 1].
void add_outer(const Giver& giver, Vec3d g, Mat3d& block) {
  const double all[] = {g.x, g.y, g.z}, square = giver.mu * dot(g, g);
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) block(r, c) += (giver.lambda + giver.mu) * all[r] * all[c];
    block(r, r) += square;
  }
}

/// An estimate from the speed of waves alone.
double estimate(const Model& model, const Part& part, Index i) {
  constexpr double of_lattices = 1.6;  // of `stiffness_blocks`: 1 in the bulk, 2.4 at faces
  const double h = model.neighbourhood.support[i];
  if (!(h > 0)) return 0;  // nothing is near it
  return of_lattices * wave_stiffness_at_rest(part.material) * model.volume[i] / (h * h);
}

}  // namespace

LameParameters small_strain_parameters(const Part& part) {
  const Material& material = part.material;
  if (material.young > 0) return {material.lame_lambda(), material.lame_mu()};
  constexpr double poisson = 0.25;
  const double young = hourglass_modulus(material);
  return {lame_lambda(young, poisson), lame_mu(young, poisson)};
}

std::vector<Mat3d> stiffness_blocks(const Model& model, const OwnedVectors& vectors) {
  std::vector<Mat3d> blocks(static_cast<std::size_t>(model.size()));
  const bool has_lists = model.has_lists();
  std::vector<Giver> givers;
  if (has_lists) givers = givers_of(model, vectors);
  for (const Part& part : model.parts) {
    const double kappa = hourglass_stiffness(model, part);
#pragma omp parallel for schedule(static)
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      Mat3d& block = blocks[i];
      const double guess = estimate(model, part, i);
      if (!has_lists) {
        block = guess * identity<double>();
        continue;
      }
      // In the order of the whole model, so that sums do not depend on ranks.
      const std::span<const Index> row = model.neighbourhood.inverse().row(i);
      std::vector<Index> order(row.begin(), row.end());
      if (model.share) {
        std::sort(order.begin(), order.end(),
                  [&](Index a, Index b) { return model.global_id(a) < model.global_id(b); });
      }
      const Vec3d own = -(givers[i].back * givers[i].offset);
      add_outer(givers[i], own, block);
      double weights = 0, known = dot(own, -givers[i].offset);
      for (const Index k : order) {
        const Vec3d x = model.position[i] - model.position[k];
        const RowWeights weight_of(model.neighbourhood.support.data(), k, part.pair_length);
        const double w = weight_of(i, dot(x, x));
        const Vec3d g = w * (givers[k].back * x);
        add_outer(givers[k], g, block);
        weights += w;
        known += w * dot(g, x);
      }
      constexpr double least = 0.01;  // where neighbours resist in some directions alone
      for (int r = 0; r < 3; ++r) {
        block(r, r) += kappa * std::max(0.0, 2 * weights - known);
        if (block(r, r) < least * guess) block(r, r) += least * guess;
      }
    }
  }
  return blocks;
}

}  // namespace phyxel
