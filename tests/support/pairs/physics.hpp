/// What holds after any combination has taken its steps, whatever its factors: checks of forces,
/// energies, momenta and the method's own equations, by the CPU's forces in double on the whole
/// model.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <random>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/history.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/reactions.hpp"
#include "phyxel/solver.hpp"
#include "support/clouds.hpp"
#include "support/laws.hpp"
#include "support/pairs/combinations.hpp"

namespace phyxel::testing {

/// A few steps of a combination, and the answers of its backend after them.
struct Course {
  State before, after;              ///< Before and after the last step.
  std::vector<Vec3d> force;         ///< Internal forces after it [N], shape [n].
  Diagnostics energies;             ///< After it.
  std::vector<Reaction> reactions;  ///< After it.
};

/// Takes six steps of Verlet's method, two implicit ones, or one search for equilibrium. Collective
/// on a share.
/// @param external the caller's forces [N], shape [n], or none
inline Course course_of(const Combination& row, const Model& model, Backend& backend,
                        const State& start, const std::vector<Vec3d>& external) {
  backend.set_external_forces(external);
  Solver solver(model, backend, start, row.time_method());
  Course course;
  if (row.is(method, "verlet")) solver.step(5);
  if (row.is(method, "implicit")) solver.step(1);
  course.before = solver.state();
  solver.step();
  course.after = solver.state();
  backend.internal_forces(course.force);
  course.energies = diagnose(model, backend, solver);
  course.reactions = find_reactions(model, backend, solver);
  return course;
}

/// Raises `largest` to a value. A value that is not a number stays, so that comparisons with
/// `largest` fail; std::max would drop it.
inline void raise(double& largest, double value) {
  if (std::isnan(value) || value > largest) largest = value;
}

inline double largest_of(const std::vector<Vec3d>& vectors) {
  double largest = 0;
  for (const Vec3d& v : vectors) raise(largest, norm(v));
  return largest;
}

/// The checks of one course of the whole model.
class Physics {
 public:
  Physics(const Combination& row, const Model& whole, const Course& course,
          const std::vector<Vec3d>& external)
      : row_(row),
        whole_(whole),
        course_(course),
        external_(external),
        reference_(make_cpu_backend(whole, Precision::double_, 1)) {}

  void check() {
    check_finite();
    check_reference();
    check_energy_gradient();
    check_momenta();
    if (row_.is(method, "verlet")) check_verlet();
    if (row_.is(method, "implicit")) check_implicit();
    if (row_.is(method, "equilibrium")) check_equilibrium();
    check_terms();
    if (!row_.is(method, "implicit")) check_reactions();
  }

 private:
  bool single() const { return !row_.is(precision, "double"); }
  /// Relative error of forces against the reference: none on the CPU in double, whose code is the
  /// reference's; on a GPU in double, sums are of another order; in float, 6e-8 for each of some
  /// forty neighbours through an inverse moment, 20 times as much at strains of 5% (seen: 2.5e-6).
  /// Viscous stresses divide rounded changes of strain by the step (seen: 2.1e-4).
  double force_tolerance() const {
    if (single()) return row_.has(viscosity) ? 5e-4 : 2e-5;
    return row_.on_gpu() ? 1e-11 : 0;
  }

  std::vector<Vec3d> reference_forces(const State& state) {
    reference_->upload(state);
    std::vector<Vec3d> force;
    reference_->internal_forces(force);
    return force;
  }

  /// Every value of the course is a finite number, whatever the other checks leave out.
  void check_finite() const {
    for (const auto* vectors :
         {&course_.after.displacement, &course_.after.velocity, &course_.force}) {
      EXPECT_EQ(vectors->size(), whole_.position.size());
      EXPECT_TRUE(std::isfinite(largest_of(*vectors)));
    }
    for (const HistoryColumn& column : course_.after.history) {
      const auto is_finite = [](double value) { return std::isfinite(value); };
      EXPECT_TRUE(std::all_of(column.values.begin(), column.values.end(), is_finite))
          << column.name;
    }
  }

  /// Forces and energies of the backend are those of the CPU in double at the same state.
  void check_reference() {
    const std::vector<Vec3d> expected = reference_forces(course_.after);
    const std::vector<Vec3d> free = free_axes();
    double worst = 0, of_supports = 0;
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const Vec3d off = course_.force[i] - expected[i];
      raise(worst, norm(along(free[i], off)));
      raise(of_supports, norm(off));
    }
    EXPECT_LE(worst, force_tolerance() * largest_of(expected));
    // A phyxel inside a support, in a thin wedge under the surface, has a fit that is far stiffer
    // than others, but does not move (seen: 1.8e-4 in float).
    EXPECT_LE(of_supports, 50 * force_tolerance() * largest_of(expected));
    const Diagnostics d = diagnose(whole_, *reference_, 0, 1), &e = course_.energies;
    const double stored = d.elastic_energy() + d.plastic_work;
    for (const auto& [expected_energy, found] :
         {std::pair{d.strain_energy, e.strain_energy}, std::pair{d.volume_energy, e.volume_energy},
          std::pair{d.hourglass_energy, e.hourglass_energy},
          std::pair{d.plastic_work, e.plastic_work}, std::pair{d.viscous_work, e.viscous_work}}) {
      EXPECT_NEAR(found, expected_energy, std::max(force_tolerance(), 1e-12) * stored);
    }
  }

  /// Forces are minus the derivative of the energy along a random direction. What a law with a
  /// history turns into heat is a part of that energy, since its flow minimises the sum. Without an
  /// interval, strains have no rate, and viscosity no stress.
  void check_energy_gradient() {
    State state = course_.after;
    state.history_interval = 0;
    const std::vector<Vec3d> force = reference_forces(state);
    std::mt19937_64 engine(5);
    std::vector<Vec3d> direction;
    double expected = 0, scale = 0;
    for (const Vec3d& f : force) {
      direction.push_back(uniform_vector(engine, 1));
      expected += dot(f, direction.back());
      scale += norm(f) * norm(direction.back());
    }
    const auto energy_at = [&](double distance) {
      State moved = state;
      for (std::size_t i = 0; i < force.size(); ++i) {
        moved.displacement[i] += distance * direction[i];
      }
      reference_->upload(moved);
      const Diagnostics d = diagnose(whole_, *reference_, 0, 1);
      return d.elastic_energy() + d.plastic_work;
    };
    // Central differences over 1e-6 of a spacing: rounding of the energy, 1e-16 / 1e-7 (seen: 2e-10
    // of the forces). A body at rest has two hundredths of the force of one phyxel, E h, over the
    // step (seen: 1.1). That of a phyxel that flows has another second derivative forwards than
    // back, by up to E h, with signs at random: n of them add up to sqrt(n) E h (seen: a tenth).
    // The yield surface is reached to some digits only (seen: 6e-5 at 1e-7, 4e-9 at 1e-8).
    const double jump =
        has_law_with_history() ? std::sqrt(static_cast<double>(force.size())) : 2e-2;
    const auto misses_by = [&](double step) {
      const double slope = (energy_at(step) - energy_at(-step)) / (2 * step);
      return std::abs(expected + slope) / (1e-9 * scale + jump * 1e5 * 0.08 * step);
    };
    EXPECT_LE(has_law_with_history() ? std::min(misses_by(1e-7), misses_by(1e-8)) : misses_by(1e-7),
              1);
  }

  /// The work of viscous forces, which are those that a zero interval leaves out, is what viscosity
  /// turns into heat. @param state at the end of a step, with the history at its start
  /// @param moved displacements of the step [m]
  void check_viscous_work(State state, const std::vector<Vec3d>& moved) {
    // What relaxes in a step turns energy into heat that no force in the step has brought in.
    if (!row_.has(viscosity) || relaxes(whole_)) return;
    // Strain is quadratic in displacements: the error is the change of strain, of which a tenth of
    // the step leaves little.
    const double share = 0.1;
    for (std::size_t i = 0; i < moved.size(); ++i) {
      state.displacement[i] -= (1 - share) * moved[i];
    }
    state.history_interval *= share;
    const std::vector<Vec3d> with = reference_forces(state);
    const double heat = diagnose(whole_, *reference_, 0, 1).viscous_work;
    state.history_interval = 0;
    const std::vector<Vec3d> without = reference_forces(state);
    const double heat_before = diagnose(whole_, *reference_, 0, 1).viscous_work;
    double work = 0;
    for (std::size_t i = 0; i < with.size(); ++i) {
      work += dot(with[i] - without[i], share * moved[i]);
    }
    EXPECT_LT(work, 0);
    EXPECT_NEAR(heat - heat_before, -work, 0.03 * -work);  // seen: 0.017
  }

  /// Internal forces have neither a sum nor, but for laws that are linear, a torque: only the
  /// rounding of each force is left (seen: 5e-8 of their magnitudes in float, 1e-16 in double).
  void check_momenta() {
    const Diagnostics& d = course_.energies;
    const double rounding = single() ? 5e-7 : 1e-14;
    EXPECT_LE(norm(d.internal_force), rounding * d.force_scale);
    if (has_linear_law()) return;
    EXPECT_LE(norm(d.internal_torque), rounding * d.torque_scale);
  }

  /// True if a law of a part has a history of its own, beside that of viscosity.
  bool has_law_with_history() const {
    return std::any_of(whole_.parts.begin(), whole_.parts.end(), [](const Part& part) {
      Material material = part.material;
      material.viscosity = 0;
      return !history_names(material).empty();
    });
  }
  /// True if a law of a part knows small rotations only.
  bool has_linear_law() const {
    for (const Part& part : whole_.parts) {
      for (const LawEntry& entry : law_table()) {
        const Material& m = part.material;
        if (entry.is_linear && !m.custom_law && m.law == entry.name) return true;
      }
    }
    return false;
  }

  /// The share of a load at a time [s]: the mean of its points, weighted by how near they are.
  static double share_of(const Load& load, double time) {
    const auto& points = load.curve.points;
    if (points.empty()) return 1;
    if (time <= points.front().time) return points.front().factor;
    for (std::size_t k = 1; k < points.size(); ++k) {
      const auto [t0, f0] = points[k - 1];
      const auto [t1, f1] = points[k];
      if (time < t1) return ((t1 - time) * f0 + (time - t0) * f1) / (t1 - t0);
    }
    return points.back().factor;
  }

  /// Gravity, loads and the caller's forces [N] at a time [s] and at displacements.
  std::vector<Vec3d> applied_at(double time, const State& state) const {
    std::vector<Vec3d> force = external_;
    force.resize(whole_.position.size());
    for (Index i = 0; i < whole_.size(); ++i) force[i] += whole_.mass[i] * whole_.gravity;
    for (const Load& load : whole_.loads) {
      const double share = share_of(load, time);
      for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
        if (!load.follows) force[load.phyxels[k]] += share * load.force[k];
      }
    }
    for (const Following& f : whole_.following) {
      const Load& load = whole_.loads[f.load];
      const double share = share_of(load, time);
      std::vector<Eigen::Vector3d> acting, place;
      for (std::size_t k = 0; k < f.entry.size(); ++k) {
        Eigen::Matrix3d deformation = Eigen::Matrix3d::Identity();
        for (Offset e = f.near.offsets[k]; e < f.near.offsets[k + 1]; ++e) {
          deformation +=
              vector_of(state.displacement[f.near.indices[e]]) * vector_of(f.slope[e]).transpose();
        }
        // Nanson's formula, J F⁻ᵀ of the force at rest.
        const Eigen::Vector3d now = deformation.determinant() * deformation.inverse().transpose() *
                                    vector_of(share * load.force[f.entry[k]]);
        const Index i = load.phyxels[f.entry[k]];
        acting.push_back(now);
        place.push_back(vector_of(whole_.position[i] + state.displacement[i]));
      }
      if (load.closed) balance(acting, place, load, f, std::abs(share));
      for (std::size_t k = 0; k < f.entry.size(); ++k) {
        force[load.phyxels[f.entry[k]]] += Vec3d{acting[k][0], acting[k][1], acting[k][2]};
      }
    }
    return force;
  }
  /// Takes force and torque from forces on a closed surface: six unknowns a and b, with the change
  /// w (a + b × x) of each force, w being the size of the force at rest.
  static void balance(std::vector<Eigen::Vector3d>& force,
                      const std::vector<Eigen::Vector3d>& place, const Load& load,
                      const Following& f, double share) {
    using Matrix = Eigen::Matrix<double, 6, 6>;
    using Rows = Eigen::Matrix<double, 3, 6>;
    using Vector = Eigen::Matrix<double, 6, 1>;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& x : place) mean += x / static_cast<double>(place.size());
    const auto crossed = [](const Eigen::Vector3d& v) {
      Eigen::Matrix3d m;
      m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
      return m;
    };
    Matrix matrix = Matrix::Zero();
    Vector left = Vector::Zero();
    std::vector<Rows> change;
    for (std::size_t k = 0; k < force.size(); ++k) {
      const Eigen::Matrix3d arm = crossed(place[k] - mean);
      Rows& rows = change.emplace_back();
      rows << Eigen::Matrix3d::Identity(), -arm;
      rows *= share * norm(load.force[f.entry[k]]);
      Matrix both;
      both << rows, arm * rows;
      matrix += both;
      left.head<3>() -= force[k];
      left.tail<3>() -= arm * force[k];
    }
    const Vector unknown = matrix.fullPivLu().solve(left);
    for (std::size_t k = 0; k < force.size(); ++k) force[k] += change[k] * unknown;
  }
  static Eigen::Vector3d vector_of(Vec3d v) { return {v.x, v.y, v.z}; }
  /// Damping of each phyxel [1/s].
  std::vector<double> damping_rates() const {
    std::vector<double> rates(whole_.position.size());
    for (const Part& part : whole_.parts) {
      std::fill(rates.begin() + part.begin, rates.begin() + part.end, part.material.damping);
    }
    return rates;
  }
  /// Reactions are masses times prescribed accelerations, less all other forces, along the axes of
  /// each motion; at equilibrium there are no accelerations.
  void check_reactions() {
    const State& state = course_.after;
    const bool steps = row_.is(method, "verlet");
    const std::vector<Vec3d> force = reference_forces(state),
                             applied = applied_at(
                                 steps ? state.time : std::numeric_limits<double>::infinity(),
                                 state);
    const std::vector<double> damping_of = damping_rates();
    ASSERT_EQ(course_.reactions.size(), whole_.motions.size());
    for (std::size_t k = 0; k < whole_.motions.size(); ++k) {
      const Motion& motion = whole_.motions[k];
      const Reaction& found = course_.reactions[k];
      const double dt = state.dt;
      const Path now = motion.path_at(state.time), next = motion.path_at(state.time + dt);
      Vec3d sum, torque;
      double scale = 0;  // of the terms of the sum [N]
      for (const Index i : motion.phyxels) {
        Vec3d reaction = -(force[i] + applied[i]);
        scale += norm(force[i]) + norm(applied[i]);
        if (steps) {
          const double c = damping_of[i], keep = std::exp(-c * dt),
                       gain = c > 0 ? (1 - keep) / c : dt;
          const Vec3d x = whole_.position[i], change = (next.at(x) - now.at(x)) / dt;
          reaction += (whole_.mass[i] / gain) * (change - keep * state.velocity[i]);
          scale += whole_.mass[i] / gain * (norm(change) + norm(state.velocity[i]));
        }
        reaction = motion.along_axes(reaction, {});
        sum += reaction;
        torque += cross(whole_.position[i] + state.displacement[i] - found.centre, reaction);
      }
      // Bodies are shorter than a metre.
      const double rounding = std::max(force_tolerance(), 1e-13) * scale;
      EXPECT_LE(norm(found.force - sum), rounding) << found.set;
      EXPECT_LE(norm(found.torque - torque), rounding) << found.set;
      EXPECT_TRUE(motion.stands_still() ? found.work == 0
                                        : found.work != 0 && std::isnan(found.work) == !steps);
    }
  }
  /// 1 along free axes.
  std::vector<Vec3d> free_axes() const {
    std::vector<Vec3d> free(whole_.position.size(), {1, 1, 1});
    for (const Motion& motion : whole_.motions) {
      for (const Index i : motion.phyxels) free[i] = motion.along_axes({}, free[i]);
    }
    return free;
  }
  static Vec3d along(Vec3d axes, Vec3d v) { return {axes.x * v.x, axes.y * v.y, axes.z * v.z}; }

  /// Prescribed phyxels are on their paths. @param rounding of displacements [m]
  void check_paths(double time, double rounding) {
    for (const Motion& motion : whole_.motions) {
      const Path path = std::isinf(time) ? motion.path_after(1) : motion.path_at(time);
      for (const Index i : motion.phyxels) {
        const Vec3d u = course_.after.displacement[i];
        EXPECT_LE(norm(motion.along_axes(path.at(whole_.position[i]), u) - u), rounding) << i;
      }
    }
  }

  /// v⁺ = v e^{-c Δt} + (1 - e^{-c Δt})/c (f + applied)/m and u⁺ = u + Δt v⁺ along free axes.
  void check_verlet() {
    const State &before = course_.before, &after = course_.after;
    const double dt = before.dt;
    const std::vector<Vec3d> force = reference_forces(before),
                             applied = applied_at(before.time, before), free = free_axes();
    const std::vector<double> damping_of = damping_rates();
    // Displacements are a tenth of a metre, velocities ten times as many metres per second.
    const double rounding = row_.is(precision, "float") ? 1e-8 : 1e-16;
    // Pairs round their forces by shares of the largest, whatever the mass of the phyxel that they
    // act on: phyxels at the ends of supports have a tenth of the mass of others. Viscous forces
    // divide rounded changes of strain by the step (seen: 1.7e-13 of the largest force).
    const double force_rounding = std::max(force_tolerance(), row_.has(viscosity) ? 1e-12 : 1e-13) *
                                  std::max(largest_of(force), largest_of(applied));
    double worst = 0, off = 0;
    for (Index i = 0; i < whole_.size(); ++i) {
      const double c = damping_of[i], keep = std::exp(-c * dt), gain = c > 0 ? (1 - keep) / c : dt;
      const double per_force = gain / whole_.mass[i];
      const Vec3d next = keep * before.velocity[i] + per_force * (force[i] + applied[i]);
      raise(worst, norm(along(free[i], after.velocity[i] - next)) /
                       (per_force * force_rounding + 40 * rounding));
      raise(off, norm(along(free[i], after.displacement[i] - before.displacement[i] -
                                         dt * after.velocity[i])));
    }
    EXPECT_LE(worst, 1);
    EXPECT_LE(off, rounding);
    check_paths(after.time, rounding);
    std::vector<Vec3d> moved;
    for (const Vec3d& v : before.velocity) moved.push_back(dt * v);
    check_viscous_work(before, moved);
  }

  /// The second stage of Alexander's method of second order, whose first stage follows from the
  /// result: m v' = f + applied - c m v at the end of the step.
  void check_implicit() {
    const State &before = course_.before, &after = course_.after;
    const double dt = before.dt, s = (1 - std::sqrt(0.5)) * dt, rest = dt - s;
    State end = after;
    end.history = before.history;
    end.history_interval = history_columns(whole_).empty() ? 0 : dt;
    const std::vector<Vec3d> force = reference_forces(end), applied = applied_at(after.time, end),
                             free = free_axes();
    const std::vector<double> damping_of = damping_rates();
    double worst = 0, largest = 0;
    for (Index i = 0; i < whole_.size(); ++i) {
      if (free[i] != Vec3d{1, 1, 1}) continue;
      const Vec3d u = before.displacement[i], v = before.velocity[i], v2 = after.velocity[i];
      const Vec3d v1 = (1 / rest) * (after.displacement[i] - s * v2 - u);
      const Vec3d a1 = (1 / s) * (v1 - v), a2 = (1 / s) * (v2 - v - rest * a1);
      const Vec3d acting = force[i] + applied[i] - damping_of[i] * whole_.mass[i] * v2;
      raise(worst, norm(whole_.mass[i] * a2 - acting));
      raise(largest, norm(acting));
    }
    // Residuals are 1e-8 of what acts on all phyxels; the way back through the first stage
    // multiplies them (seen: 5e-8).
    EXPECT_LE(worst, 1e-6 * largest);
    check_paths(after.time, 1e-15);
    std::vector<Vec3d> moved;
    for (Index i = 0; i < whole_.size(); ++i) {
      moved.push_back(after.displacement[i] - before.displacement[i]);
    }
    check_viscous_work(end, moved);
  }

  /// Forces along free axes vanish beside what is applied, reactions included.
  void check_equilibrium() {
    const std::vector<Vec3d> force = reference_forces(course_.after), free = free_axes(),
                             applied =
                                 applied_at(std::numeric_limits<double>::infinity(), course_.after);
    double left = 0, acting = 0;
    for (Index i = 0; i < whole_.size(); ++i) {
      const Vec3d sum = force[i] + applied[i];
      left += dot(along(free[i], sum), along(free[i], sum));
      acting += dot(applied[i], applied[i]) + dot(sum, sum);
    }
    EXPECT_LE(std::sqrt(left), 2e-8 * std::sqrt(acting));  // the search ends at 1e-8
    check_paths(std::numeric_limits<double>::infinity(), 1e-15);
  }

  /// No term of the combination is idle, and no other is in use.
  void check_terms() const {
    const Diagnostics& d = course_.energies;
    const bool rests = row_.is(method, "equilibrium");
    const bool strained = !rests || !row_.is(boundary, "free") || row_.has(external);
    EXPECT_EQ(d.strain_energy > 0, strained);
    EXPECT_EQ(d.volume_energy > 0, strained && row_.has(volume));
    EXPECT_EQ(d.hourglass_energy > 0, strained && row_.has_hourglass());
    EXPECT_EQ(d.viscous_work != 0, !rests && (row_.has(viscosity) || relaxes(whole_)));
    bool remembers = false;
    for (const HistoryColumn& column : course_.after.history) {
      remembers = remembers || std::any_of(column.values.begin(), column.values.end(),
                                           [](double value) { return value != 0; });
    }
    if (!rests) {
      EXPECT_EQ(remembers, has_law_with_history() || row_.has(viscosity));
    }
    EXPECT_EQ(whole_.closing.empty(), !row_.is_closed());
    EXPECT_EQ(whole_.parts.size(), row_.has(inclusions) ? 2u : 1u);
    const bool of_pairs = row_.is(supports, "supports of pairs");
    EXPECT_EQ(whole_.parts[0].pair_length > 0, of_pairs);
    EXPECT_EQ(whole_.neighbourhood.symmetric, of_pairs || row_.is(supports, "one support"));
  }

  const Combination& row_;
  const Model& whole_;
  const Course& course_;
  const std::vector<Vec3d>& external_;
  std::unique_ptr<Backend> reference_;
};

}  // namespace phyxel::testing
