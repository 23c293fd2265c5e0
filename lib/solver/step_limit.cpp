#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "model/owned_vectors.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/fracture.hpp"
#include "phyxel/solver.hpp"
#include "solver/contact_stiffness.hpp"
#include "solver/host_threads.hpp"
#include "solver/start_vector.hpp"
#include "stage.hpp"

namespace phyxel {
namespace {

/// Stiffness operator on the host. K x is minus the difference of the forces at two displacements
/// so close that it is linear; histories are fixed, since unloading is elastic. On a share, vectors
/// hold the values of this rank's phyxels, and products sum over all ranks.
class HostVibration final : public Vibration {
 public:
  /// @param present state about which forces are linearised, ghosts included
  /// @param distance size of the displacement in differences [m]
  HostVibration(const Model& model, Backend& backend, const State& present, double distance)
      : model_(model),
        backend_(backend),
        vectors_(model, host_threads(backend)),
        present_(present),
        moved_(present),
        prescribed_(prescribed_axes(model)),
        previous_(vectors_.make()),
        current_(vectors_.make()),
        next_(vectors_.make()),
        distance_(distance) {
    backend_.put_displacements(present_.displacement);
    backend_.internal_forces(there_, HistoryUse::frozen);
    double length = start();
    if (!(length > 0)) {  // no component is free
      std::ranges::fill(prescribed_, char{0});
      length = start();
    }
    vectors_.for_each([&](Index i) { current_[i] = current_[i] / length; });
  }
  HostVibration(const Model&, Backend&, State&&, double) = delete;  // kept by reference
  HostVibration(const HostVibration&) = delete;
  HostVibration& operator=(const HostVibration&) = delete;

  double apply(double beta) override {
    const double largest =
        vectors_.largest([&](Index i) { return norm(current_[i]) / std::sqrt(model_.mass[i]); });
    const double amplitude = distance_ / largest;
    vectors_.for_each([&](Index i) {
      moved_.displacement[i] =
          present_.displacement[i] + (amplitude / std::sqrt(model_.mass[i])) * current_[i];
    });
    vectors_.refresh_ghosts(moved_.displacement);
    backend_.put_displacements(moved_.displacement);
    backend_.internal_forces(force_, HistoryUse::frozen);
    vectors_.for_each([&](Index i) {
      const Vec3d product =
          (-1 / (amplitude * std::sqrt(model_.mass[i]))) * (force_[i] - there_[i]);
      next_[i] = free_components(product, prescribed_[i]) - beta * previous_[i];
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
  /// Fills `current` with the free components of random numbers. @returns |current|
  double start() {
    vectors_.for_each([&](Index i) {
      current_[i] = free_components(start_component(model_.global_id(i)), prescribed_[i]);
    });
    return std::sqrt(vectors_.product(current_, current_));
  }

  const Model& model_;
  Backend& backend_;
  OwnedVectors vectors_;
  const State& present_;
  State moved_;
  std::vector<char> prescribed_;  ///< `prescribed_axes`.
  OwnedVectors::Vector previous_, current_, next_;
  std::vector<Vec3d> there_, force_;
  double distance_;  // [m]
};

/// Strain in differences at rest: second-order terms are 1e-8 of the force, rounding 1e-8 of the
/// strain.
constexpr double strain_at_rest = 1e-8;
/// Strain in differences about a deformed state. Cancellation of the stresses there costs 1e-4 of
/// the difference in float; second-order terms are 3e-3 of it.
constexpr double strain_at_work = 3e-3;

State at_rest(const Model& model) {
  State state;
  state.displacement.resize(static_cast<std::size_t>(model.size()));
  state.velocity.resize(state.displacement.size());
  state.dt = 1;
  return state;
}

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
  if (model.share) smallest = model.share->communicator->smallest(smallest);
  return smallest;
}

constexpr const char* stage_name = "largest time step";

/// The largest eigenfrequency, with a bound of its error.
struct Frequency {
  double omega = 0;  ///< [rad/s]; NaN where a force is not finite.
  int iterations = 0;
};
/// @param tolerance of the largest eigenvalue
/// @param stage receives the progress of the search; may be null
Frequency largest_frequency(const Model& model, Vibration& vibration, double tolerance,
                            Stage* stage = nullptr) {
  Frequency found;
  std::vector<double> diagonal, off_diagonal;
  double beta = 0;
  const auto most =
      std::min<std::int64_t>(120, 3 * static_cast<std::int64_t>(model.global_count()));
  for (std::int64_t k = 0; k < most; ++k) {
    const double alpha = vibration.apply(beta);
    diagonal.push_back(alpha);
    beta = vibration.subtract(alpha);
    if (!std::isfinite(alpha) || !std::isfinite(beta)) {
      found.omega = std::numeric_limits<double>::quiet_NaN();  // earlier values are meaningless
      break;
    }
    const auto [value, residual] = largest_eigenvalue(diagonal, off_diagonal, beta);
    found = {std::sqrt(std::max(0.0, value + residual)), static_cast<int>(k) + 1};
    if (residual <= tolerance * value || beta <= 1e-12 * value) break;
    // The residual falls by about as much in each iteration.
    if (stage) {
      stage->reach(std::max(static_cast<double>(k + 1) / static_cast<double>(most),
                            std::log(residual / value) / std::log(tolerance)));
    }
    off_diagonal.push_back(beta);
    vibration.advance(beta);
  }
  return found;
}

/// The largest eigenfrequency of a model and of the springs that contact may add: squares of
/// frequencies add to each other at most. Of a share: collective.
/// @param omega of the model alone [rad/s]
double with_contact(const Model& model, double omega) {
  const double of_contact = contact_frequency(model);
  return of_contact > 0 && omega > 0 ? std::hypot(omega, of_contact) : omega;
}

/// The largest stable step of a model whose largest frequency is `omega` [rad/s] while it is whole.
double largest_step(const Model& model, double omega) {
  const double share = model.fracture.acts() ? breaking_step_share : 1;
  return share * stable_step(omega, largest_viscosity(model));
}

StepLimit step_limit(const Model& model, Vibration& vibration, Stage& stage) {
  StepLimit limit;
  limit.sound_step = smallest_sound_step(model);
  const Frequency found = largest_frequency(model, vibration, 0.002, &stage);
  limit.omega_max = with_contact(model, found.omega);
  limit.iterations = found.iterations;
  if (!(limit.omega_max > 0) || !std::isfinite(limit.omega_max)) {
    const std::string why =
        fmt::format("nothing in this model resists deformation (largest eigenfrequency {}): {}",
                    limit.omega_max,
                    model.degenerate.none() ? "check the material" : model.degenerate.describe());
    if (model.share) throw AgreedError(ExitCode::bad_input, why);
    throw InputError(why);
  }
  limit.largest_step = largest_step(model, limit.omega_max);
  stage.finish();
  return limit;
}

}  // namespace

double viscous_step_share(double relaxation_time, double omega) {
  const double ratio = relaxation_time * omega / 2;  // damping ratio ξ
  return 1 / (std::hypot(1, ratio) + ratio);         // √(1 + ξ²) - ξ without its cancellation
}

double stable_step(double omega, double relaxation_time) {
  return 2 / omega * (relaxation_time > 0 ? viscous_step_share(relaxation_time, omega) : 1);
}

double largest_viscosity(const Model& model) {
  double largest = 0;
  for (const Part& part : model.parts) largest = std::max(largest, part.material.viscosity);
  return model.share ? model.share->communicator->largest(largest) : largest;
}

StepLimit step_limit(const Model& model, int threads) {
  Stage stage(stage_name);
  const std::unique_ptr<Backend> backend = make_cpu_backend(model, Precision::double_, threads);
  const double distance =
      strain_at_rest * OwnedVectors(model, backend->threads()).smallest_support();
  const State rest = at_rest(model);
  HostVibration vibration(model, *backend, rest, distance);
  return step_limit(model, vibration, stage);
}

StepLimit step_limit(const Model& model, Backend& backend) {
  check_fits(model, backend);
  const std::unique_ptr<Vibration> vibration = backend.vibration();
  if (!vibration) return step_limit(model, backend.threads());
  Stage stage(stage_name);
  return step_limit(model, *vibration, stage);
}

StepLimit present_step_limit(const Model& model, Backend& backend) {
  const OwnedVectors vectors(model, host_threads(backend));
  const double distance = strain_at_work * vectors.smallest_support();
  Frequency found;
  if (const std::unique_ptr<Vibration> on_device = backend.vibration_at_present(distance)) {
    found = largest_frequency(model, *on_device, 0.02);
  } else {
    State present;
    backend.download(present);
    vectors.refresh_ghosts(present.displacement);
    HostVibration vibration(model, backend, present, distance);
    found = largest_frequency(model, vibration, 0.02);
    backend.put_displacements(present.displacement);
  }
  StepLimit limit;
  limit.omega_max = with_contact(model, found.omega);
  limit.largest_step = largest_step(model, limit.omega_max);
  limit.iterations = found.iterations;
  return limit;
}

}  // namespace phyxel
