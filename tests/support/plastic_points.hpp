/// What holds of every law that flows at a point: closed forms under uniaxial stress, the
/// yield surface, turning bodies, the balance of work, the derivative of the energy, lanes of
/// packs, and the bound of wave speeds.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "solver/pack.hpp"
#include "support/deformations.hpp"
#include "support/laws.hpp"

namespace phyxel::testing {

/// First Piola stress of a step of `dt` [s] that ends at F. Not inlined: laws are long, and tests
/// have many calls.
template <class Law>
[[gnu::noinline]] M3 stress_at(const Law& law, const M3& f, typename Law::State& state, double dt) {
  return eigen(law.first_piola_stress(grad_u(f), state, dt));
}
/// What a law has turned into heat since the virgin state [J/m³].
template <class Real, class Law>
Real heat_of(const Law& law, const typename Law::State& state) {
  return plastic_work<Real>(law, state) + viscous_work<Real>(law, state);
}
/// Von Mises equivalent of the Kirchhoff stress P Fᵀ.
inline double von_mises_of(const M3& p, const M3& f) {
  const M3 tau = p * f.transpose();
  return std::sqrt(1.5) * (tau - tau.trace() / 3 * M3::Identity()).norm();
}

/// Pulls and presses a bar in turns, with ε̄ as parameter: the logarithmic strain is τ/E + ε_p along
/// and -ν τ/E - ε_p/2 across, and where it flows τ is ± the flow stress.
/// @param flow_stress function of ε̄, of Δε̄ of the step and of the time step [s]
/// @param look called after each step with the state, ε̄ and Δε̄
template <class Law, class FlowStress, class Look>
void expect_uniaxial_cycles(const Law& law, double young, double poisson, double dt,
                            const FlowStress& flow_stress, const Look& look,
                            int steps_of_flow = 100) {
  typename Law::State state;
  double plastic = 0, equivalent = 0;
  const auto at = [&](double tau, double increment) {
    const double along = tau / young + plastic;
    const double across = -poisson * tau / young - plastic / 2;
    const M3 f = V3(std::exp(along), std::exp(across), std::exp(across)).asDiagonal();
    const M3 kirchhoff = stress_at(law, f, state, dt) * f.transpose();
    // Rounding of strains of 0.1 is 1e-17, which E magnifies; that of the plastic part adds up over
    // 700 steps. A law that solves its scalar equation by iteration may add as much.
    EXPECT_NEAR(kirchhoff(0, 0), tau, 1e-11 * young);
    EXPECT_NEAR(kirchhoff(1, 1), 0, 1e-11 * young);
    EXPECT_NEAR(kirchhoff(2, 2), 0, 1e-11 * young);
    EXPECT_NEAR(state.equivalent_plastic_strain, equivalent, 1e-11);
    EXPECT_NEAR(law.energy(grad_u(f), state), tau * tau / (2 * young),
                1e-11 * std::abs(tau) + 1e-25 * young);
    look(state, equivalent, increment);
  };
  double sign = 1;
  for (const double amount : {0.05, 0.1, 0.2, 0.02, 0.5}) {
    const double yield = sign * law.flow_stress(state);  // at slow rates
    for (int k = 1; k < 20; ++k) at(yield * (k / 10.0 - 1), 0);
    for (int k = 0; k < steps_of_flow; ++k) {
      const double increment = amount / steps_of_flow;
      equivalent += increment, plastic += sign * increment;
      at(sign * flow_stress(equivalent, increment, dt), increment);
    }
    sign = -sign;
  }
}

/// Steps at random, of stretches up to five times each other.
/// @param flow_stress function of the state after a step, of its Δε̄ and of the temperature rise
/// before it
template <class Law, class FlowStress>
void expect_yield_surface(const Law& law, double dt, const FlowStress& flow_stress) {
  Deformations any(3);
  int flowed = 0;
  for (int k = 0; k < 2000; ++k) {
    typename Law::State state;
    for (int step = 0; step < 3; ++step) {
      const typename Law::State before = state;
      const M3 f = any.gradient(0.4, 2.2);
      const double q = von_mises_of(stress_at(law, f, state, dt), f);
      const double increment = state.equivalent_plastic_strain - before.equivalent_plastic_strain;
      double warm = 0;
      if constexpr (requires { before.temperature_rise; }) warm = before.temperature_rise;
      const double flow = flow_stress(state, increment, warm);
      ASSERT_GE(increment, 0);
      // Rounding of a trial of strain 1 over a flow stress of E/300, and what the iteration leaves.
      EXPECT_LE(q, flow * (1 + 1e-9));
      if (!(increment > 0)) continue;
      EXPECT_NEAR(q / flow, 1, 1e-9);
      ++flowed;
    }
  }
  EXPECT_GT(flowed, 5000);  // of 6,000
}

/// Turns a body by another rotation in each step, and its axes by one.
template <class Law>
void expect_rotation_invariance(const Law& law, double young, double dt) {
  Deformations any(6);
  const M3 axes = any.rotation();
  typename Law::State plain, turned, other_axes;
  M3 f = M3::Identity(), rate = any.noise(1);
  for (int k = 0; k < 400; ++k) {
    if (k % 16 == 0) {
      rate = any.noise(1);
      rate -= rate.trace() / 3 * M3::Identity();
    }
    f = ((M3::Identity() + 0.003 * rate) * f).eval();
    const M3 q = any.rotation(), p = stress_at(law, f, plain, dt);
    const double condition = f.norm() * f.inverse().norm();
    // 400 steps of rounding, magnified by E and by the stretches.
    const double rounding = 2e-14 * young * condition * condition;
    EXPECT_LE(distance(stress_at(law, q * f, turned, dt), q * p), rounding);
    EXPECT_LE(distance(stress_at(law, f * axes, other_axes, dt), p * axes), rounding);
  }
  EXPECT_GT(heat_of<double>(law, plain), 0);
}

/// Stored energy and plastic work add up to the work that was done around a loop of shear and
/// stretch, with an error that falls as the step does. @param coarse error in 2,000 steps
template <class Law>
void expect_balance_of_work(const Law& law, double duration, double coarse = 2e-3) {
  const auto imbalance = [&](int steps) {
    typename Law::State state;
    M3 last_f = M3::Identity(), last_p = M3::Zero();
    double work = 0;
    for (int k = 1; k <= steps; ++k) {
      const double t = 2 * M_PI * k / steps;
      M3 f = M3::Identity();
      f(0, 0) += 0.1 * std::sin(t), f(0, 1) += 0.2 * (1 - std::cos(t)),
          f(2, 1) += 0.1 * std::sin(2 * t);
      const M3 p = stress_at(law, f, state, duration / steps);
      work += 0.5 * (p + last_p).cwiseProduct(f - last_f).sum();
      last_f = f, last_p = p;
    }
    return std::abs(work / (law.energy(grad_u(last_f), state) + heat_of<double>(law, state)) - 1);
  };
  // First order where steps cross the yield surface, second elsewhere.
  EXPECT_LE(imbalance(2000), coarse);
  EXPECT_LE(imbalance(20000), 0.11 * coarse);
}

/// ∂ψ/∂F by differences, at histories and deformations at random.
template <class Law>
void expect_gradient_of_energy(const Law& law) {
  Deformations any(8);
  for (int k = 0; k < 200; ++k) {
    typename Law::State state;
    stress_at(law, any.gradient(0.7, 1.5), state, 1e-3);
    const M3 f = any.gradient(0.8, 1.3);
    const auto energy = [&](const M3& at) { return law.energy(grad_u(at), state); };
    // Fourth-order differences of an energy of 100: 1e-12 of curvature, 1e-14/1e-3 of rounding.
    EXPECT_LE(distance(eigen(law.elastic_stress(grad_u(f), state)), gradient_of(energy, f, 5e-4)),
              1e-7);
  }
}

/// A pack of W states and deformations gives each lane the bits of a scalar.
template <template <class> class Law, class T, int W>
void expect_lanes_to_have_the_bits_of_scalars(const Material& material, double dt) {
  using P = Pack<T, W>;
  using State = typename Law<T>::State;
  constexpr int numbers = history_numbers<Law<T>, T>;
  Deformations any(10);
  const Law<T> scalar = law_of<Law<T>>(material);
  const auto wide = packed<Law<P>, P>(scalar);
  typename Law<P>::State lanes;
  State states[W];
  M3 f[W];
  for (auto& each : f) each = M3::Identity();
  for (int k = 0; k < 200; ++k) {
    Mat3<T> g[W];
    for (int l = 0; l < W; ++l) {
      f[l] = ((M3::Identity() + any.noise(l % 3 == 0 ? 1e-4 : 0.01)) * f[l]).eval();
      g[l] = grad_u<T>(f[l]);
    }
    const Mat3<P> together = packed_matrices<P>(g);
    const Mat3<P> p = wide.first_piola_stress(together, lanes, P(dt));
    const P energy = wide.energy(together, lanes), dissipated = heat_of<P>(wide, lanes);
    for (int l = 0; l < W; ++l) {
      const Mat3<T> expected = scalar.first_piola_stress(g[l], states[l], T(dt));
      for (int e = 0; e < 9; ++e) EXPECT_EQ(p(e / 3, e % 3)[l], expected(e / 3, e % 3));
      T values[numbers];
      std::memcpy(values, &states[l], sizeof(values));
      for (int n = 0; n < numbers; ++n) EXPECT_EQ((lane_of<T, P>(lanes, n, l)), values[n]);
      EXPECT_EQ(energy[l], scalar.energy(g[l], states[l]));
      EXPECT_EQ(dissipated[l], heat_of<T>(scalar, states[l]));
    }
  }
}

/// The bound of wave speeds holds for elastic unloading and for flow, after histories at random.
/// @param strong the law with a flow stress that is never reached
template <class Law>
void expect_wave_bound(const Law& law, const Law& strong) {
  Deformations any(11);
  for (int k = 0; k < 40; ++k) {
    typename Law::State state;
    stress_at(law, any.gradient(0.7, 1.5), state, 1e-3);
    const M3 f = any.gradient(0.6, 1.6);
    stress_at(law, f, state, 1e-3);
    const double bound = law.wave_stiffness(principal_stretches(grad_u(f)));
    for (const Law& each : {law, strong}) {
      const auto stress = [&](const M3& at) {
        typename Law::State same = state;
        return stress_at(each, at, same, 1e-3);
      };
      // Central differences at 1e-5 leave 1e-8.
      EXPECT_GE(bound, largest_wave_stiffness(stress, f, any) * (1 - 1e-6));
    }
  }
}

}  // namespace phyxel::testing
