#include "phyxel/equilibrium.hpp"

#include <fmt/format.h>

#include <cmath>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "solver/owned_vectors.hpp"

namespace phyxel {
namespace {

class Search {
  using Vector = OwnedVectors::Vector;

 public:
  Search(const Model& model, Backend& backend, const EquilibriumOptions& options)
      : model_(model),
        backend_(backend),
        options_(options),
        vectors_(model, std::max(1, backend.threads())),
        held_(static_cast<std::size_t>(model.size()), 0),
        target_(vectors_.make()),
        applied_(vectors_.make()),
        difference_(1e-7 * vectors_.smallest_support()) {
    found_.state.displacement = vectors_.make();
    found_.state.velocity = vectors_.make();
    for (const Motion& motion : model.motions) {
      if (motion.velocity != Vec3d{} || motion.amplitude != Vec3d{}) {
        throw InputError(
            "a motion with a velocity or an amplitude never ends: allowed in a search for "
            "equilibrium are fixed phyxels and motions by a displacement");
      }
      for (const Index i : motion.phyxels) {
        held_[i] = 1;
        target_[i] = motion.displacement;
      }
    }
    vectors_.for_each([&](Index i) { applied_[i] = model.mass[i] * model.gravity; });
    for (const Load& load : model.loads) {
      for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
        applied_[load.phyxels[k]] += load.force[k];
      }
    }
    refuse_free_fall();
  }

  Equilibrium run() {
    Vector& u = found_.state.displacement;
    Vector force = forces(u), step = vectors_.make(), next = vectors_.make();
    double energy = potential(u);
    for (;;) {
      found_.residual = residual(force);
      const double to_move =
          vectors_.largest([&](Index i) { return held_[i] ? norm(target_[i] - u[i]) : 0; });
      if (found_.residual <= options_.tolerance && to_move == 0) return std::move(found_);
      if (found_.steps == options_.most_steps || !std::isfinite(found_.residual)) give_up();
      ++found_.steps;

      find_step(u, force, step);
      double length = std::min(1.0, largest_strain / steepest(step));
      for (int attempt = 0;; ++attempt, length *= 0.5) {
        vectors_.for_each([&](Index i) {
          // To the last bit at the end of the way.
          next[i] = held_[i] && length == 1 ? target_[i] : u[i] + length * step[i];
        });
        force = forces(next);
        const double now = potential(next);
        // Of what is moved along, energy rises; and rounding is no rise.
        const double rise = now - energy, rounding = 1e-10 * std::abs(energy);
        if (std::isfinite(now) && (to_move > 0 || rise <= rounding || attempt == most_cuts)) {
          energy = now;
          break;
        }
        if (attempt > 2 * most_cuts) give_up();
      }
      u.swap(next);
    }
  }

 private:
  static constexpr double largest_strain = 0.3;  ///< Of one step.
  static constexpr int most_cuts = 8;
  static constexpr double inner_tolerance = 1e-3;
  static constexpr int most_inner = 50'000;

  /// Where nothing is held, what is applied must cancel.
  void refuse_free_fall() const {
    const double held = vectors_.sum([&](Index i) { return held_[i] ? 1.0 : 0.0; });
    if (held > 0) return;
    Vec3d all{vectors_.sum([&](Index i) { return applied_[i].x; }),
              vectors_.sum([&](Index i) { return applied_[i].y; }),
              vectors_.sum([&](Index i) { return applied_[i].z; })};
    const double scale = vectors_.sum([&](Index i) { return norm(applied_[i]); });
    if (norm(all) <= 1e-9 * scale) return;
    throw InputError(fmt::format(
        "nothing is held against a force of {:g} N, so that nothing comes to rest: allowed is a "
        "scene with fixed phyxels, or with loads that cancel",
        norm(all)));
  }

  /// Inner and applied ones [N].
  Vector forces(const Vector& u) {
    put(u);
    Vector force;
    backend_.internal_forces(force);
    ++found_.evaluations;
    vectors_.for_each([&](Index i) { force[i] += applied_[i]; });
    return force;
  }
  void put(const Vector& u) {
    placed_.displacement = u;
    placed_.velocity.resize(u.size());
    vectors_.refresh_ghosts(placed_.displacement);
    backend_.upload(placed_);
  }
  /// After `forces` [J].
  double potential(const Vector& u) {
    const double elastic = diagnose(model_, backend_, 0, 1).elastic_energy();
    ++found_.evaluations;
    return elastic - vectors_.product(applied_, u);
  }
  double residual(const Vector& force) const {
    double free = 0, reactions = 0;
    free = vectors_.sum([&](Index i) { return held_[i] ? 0 : dot(force[i], force[i]); });
    reactions = vectors_.sum([&](Index i) { return held_[i] ? dot(force[i], force[i]) : 0; });
    const double scale = std::sqrt(vectors_.product(applied_, applied_)) + std::sqrt(reactions);
    return scale > 0 ? std::sqrt(free) / scale : std::sqrt(free) > 0 ? 1 : 0;
  }
  /// The largest entry of the gradient of a displacement.
  double steepest(const Vector& step) {
    put(step);
    std::vector<Mat3d> gradient;
    backend_.displacement_gradients(gradient);
    ++found_.evaluations;
    const double most = vectors_.largest([&](Index i) {
      double entry = 0;
      for (int e = 0; e < 9; ++e) entry = std::max(entry, std::abs(gradient[i](e / 3, e % 3)));
      return entry;
    });
    return std::max(most, 1e-300);
  }

  /// out = K v on what is free, by a difference of forces. @param force at u
  void stiffness_times(const Vector& u, const Vector& force, const Vector& v, Vector& out) {
    const double size = vectors_.largest([&](Index i) { return norm(v[i]); });
    const double scale = size > 0 ? difference_ / size : 1;
    Vector there(u.size());
    vectors_.for_each([&](Index i) { there[i] = u[i] + scale * v[i]; });
    const Vector changed = forces(there);
    vectors_.for_each(
        [&](Index i) { out[i] = held_[i] ? Vec3d{} : (1 / scale) * (force[i] - changed[i]); });
  }

  /// The step of Newton's method, held phyxels all the way to their targets: conjugate gradients,
  /// by masses. Where the stiffness has no definite sign, as far as it has.
  void find_step(const Vector& u, const Vector& force, Vector& step) {
    Vector rest = vectors_.make(), image = vectors_.make();
    bool moves = false;
    vectors_.for_each([&](Index i) { step[i] = held_[i] ? target_[i] - u[i] : Vec3d{}; });
    moves = vectors_.largest([&](Index i) { return norm(step[i]); }) > 0;
    if (moves) stiffness_times(u, force, step, image);
    vectors_.for_each([&](Index i) {
      rest[i] = held_[i] ? Vec3d{} : force[i];
      if (moves && !held_[i]) rest[i] -= image[i];
    });

    Vector way(u.size());
    const auto preconditioned = [&](Index i) { return (1 / model_.mass[i]) * rest[i]; };
    vectors_.for_each([&](Index i) { way[i] = preconditioned(i); });
    double product = vectors_.sum([&](Index i) { return dot(rest[i], preconditioned(i)); });
    const double start = product;
    for (int k = 0; k < most_inner && product > inner_tolerance * inner_tolerance * start; ++k) {
      stiffness_times(u, force, way, image);
      const double curvature = vectors_.product(way, image);
      if (!(curvature > 0)) {
        if (k == 0) vectors_.for_each([&](Index i) { step[i] += way[i]; });
        break;
      }
      const double length = product / curvature;
      vectors_.for_each([&](Index i) {
        step[i] += length * way[i];
        rest[i] -= length * image[i];
      });
      const double before = product;
      product = vectors_.sum([&](Index i) { return dot(rest[i], preconditioned(i)); });
      const double share = product / before;
      vectors_.for_each([&](Index i) { way[i] = preconditioned(i) + share * way[i]; });
    }
  }

  [[noreturn]] void give_up() const {
    const std::string why = fmt::format(
        "no equilibrium was found in {} steps of Newton's method: the residual force is {:.2g} of "
        "what is applied, {:.2g} is asked; nothing may hold a part of the body, or it buckles: "
        "allowed are more support, smaller loads, or a run in time with damping",
        found_.steps, found_.residual, options_.tolerance);
    if (model_.share) throw AgreedError(ExitCode::diverged, why);
    throw DivergedError(why);
  }

  const Model& model_;
  Backend& backend_;
  EquilibriumOptions options_;
  OwnedVectors vectors_;
  std::vector<char> held_;
  Vector target_, applied_;  ///< Displacements of held phyxels [m]; gravity and loads [N].
  double difference_;        ///< How far stiffness moves phyxels at most [m].
  State placed_;
  Equilibrium found_;
};

}  // namespace

Equilibrium find_equilibrium(const Model& model, Backend& backend,
                             const EquilibriumOptions& options) {
  Search search(model, backend, options);
  Equilibrium found = search.run();
  backend.upload(found.state);
  return found;
}

}  // namespace phyxel
