#include "view/hand.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "program_ranks.hpp"

namespace phyxel::app {
namespace {

/// Time in which the hand moves a free body to its place [s].
constexpr double reaction = 0.1;
/// Radius of the patch: in distances between phyxels, and as a share of the size of the body.
constexpr double fewest_spacings = 2, size_share = 0.12;
/// Largest stress of the force over the patch's cross-section, as a share of the modulus of
/// pressure waves.
constexpr double stress_share = 0.2;
/// Stiffness and damping times powers of the interval, over the patch's mass: below 1, a sampled
/// spring is stable.
constexpr double stable_stiffness = 0.1, stable_damping = 0.3;

/// The phyxel of a global id, and the body and the place that it has at rest.
struct Grabbed {
  Index body = 0;
  Vec3d rest;
};

Grabbed grabbed(const Model& model, Index phyxel) {
  if (phyxel < 0 || phyxel >= model.global_count()) {
    throw InputError(fmt::format("grab: phyxel {}: out of range: allowed 0 to {}", phyxel,
                                 model.global_count() - 1));
  }
  std::vector<double> place[3];
  std::int64_t body = 0;
  for (const Part& part : model.parts) {
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      if (model.global_id(i) != phyxel) continue;
      body = part.body;
      for (int axis = 0; axis < 3; ++axis) place[axis] = {component(model.position[i], axis)};
    }
  }
  const auto of = [&](int axis) { return all_ranks().exact_sum(place[axis]); };
  return {static_cast<Index>(all_ranks().largest(body)), {of(0), of(1), of(2)}};
}

}  // namespace

Hand::Hand(const Model& model, Index phyxel, double dt, std::span<const Vec3d> others)
    : model_(model), others_(others) {
  const Grabbed at = grabbed(model, phyxel);
  double mass = 0, volume = 0, speed = 0, density = 0;
  Index size = 0;
  for (const Part& part : model.parts) {
    if (part.body != at.body) continue;
    mass += part.mass;
    volume += part.volume;
    size += part.size;
    speed = std::max(speed, pressure_wave_speed(part.material));
    density = std::max(density, part.material.density);
  }
  const double spacing = std::cbrt(volume / std::max(1, size));
  const double radius = std::max(fewest_spacings * spacing, size_share * std::cbrt(volume));
  std::vector<double> weighted;
  for (const Part& part : model.parts) {
    if (part.body != at.body) continue;
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      const double q = norm(model.position[i] - at.rest) / radius;
      if (q >= 1) continue;
      phyxels_.push_back(i);
      weighted.push_back((1 - q * q) * (1 - q * q) * model.mass[i]);
    }
  }
  const double sum = all_ranks().exact_sum(weighted);
  std::vector<double> inverse;
  for (std::size_t k = 0; k < weighted.size(); ++k) {
    share_.push_back(weighted[k] / sum);
    inverse.push_back(share_[k] * share_[k] / model.mass[phyxels_[k]]);
  }
  // A force on the patch accelerates its mean displacement as if it had this mass.
  const double patch_mass = 1 / all_ranks().exact_sum(inverse), span = interval * dt;
  stiffness_ =
      std::min(4 * mass / (reaction * reaction), stable_stiffness * patch_mass / (span * span));
  damping_ = std::min(2 * std::sqrt(stiffness_ * mass), stable_damping * patch_mass / span);
  largest_force_ = stress_share * density * speed * speed * radius * radius;
}

Hand::Patch Hand::mean(const Backend& backend, double lag) const {
  std::vector<double> terms[6];
  State copy;
  const std::optional<StateView> view = backend.view();
  if (!view) backend.download(copy);
  for (std::size_t k = 0; k < phyxels_.size(); ++k) {
    const Index i = phyxels_[k];
    const Vec3d u = view ? view->displacement(i) : copy.displacement[i];
    const Vec3d v = view ? view->velocity(i) : copy.velocity[i];
    for (int axis = 0; axis < 3; ++axis) {
      terms[axis].push_back(share_[k] * component(u, axis));
      terms[3 + axis].push_back(share_[k] * component(v, axis));
    }
  }
  const auto sum = [&](int term) { return all_ranks().exact_sum(terms[term]); };
  const Vec3d u{sum(0), sum(1), sum(2)}, v{sum(3), sum(4), sum(5)};
  return {u, v, u - lag * v};
}

double Hand::work_since_pull(const Patch& now) const {
  return dot(force_, now.before - pulled_at_);
}

void Hand::pull(Backend& backend, double lag) {
  const Patch now = mean(backend, lag);
  if (!pulls_) grabbed_ = now.displacement;
  if (pulls_) work_ += work_since_pull(now);
  pulls_ = true;
  Vec3d force = stiffness_ * (grabbed_ + by_ - now.displacement) - damping_ * now.velocity;
  if (const double size = norm(force); size > largest_force_) {
    force = (largest_force_ / size) * force;
  }
  if (!is_finite(force)) {  // on all ranks
    throw DivergedError("the simulation diverged: the state is not finite where the hand holds it");
  }
  force_ = force;
  pulled_at_ = now.before;
  since_ = 0;
  std::vector<Vec3d> forces(others_.begin(), others_.end());
  forces.resize(static_cast<std::size_t>(model_.size()));
  for (std::size_t k = 0; k < phyxels_.size(); ++k) forces[phyxels_[k]] += share_[k] * force;
  backend.set_external_forces(forces);
}

void Hand::stepped(int steps, double dt) {
  since_ += steps;
  impulse_ += (steps * dt) * force_;
}

double Hand::work_until(const Backend& backend, double lag) const {
  return pulls_ ? work_ + work_since_pull(mean(backend, lag)) : work_;
}

double Hand::let_go(Backend& backend, double lag) {
  if (pulls_) work_ += work_since_pull(mean(backend, lag));
  pulls_ = false;
  backend.set_external_forces(others_);
  return work_;
}

}  // namespace phyxel::app
