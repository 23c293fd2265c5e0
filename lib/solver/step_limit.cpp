#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "solver/start_vector.hpp"

namespace phyxel {
namespace {

using Vector = Eigen::VectorXd;

/// K x is minus the force of a displacement so small that only its linear part shows.
class CpuVibration final : public Vibration {
 public:
  CpuVibration(const Model& model, int threads)
      : model_(model), backend_(make_cpu_backend(model, Precision::double_, threads)) {
    const Eigen::Index size = 3 * static_cast<Eigen::Index>(model.size());
    previous_ = Vector::Zero(size);
    current_.resize(size);
    for (Index i = 0; i < model.size(); ++i) {
      const Vec3d start = start_component(i);
      current_.segment<3>(3 * static_cast<Eigen::Index>(i)) << start.x, start.y, start.z;
    }
    current_.normalize();
    state_.displacement.resize(static_cast<std::size_t>(model.size()));
    state_.velocity.resize(state_.displacement.size());
    for (Index i = 0; i < model.size(); ++i) {
      const double h = model.neighbourhood.support[i];
      if (h > 0) smallest_support_ = std::min(smallest_support_, h);
    }
  }

  double apply(double beta) override {
    double largest = 0;
    for (Index i = 0; i < model_.size(); ++i) largest = std::max(largest, displacement(i));
    // Strains of 1e-8: second-order terms are 1e-8 of the force, rounding 1e-8 of the strain.
    const double amplitude = 1e-8 * smallest_support_ / largest;
    for (Index i = 0; i < model_.size(); ++i) {
      const double scale = amplitude / std::sqrt(model_.mass[i]);
      const auto x = current_.segment<3>(3 * static_cast<Eigen::Index>(i));
      state_.displacement[i] = {scale * x[0], scale * x[1], scale * x[2]};
    }
    backend_->upload(state_);
    backend_->internal_forces(force_);
    next_ = -beta * previous_;
    for (Index i = 0; i < model_.size(); ++i) {
      const double scale = -1 / (amplitude * std::sqrt(model_.mass[i]));
      next_.segment<3>(3 * static_cast<Eigen::Index>(i)) +=
          scale * Eigen::Vector3d(force_[i].x, force_[i].y, force_[i].z);
    }
    return next_.dot(current_);
  }

  double subtract(double alpha) override {
    next_ -= alpha * current_;
    return next_.norm();
  }

  void advance(double norm) override {
    previous_.swap(current_);
    current_ = next_ / norm;
  }

 private:
  double displacement(Index i) const {
    return current_.segment<3>(3 * static_cast<Eigen::Index>(i)).norm() / std::sqrt(model_.mass[i]);
  }
  const Model& model_;
  std::unique_ptr<Backend> backend_;
  Vector previous_, current_, next_;
  State state_;
  std::vector<Vec3d> force_;
  double smallest_support_ = std::numeric_limits<double>::infinity();
};

/// An upper bound of the largest eigenvalue of a tridiagonal matrix that a residual `beta` may
/// continue: the Ritz value is a lower bound, an eigenvalue lies within the residual of it, and
/// adding the residual errs on the safe side.
struct Bound {
  double value, residual;
};
Bound largest_eigenvalue(const std::vector<double>& diagonal,
                         const std::vector<double>& off_diagonal, double beta) {
  const auto map = [](const std::vector<double>& v) {
    return Eigen::Map<const Vector>(v.data(), static_cast<Eigen::Index>(v.size()));
  };
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> ritz;
  ritz.computeFromTridiagonal(map(diagonal), map(off_diagonal));
  const auto last = static_cast<Eigen::Index>(diagonal.size()) - 1;
  return {ritz.eigenvalues()[last], beta * std::abs(ritz.eigenvectors()(last, last))};
}

double smallest_sound_step(const Model& model) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const Part& part : model.parts) {
    const double c = pressure_wave_speed(part.material);
    for (Index i = part.begin; i < part.end; ++i) {
      const double h = model.neighbourhood.support[i];
      if (h > 0) smallest = std::min(smallest, h / c);
    }
  }
  return smallest;
}

StepLimit step_limit(const Model& model, Vibration& vibration) {
  StepLimit limit;
  limit.sound_step = smallest_sound_step(model);
  std::vector<double> diagonal, off_diagonal;
  double beta = 0;
  const auto most = std::min<std::int64_t>(120, 3 * static_cast<std::int64_t>(model.size()));
  for (std::int64_t k = 0; k < most; ++k) {
    const double alpha = vibration.apply(beta);
    diagonal.push_back(alpha);
    beta = vibration.subtract(alpha);
    if (!std::isfinite(alpha) || !std::isfinite(beta)) {
      limit.omega_max = std::numeric_limits<double>::quiet_NaN();  // earlier ones say nothing
      break;
    }
    const auto [value, residual] = largest_eigenvalue(diagonal, off_diagonal, beta);
    limit.omega_max = std::sqrt(std::max(0.0, value + residual));
    limit.iterations = static_cast<int>(k) + 1;
    if (residual <= 0.002 * value || beta <= 1e-12 * value) break;
    off_diagonal.push_back(beta);
    vibration.advance(beta);
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

}  // namespace

StepLimit step_limit(const Model& model, int threads) {
  CpuVibration vibration(model, threads);
  return step_limit(model, vibration);
}

StepLimit step_limit(const Model& model, Backend& backend) {
  const std::unique_ptr<Vibration> vibration = backend.vibration();
  return vibration ? step_limit(model, *vibration) : step_limit(model, backend.threads());
}

}  // namespace phyxel
