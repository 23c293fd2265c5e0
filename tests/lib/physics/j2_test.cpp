/// Finite-strain J2 plasticity at a point, against closed forms and against the textbook's
/// algorithm.
#include "support/j2.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

namespace phyxel {
namespace {

using namespace phyxel::testing;
using namespace phyxel::testing::j2;
using testing::j2::State;  // not that of a model

/// The factor L of C_p⁻¹ that a state holds.
M3 factor(const State& s) {
  M3 l;
  l << 1 + s.xx, 0, 0, s.yx, 1 + s.yy, 0, s.zx, s.zy, 1 + s.zz;
  return l;
}

/// De Souza Neto, Perić and Owen 2008, box 14.3, in C_p⁻¹, by eigenvectors and bisection.
struct Oracle {
  J2Parameters p;
  M3 plastic = M3::Identity();  ///< C_p⁻¹
  double equivalent = 0;

  M3 stress(const M3& f) {
    const double mu = p.young / (2 * (1 + p.poisson)), k = p.young / (3 * (1 - 2 * p.poisson));
    const M3 b = f * plastic * f.transpose();
    const Eigen::SelfAdjointEigenSolver<M3> solver(0.5 * (b + b.transpose()));
    const V3 strain = 0.5 * solver.eigenvalues().array().log();
    const M3 n = solver.eigenvectors();
    const double trace = strain.sum();
    V3 e = strain.array() - trace / 3;
    const double q = 2 * mu * std::sqrt(1.5) * e.norm();
    if (q > flow_stress(p, equivalent)) {
      double low = 0, high = q / (3 * mu);
      for (int i = 0; i < 200; ++i) {
        const double middle = 0.5 * (low + high);
        (q - 3 * mu * middle > flow_stress(p, equivalent + middle) ? low : high) = middle;
      }
      e *= 1 - 3 * mu * low / q;
      equivalent += low;
      const V3 now = (2 * (e.array() + trace / 3)).exp();
      const M3 inverse = f.inverse();
      plastic = inverse * n * now.asDiagonal() * n.transpose() * inverse.transpose();
    }
    const V3 tau = 2 * mu * e + V3::Constant(k * trace);
    return n * tau.asDiagonal() * n.transpose() * f.inverse().transpose();
  }
};

/// Small steps at random from rest, some plastic, some not.
template <class Visit>
void wander(Deformations& any, int steps, double size, const Visit& visit) {
  M3 f = M3::Identity(), rate = any.noise(1);
  for (int k = 0; k < steps; ++k) {
    if (k % 16 == 0) rate = deviator(any.noise(1)) + 0.05 * any.uniform(-1, 1) * M3::Identity();
    f = ((M3::Identity() + size * rate) * f).eval();
    visit(f);
  }
}

/// One bar, pulled and pressed in turns: with ε̄ as parameter everything is closed. Total
/// logarithmic strain τ/E + ε_p along, -ν τ/E - ε_p/2 across.
TEST(J2, UniaxialCyclesAreTheClosedForm) {
  for (const J2Parameters& p : {linear, voce, perfect}) {
    const Law law = law_of<Law>(p);
    State state;
    double plastic = 0, equivalent = 0;
    const auto at = [&](double tau) {
      const double along = tau / p.young + plastic;
      const double across = -p.poisson * tau / p.young - plastic / 2;
      const M3 f = V3(std::exp(along), std::exp(across), std::exp(across)).asDiagonal();
      const M3 kirchhoff = stress(law, f, state) * f.transpose();
      // Strains of order 0.1 have a rounding of 1e-17, which E magnifies; the plastic part adds up
      // that of 700 steps.
      EXPECT_NEAR(kirchhoff(0, 0), tau, 1e-11 * p.young);
      EXPECT_NEAR(kirchhoff(1, 1), 0, 1e-11 * p.young);
      EXPECT_NEAR(kirchhoff(2, 2), 0, 1e-11 * p.young);
      EXPECT_NEAR(state.equivalent_plastic_strain, equivalent, 1e-12);
      EXPECT_NEAR(law.energy(grad_u(f), state), tau * tau / (2 * p.young),
                  1e-11 * p.yield_stress * p.yield_stress / p.young);
    };
    double sign = 1, last = 0;
    for (const double amount : {0.05, 0.1, 0.2, 0.02, 0.5}) {
      // The elastic part, between two yield points: slope E.
      const double yield = sign * flow_stress(p, equivalent);
      for (int k = 1; k < 20; ++k) at(last + (yield - last) * k / 20.0 * (1 - 1e-12));
      for (int k = 0; k < 100; ++k) {
        equivalent += amount / 100, plastic += sign * amount / 100;
        last = sign * flow_stress(p, equivalent);
        at(last);
      }
      sign = -sign;
    }
  }
}

TEST(J2, SlopeAfterYieldIsThatOfSpringsInSeries) {
  const Law law = law_of<Law>(linear);
  // The step that ends at τ = σ₀ + H ε̄: ln s = τ/E + ε̄, so that dτ/d ln s = E H/(E + H).
  State state;
  const auto axial = [&](double strain) {
    const double tau =
        (linear.yield_stress + linear.hardening * strain) / (1 + linear.hardening / linear.young);
    const double across = -linear.poisson * tau / linear.young - (strain - tau / linear.young) / 2;
    const M3 f = V3(std::exp(strain), std::exp(across), std::exp(across)).asDiagonal();
    return (stress(law, f, state) * f.transpose())(0, 0);
  };
  const double before = axial(0.1), after = axial(0.2);
  // Both known to 1e-13.
  EXPECT_NEAR((after - before) / 0.1,
              linear.young * linear.hardening / (linear.young + linear.hardening), 1e-9);
}

TEST(J2, SimpleShearOfAPerfectlyPlasticBodyKeepsItsStressForEver) {
  const Law law = law_of<Law>(perfect);
  State state;
  const double y = perfect.yield_stress;
  double last = 0;
  for (int k = 1; k <= 5000; ++k) {
    M3 f = M3::Identity();
    f(0, 1) = 1e-3 * k;
    const M3 p = stress(law, f, state), tau = p * f.transpose();
    if (k < 10) continue;
    // Rounding of F and L up to 5, magnified by E/σ₀ = 300 and stretches: 1e-12.
    EXPECT_NEAR(von_mises(p, f) / y, 1, 1e-10) << k;
    EXPECT_NEAR(tau.trace(), 0, 1e-10) << k;
    // Laws that integrate a rate of stress oscillate by the order of y; here the shear stress falls
    // short of y/√3 by elastic strains only, squared, and never turns back.
    EXPECT_NEAR(tau(0, 1), y / std::sqrt(3), 1e-2 * y);
    EXPECT_NEAR(tau(0, 1), k > 20 ? last : tau(0, 1), 1e-4 * y);
    last = tau(0, 1);
  }
  // Plastic strain of a steady shear: γ/√3, less the elastic part σ₀/(3 μ) and what 2% of turning
  // of the elastic strain leaves.
  EXPECT_NEAR(state.equivalent_plastic_strain, 5 / std::sqrt(3), 0.02);
}

TEST(J2, IsTheTextbooksAlgorithm) {
  Deformations any(2);
  for (const J2Parameters& p : {linear, voce, perfect}) {
    const Law law = law_of<Law>(p);
    for (int run = 0; run < 10; ++run) {
      Oracle oracle{p};
      State state;
      wander(any, 200, run % 2 == 0 ? 0.003 : 0.05, [&](const M3& f) {
        const M3 expected = oracle.stress(f), found = stress(law, f, state);
        const double condition = f.norm() * f.inverse().norm();
        // The oracle takes inverses: its error grows with the square of the ratio of stretches, and
        // adds up over 200 steps.
        EXPECT_LE(distance(found, expected), 1e-14 * condition * condition * 10 * p.young);
        EXPECT_NEAR(state.equivalent_plastic_strain, oracle.equivalent,
                    1e-12 * condition * condition);
        const M3 l = factor(state);
        // The product of two factors, whose own error counts twice; seen: 1.8e-12 with clang.
        EXPECT_LE(distance(l * l.transpose(), oracle.plastic), 4e-12 * condition * condition);
      });
    }
  }
}

TEST(J2, EndsOnTheYieldSurfaceAfterStepsOfAnySize) {
  Deformations any(3);
  for (const J2Parameters& p : {linear, voce, perfect}) {
    const Law law = law_of<Law>(p);
    int flowed = 0;
    for (int k = 0; k < 2000; ++k) {
      State state;
      for (int step = 0; step < 3; ++step) {
        const double before = state.equivalent_plastic_strain;
        const M3 f = any.gradient(0.4, 2.2);
        const M3 first = stress(law, f, state);
        const State after = state;
        const double q = von_mises(first, f);
        EXPECT_LE(q, law.flow_stress(after.equivalent_plastic_strain) * (1 + 1e-10));
        if (after.equivalent_plastic_strain > before) {
          ++flowed;
          EXPECT_NEAR(q / law.flow_stress(after.equivalent_plastic_strain), 1, 1e-10);
        }
        // The history is consistent: the same F again is elastic, to rounding.
        const M3 again = stress(law, f, state);
        EXPECT_LE(distance(first, again), 1e-11 * p.young);
        EXPECT_NEAR(state.equivalent_plastic_strain, after.equivalent_plastic_strain, 1e-12);
        // The closed form of the increment, to 1e-12 of the flow stress.
        EXPECT_NEAR(law.flow_stress(after.equivalent_plastic_strain),
                    flow_stress(p, after.equivalent_plastic_strain), 1e-14);
      }
    }
    EXPECT_GT(flowed, 5900);  // of 6,000
  }
}

TEST(J2, VocesIncrementIsExactForSteepSaturationToo) {
  Deformations any(4);
  for (int k = 0; k < 2000; ++k) {
    J2Parameters p = voce;
    const double mu = p.young / (2 * (1 + p.poisson));
    p.saturation_rate = std::exp(any.uniform(0, 6));
    // Up to the steepness that is promised: δ (σ_∞ - σ₀) = 3 μ.
    p.saturation_stress = p.yield_stress + any.uniform(0, 3) * mu / p.saturation_rate;
    const Law law = law_of<Law>(p);
    const M3 f = any.rotation() * M3(V3(0.1, -0.05, -0.05).array().exp().matrix().asDiagonal()) *
                 any.rotation();
    State state;
    const double q = von_mises(stress(law, f, state), f);
    const double trial = 2 * mu * std::sqrt(1.5) * V3(0.1, -0.05, -0.05).norm();
    const double e = state.equivalent_plastic_strain;
    // All of the trial's stress: rounding of 10 GPa is 2e-15.
    EXPECT_NEAR(trial - 3 * mu * e, flow_stress(p, e), 1e-12 * trial);
    EXPECT_NEAR(q, flow_stress(p, e), 1e-12 * trial);
  }
}

TEST(J2, FlowKeepsTheVolumeForEver) {
  Deformations any(5);
  const Law law = law_of<Law>(linear);
  const J2<float> single = law_of<J2<float>>(linear);
  for (const double size : {0.002, 0.1}) {
    State state;
    J2<float>::State in_single;
    for (int run = 0; run < 20; ++run) {
      wander(any, 500, size, [&](const M3& f) {
        if (f.norm() * f.inverse().norm() > 300) return;
        stress(law, f, state);
        single.first_piola_stress(grad_u<float>(f), in_single, 1);
        // Rounding of the diagonal of L, whatever the number of steps before.
        EXPECT_NEAR((1 + state.xx) * (1 + state.yy) * (1 + state.zz), 1, 2e-15);
        EXPECT_NEAR((1.0 + in_single.xx) * (1.0 + in_single.yy) * (1.0 + in_single.zz), 1, 1e-6);
      });
    }
    EXPECT_GT(state.equivalent_plastic_strain, 1);
  }
}

TEST(J2, TurningBodiesOrAxesChangesNothing) {
  Deformations any(6);
  const Law law = law_of<Law>(voce);
  const M3 third = Eigen::AngleAxisd(2 * M_PI / 3, V3(1, 1, 1).normalized()).toRotationMatrix();
  const M3 axes = any.rotation();
  State plain, turned, axes_turned, at_random;
  wander(any, 400, 0.003, [&](const M3& f) {
    const M3 q = any.rotation(), p = stress(law, f, plain);
    const double condition = f.norm() * f.inverse().norm();
    // 400 steps of rounding, magnified by E and by the stretches.
    const double rounding = 1e-14 * voce.young * condition * condition;
    EXPECT_LE(
        distance(stress(law, third * f * third.transpose(), turned), third * p * third.transpose()),
        rounding);
    EXPECT_LE(distance(stress(law, f * axes, axes_turned), p * axes), rounding);
    // By another rotation in each step.
    EXPECT_LE(distance(stress(law, q * f, at_random), q * p), rounding);
    EXPECT_NEAR(at_random.zx, plain.zx, 1e-12);
  });
  EXPECT_GT(plain.equivalent_plastic_strain, 0.1);
}

TEST(J2, WorkIsStoredOrDissipated) {
  Deformations any(7);
  for (const J2Parameters& p : {linear, voce}) {
    const Law law = law_of<Law>(p);
    const auto imbalance = [&](int steps) {
      State state;
      M3 last_f = M3::Identity(), last_p = M3::Zero();
      double work = 0, flow_work = 0, last_e = 0;
      for (int k = 1; k <= steps; ++k) {
        const double t = 2 * M_PI * k / steps;
        M3 f = M3::Identity();
        f(0, 0) += 0.1 * std::sin(t), f(0, 1) += 0.2 * (1 - std::cos(t)),
            f(2, 1) += 0.1 * std::sin(2 * t);
        const M3 at = stress(law, f, state);
        work += 0.5 * (at + last_p).cwiseProduct(f - last_f).sum();
        last_f = f, last_p = at;
        const double e = state.equivalent_plastic_strain;
        flow_work += 0.5 * (flow_stress(p, last_e) + flow_stress(p, e)) * (e - last_e);
        last_e = e;
      }
      // The closed form is the integral of the flow stress (trapezia: second order in the step).
      EXPECT_NEAR(law.plastic_work(state) / flow_work, 1, 3.0 * voce.saturation_rate / steps);
      return std::abs(work / (law.energy(grad_u(last_f), state) + law.plastic_work(state)) - 1);
    };
    // First order where steps cross the yield surface, second elsewhere.
    EXPECT_LE(imbalance(2000), 2e-3);
    EXPECT_LE(imbalance(20000), 1e-4);
  }
}

TEST(J2, StressIsTheDerivativeOfTheStoredEnergyAtAFrozenHistory) {
  Deformations any(8);
  const Law law = law_of<Law>(linear);
  Law strong = law;
  strong.yield_stress = strong.saturation_stress = 1e6;
  for (int k = 0; k < 200; ++k) {
    State state;
    stress(law, any.gradient(0.7, 1.5), state);
    const M3 f = any.gradient(0.8, 1.3);
    State same = state;
    const auto energy = [&](const M3& at) { return law.energy(grad_u(at), state); };
    // Fourth-order differences of an energy of 100: 1e-12 of curvature, 1e-14/1e-3 of rounding.
    EXPECT_LE(distance(stress(strong, f, same), gradient_of(energy, f, 5e-4)), 1e-7);
    EXPECT_EQ(same.equivalent_plastic_strain, state.equivalent_plastic_strain);
    EXPECT_EQ(same.yx, state.yx);
  }
}

}  // namespace
}  // namespace phyxel
