/// The search for what closes the sums of bodies.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "model/closing_sums.hpp"
#include "model/closure.hpp"
#include "stage.hpp"

namespace phyxel::closing {

/// After so many the sums are as closed as they get: 1,500 phyxels take 2,600 to 1e-10.
inline constexpr int most_iterations = 10'000;
/// Iterations that have to take a tenth of what is left.
inline constexpr int patience = 500;
/// The same before all phyxels have unknowns.
inline constexpr int limited_patience = 50;

/// What is left of a body's sums, by their areas; nothing if all phyxels are supported.
inline double left_of(const Body& body) {
  return body.areas > 0 ? std::sqrt(body.residual_squared / body.areas) : 0;
}

/// Updates what is left of a body's sums.
/// @returns whether they are as closed as is asked or as they get
inline bool update_and_check(Body& body) {
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
inline double way_of(const Body& body) {
  return std::log(body.left_first / body.left) / std::log(body.left_first / body.tolerance);
}

/// Puts sums of phyxels where residuals are, with the other sign.
struct IntoResidual {
  Vec3d* residual;
  PHYXEL_HD void put(Index i, Vec3d sum) const { residual[i] = -sum; }
};
/// Puts sums of phyxels into the memory of unknowns.
struct IntoUnknowns {
  Unknown* unknowns;
  PHYXEL_HD void put(Index i, Vec3d sum) const { unknowns[i].closing = sum; }
};

/// The search for the smallest unknowns that close the sums: conjugate gradients for least squares
/// (Björck 1996, algorithm 7.4.1), of all bodies at once, each with its own steps. Smooth unknowns,
/// which take the most of them, matter the least: a few iterations do most of what can be done.
/// All functions with loops are public, as in `Sums`.
template <class Loops>
class Search {
 public:
  template <class T>
  using Vector = typename Loops::template Vector<T>;

  Search(const Loops& loops, const Model& model, const Bodies& all, const std::vector<Vec3d>& areas)
      : loops_(loops),
        sums_(loops, model, all, areas),
        all_(all),
        x_(loops.template make<Unknown>()),
        gradient_(loops.template make<Unknown>()),
        direction_(loops.template make<Unknown>()),
        residual_(loops.template make<Vec3d>()) {}

  /// Returns what closes the sums. What is left of each body's sums is summed anew at the end.
  Closing run() {
    Stage stage("closed gradients");
    sums_.open(all_, residual_.data(), false);
    sums_.limit_to_irregular(all_, residual_.data());
    iterate(all_, stage);
    // For a small tolerance the regular phyxels of a body may have to take part.
    Bodies open = all_;
    open.erase_if(
        [](const Body& body) { return !body.is_limited || !(body.left > body.tolerance); });
    if (!open.empty()) {
      sums_.find_means(open, x_.data());
      sums_.widen(open, x_.data());
      find_residual(open);
      iterate(open, stage);
    }
    find_residual(all_);
    sum_residual(all_);
    for (Body* body : all_) body->left = left_of(*body);
    stage.finish();
    return result();
  }

  void sum_residual(const Bodies& bodies) {
    const Vec3d* const residual = residual_.data();
    loops_.sum(bodies, &Standing::residual_squared,
               [=] PHYXEL_LOOPED(const Standing&, Index i) -> double {
                 return dot(residual[i], residual[i]);
               });
  }

  /// Finds the residual of the present unknowns, and the mean change of volume of each body.
  void find_residual(const Bodies& bodies) {
    Vec3d* const residual = residual_.data();
    loops_.for_each(bodies, [=] PHYXEL_LOOPED(const Standing&, Index i) { residual[i] = {}; });
    sums_.apply(bodies, x_, &Standing::image_squared, IntoResidual{residual});
    sums_.open(bodies, residual, true);
    sums_.find_means(bodies, x_.data());
  }

  /// Iterates from the present unknowns and their residual.
  void iterate(Bodies active, Stage& stage) {
    const SumTerms terms = sums_.terms();
    Unknown *const x = x_.data(), *const gradient = gradient_.data(),
                   *const direction = direction_.data();
    Vec3d* const residual = residual_.data();
    sum_residual(active);
    sums_.apply_transpose(active, residual_, gradient, &Standing::gradient_squared);
    loops_.for_each(active, [=] PHYXEL_LOOPED(const Standing&, Index i) {
      if (terms.is_sought(i)) direction[i] = gradient[i];
    });
    for (;;) {
      active.erase_if(update_and_check);
      if (active.empty()) return;
      double way = 1;
      for (const Body* body : active) way = std::min(way, way_of(*body));
      stage.reach(way);
      // The gradient is used up, and its memory takes the image of the direction.
      sums_.apply(active, direction_, &Standing::image_squared, IntoUnknowns{gradient});
      active.erase_if([](const Body& body) { return !(body.image_squared > 0); });
      loops_.sum(active, &Standing::residual_squared,
                 [=] PHYXEL_LOOPED(const Standing& body, Index i) -> double {
                   const double step = body.gradient_squared / body.image_squared;
                   if (terms.is_sought(i)) add(x[i], step, direction[i]);
                   if (terms.is_changed(i)) residual[i] -= step * gradient[i].closing;
                   return dot(residual[i], residual[i]);
                 });
      sums_.apply_transpose(active, residual_, gradient, &Standing::next_gradient_squared);
      loops_.for_each(active, [=] PHYXEL_LOOPED(const Standing& body, Index i) {
        if (!terms.is_sought(i)) return;
        Unknown turned = gradient[i];
        add(turned, body.next_gradient_squared / body.gradient_squared, direction[i]);
        direction[i] = turned;
      });
      for (Body* body : active) {
        body->gradient_squared = body->next_gradient_squared;
        ++body->iterations;
      }
    }
  }

  Closing result() {
    gradient_ = {};  // makes room
    direction_ = {};
    const SumTerms terms = sums_.terms();
    Vector<double> volume = loops_.template make<double>(), area = loops_.template make<double>();
    Vector<Vec3d> vector = loops_.template make<Vec3d>();
    double *const to_volume = volume.data(), *const to_area = area.data();
    Vec3d* const to_vector = vector.data();
    const Unknown* const x = x_.data();
    loops_.for_each(all_, [=] PHYXEL_LOOPED(const Standing& body, Index i) {
      const double change = terms.change_of_volume(body, i, x[i]);
      to_volume[i] = change;
      to_vector[i] = terms.closing_vector(body, i, x[i], terms.volume[i] * (1 + change));
      to_area[i] = ease_area * x[i].area;
    });
    return {loops_.fetched(volume), loops_.fetched(vector), loops_.fetched(area)};
  }

 private:
  const Loops& loops_;
  Sums<Loops> sums_;
  const Bodies& all_;
  Vector<Unknown> x_, gradient_, direction_;
  Vector<Vec3d> residual_;
};

}  // namespace phyxel::closing
