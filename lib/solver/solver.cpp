#include "phyxel/solver.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

using Vector = Eigen::VectorXd;

/// y = M^-1/2 K M^-1/2 x: symmetric, with the eigenvalues of M⁻¹K. K x is minus the force of a
/// displacement so small that only its linear part shows.
class Stiffness {
 public:
  Stiffness(const Model& model, int threads)
      : model_(model), backend_(make_cpu_backend(model, Precision::double_, threads)) {
    state_.displacement.resize(static_cast<std::size_t>(model.size()));
    state_.velocity.resize(state_.displacement.size());
    for (Index i = 0; i < model.size(); ++i) {
      const double h = model.neighbourhood.support[i];
      if (h > 0) smallest_support_ = std::min(smallest_support_, h);
    }
  }

  Vector apply(const Vector& x) {
    double largest = 0;
    for (Index i = 0; i < model_.size(); ++i) {
      largest = std::max(largest, displacement(x, i));
    }
    // Strains of 1e-8: second-order terms are 1e-8 of the force, rounding 1e-8 of the strain.
    const double amplitude = 1e-8 * smallest_support_ / largest;
    for (Index i = 0; i < model_.size(); ++i) {
      const double scale = amplitude / std::sqrt(model_.mass[i]);
      state_.displacement[i] = {scale * x[3 * i], scale * x[3 * i + 1], scale * x[3 * i + 2]};
    }
    backend_->upload(state_);
    backend_->internal_forces(force_);
    Vector y(x.size());
    for (Index i = 0; i < model_.size(); ++i) {
      const double scale = -1 / (amplitude * std::sqrt(model_.mass[i]));
      y[3 * i] = scale * force_[i].x;
      y[3 * i + 1] = scale * force_[i].y;
      y[3 * i + 2] = scale * force_[i].z;
    }
    return y;
  }

 private:
  double displacement(const Vector& x, Index i) const {
    return x.segment<3>(3 * i).norm() / std::sqrt(model_.mass[i]);
  }
  const Model& model_;
  std::unique_ptr<Backend> backend_;
  State state_;
  std::vector<Vec3d> force_;
  double smallest_support_ = std::numeric_limits<double>::infinity();
};

Vector random_start(Eigen::Index size) {
  std::mt19937_64 engine(20080917);  // any fixed seed: the same limit in every run
  Vector v(size);
  for (Eigen::Index k = 0; k < size; ++k) {
    v[k] = static_cast<double>(engine() >> 11) * 0x1p-53 - 0.5;
  }
  return v.normalized();
}

}  // namespace

StepLimit step_limit(const Model& model, int threads) {
  StepLimit limit;
  limit.sound_step = std::numeric_limits<double>::infinity();
  for (const Part& part : model.parts) {
    const double c = pressure_wave_speed(part.material);
    for (Index i = part.begin; i < part.end; ++i) {
      const double h = model.neighbourhood.support[i];
      if (h > 0) limit.sound_step = std::min(limit.sound_step, h / c);
    }
  }

  Stiffness stiffness(model, threads);
  Vector previous = Vector::Zero(3 * static_cast<Eigen::Index>(model.size()));
  Vector current = random_start(previous.size());
  std::vector<double> diagonal, off_diagonal;
  double beta = 0;
  const int most = static_cast<int>(std::min<Eigen::Index>(120, current.size()));
  for (int k = 0; k < most; ++k) {
    Vector next = stiffness.apply(current) - beta * previous;
    const double alpha = next.dot(current);
    next -= alpha * current;
    diagonal.push_back(alpha);
    beta = next.norm();
    Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> ritz;
    ritz.computeFromTridiagonal(
        Eigen::Map<Vector>(diagonal.data(), static_cast<Eigen::Index>(diagonal.size())),
        Eigen::Map<Vector>(off_diagonal.data(), static_cast<Eigen::Index>(off_diagonal.size())));
    const Eigen::Index last = static_cast<Eigen::Index>(diagonal.size()) - 1;
    const double value = ritz.eigenvalues()[last];
    // The Ritz value is a lower bound; an eigenvalue lies within the residual of it. Adding the
    // residual errs on the safe side.
    const double residual = beta * std::abs(ritz.eigenvectors()(last, last));
    limit.omega_max = std::sqrt(std::max(0.0, value + residual));
    limit.iterations = k + 1;
    if (residual <= 0.002 * value || beta <= 1e-12 * value) break;
    off_diagonal.push_back(beta);
    previous = current;
    current = next / beta;
  }
  if (!(limit.omega_max > 0) || !std::isfinite(limit.omega_max)) {
    throw InputError(
        fmt::format("nothing in this model resists deformation (largest eigenfrequency {}): {}",
                    limit.omega_max,
                    model.degenerate.none() ? "check the material" : model.degenerate.describe()));
  }
  limit.largest_step = 2 / limit.omega_max;
  return limit;
}

State initial_state(const Model& model, const Scene& scene, double dt) {
  State state;
  state.dt = dt;
  state.displacement.resize(static_cast<std::size_t>(model.size()));
  state.velocity.resize(state.displacement.size());
  for (std::size_t p = 0; p < model.parts.size(); ++p) {
    const Part& part = model.parts[p];
    Vec3d centre;
    double mass = 0;
    for (Index i = part.begin; i < part.end; ++i) {
      centre += model.mass[i] * model.position[i];
      mass += model.mass[i];
    }
    if (mass > 0) centre = centre / mass;
    for (Index i = part.begin; i < part.end; ++i) {
      state.velocity[i] =
          scene.bodies[p].velocity + cross(scene.bodies[p].spin, model.position[i] - centre);
    }
  }
  // The stored velocity is that of half a step earlier: v(-dt/2) = v(0) - dt/2 a(0). At rest
  // there are no internal forces.
  for (Vec3d& v : state.velocity) v -= (dt / 2) * model.gravity;
  for (const Load& load : model.loads) {
    for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
      const Index i = load.phyxels[k];
      state.velocity[i] -= (dt / 2 * load.scale_at(0) / model.mass[i]) * load.force[k];
    }
  }
  for (const Motion& motion : model.motions) {
    for (const Index i : motion.phyxels) {
      state.displacement[i] = motion.displacement_at(0);
      state.velocity[i] = {};
    }
  }
  return state;
}

Solver::Solver(Backend& backend, const State& start)
    : backend_(backend), steps_(start.step), dt_(start.dt) {
  backend_.upload(start);
}

void Solver::step() {
  backend_.stress();              // u -> ∇u -> ε -> σ -> Q
  backend_.advance(time(), dt_);  // gather of Q -> f -> loads -> Verlet -> u⁺
  ++steps_;
}

State Solver::state() const {
  State state;
  backend_.download(state);
  state.step = steps_;
  state.dt = dt_;
  state.time = time();
  return state;
}

}  // namespace phyxel
