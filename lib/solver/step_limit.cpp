#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "solver/owned_vectors.hpp"
#include "solver/start_vector.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// K x is minus the force of a displacement so small that only its linear part shows. Of a share,
/// vectors have its own phyxels, and their products those of all ranks.
class CpuVibration final : public Vibration {
 public:
  CpuVibration(const Model& model, int threads)
      : model_(model),
        backend_(make_cpu_backend(model, Precision::double_, threads)),
        vectors_(model, backend_->threads()),
        previous_(vectors_.make()),
        current_(vectors_.make()),
        next_(vectors_.make()),
        smallest_support_(vectors_.smallest_support()) {
    vectors_.for_each([&](Index i) { current_[i] = start_component(model.number(i)); });
    const double length = std::sqrt(vectors_.product(current_, current_));
    vectors_.for_each([&](Index i) { current_[i] = current_[i] / length; });
    state_.displacement = vectors_.make();
    state_.velocity = vectors_.make();
  }

  double apply(double beta) override {
    const double largest =
        vectors_.largest([&](Index i) { return norm(current_[i]) / std::sqrt(model_.mass[i]); });
    // Strains of 1e-8: second-order terms are 1e-8 of the force, rounding 1e-8 of the strain.
    const double amplitude = 1e-8 * smallest_support_ / largest;
    vectors_.for_each([&](Index i) {
      state_.displacement[i] = (amplitude / std::sqrt(model_.mass[i])) * current_[i];
    });
    vectors_.refresh_ghosts(state_.displacement);
    backend_->upload(state_);
    backend_->internal_forces(force_);
    vectors_.for_each([&](Index i) {
      next_[i] = (-1 / (amplitude * std::sqrt(model_.mass[i]))) * force_[i] - beta * previous_[i];
    });
    return vectors_.product(next_, current_);
  }

  double subtract(double alpha) override {
    vectors_.for_each([&](Index i) { next_[i] -= alpha * current_[i]; });
    return std::sqrt(vectors_.product(next_, next_));
  }

  void advance(double norm) override {
    previous_.swap(current_);
    vectors_.for_each([&](Index i) { current_[i] = next_[i] / norm; });
  }

 private:
  const Model& model_;
  std::unique_ptr<Backend> backend_;
  OwnedVectors vectors_;
  OwnedVectors::Vector previous_, current_, next_;
  State state_;
  std::vector<Vec3d> force_;
  double smallest_support_;
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
    return Eigen::Map<const Eigen::VectorXd>(v.data(), static_cast<Eigen::Index>(v.size()));
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
  if (model.share) smallest = model.share->others->smallest(smallest);
  return smallest;
}

constexpr const char* stage_name = "largest time step";

StepLimit step_limit(const Model& model, Vibration& vibration, Stage& stage) {
  constexpr double accuracy = 0.002;  // of the largest eigenvalue
  StepLimit limit;
  limit.sound_step = smallest_sound_step(model);
  std::vector<double> diagonal, off_diagonal;
  double beta = 0;
  const auto most = std::min<std::int64_t>(120, 3 * static_cast<std::int64_t>(model.whole_size()));
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
    if (residual <= accuracy * value || beta <= 1e-12 * value) break;
    // The residual falls by about as much in each iteration.
    stage.reach(std::max(static_cast<double>(k + 1) / static_cast<double>(most),
                         std::log(residual / value) / std::log(accuracy)));
    off_diagonal.push_back(beta);
    vibration.advance(beta);
  }
  if (!(limit.omega_max > 0) || !std::isfinite(limit.omega_max)) {
    const std::string why =
        fmt::format("nothing in this model resists deformation (largest eigenfrequency {}): {}",
                    limit.omega_max,
                    model.degenerate.none() ? "check the material" : model.degenerate.describe());
    if (model.share) throw AgreedError(ExitCode::bad_input, why);
    throw InputError(why);
  }
  limit.largest_step = 2 / limit.omega_max;
  stage.finish();
  return limit;
}

}  // namespace

StepLimit step_limit(const Model& model, int threads) {
  Stage stage(stage_name);
  CpuVibration vibration(model, threads);
  return step_limit(model, vibration, stage);
}

StepLimit step_limit(const Model& model, Backend& backend) {
  const std::unique_ptr<Vibration> vibration = backend.vibration();
  if (!vibration) return step_limit(model, backend.threads());
  Stage stage(stage_name);
  return step_limit(model, *vibration, stage);
}

}  // namespace phyxel
