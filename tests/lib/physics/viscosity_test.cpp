/// Kelvin and Voigt's damping at a point, beside laws with and without a history.
#include "phyxel/physics/laws/viscosity.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <type_traits>

#include "phyxel/physics/laws.hpp"
#include "phyxel/physics/laws/hencky.hpp"
#include "phyxel/physics/laws/j2.hpp"
#include "solver/pack.hpp"
#include "support/deformations.hpp"
#include "support/laws.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

using Green = StVenantKirchhoff<double>;
using Damped = WithViscosity<Green, double>;
using DampedMetal = WithViscosity<J2<double>, double>;
static_assert(sizeof(Damped::State) == 7 * sizeof(double));
static_assert(sizeof(DampedMetal::State) == 14 * sizeof(double));
static_assert(sizeof(Damped) == 3 * sizeof(double));
static_assert(std::is_trivially_copyable_v<DampedMetal>);

template <class Real>
J2<Real> copper(double hardening) {
  Material m;
  m.young = 117;
  m.poisson = 0.35;
  m.parameters = {{"yield_stress", 0.4}, {"hardening", hardening}};
  return law_of<J2<Real>>(m);
}

constexpr double lambda = 1.2, mu = 0.8, relaxation = 0.05;
const Green green{{lambda, mu}};
const Damped damped{green, relaxation};

M3 viscous(const Damped& law, const M3& f, Damped::State& state, double dt) {
  return eigen(law.first_piola_stress(grad_u(f), state, dt)) -
         eigen(law.law.first_piola_stress(grad_u(f)));
}
M3 strain(const M3& f) { return 0.5 * (f.transpose() * f - M3::Identity()); }

TEST(Viscosity, StressOfASteadyStretchIsTheFormula) {
  // E = r t along x, and shear at a rate of its own: F of E(t) by its square root.
  Deformations any(1);
  for (int k = 0; k < 20; ++k) {
    M3 rate = any.noise(1);
    rate = (0.5 * (rate + rate.transpose())).eval();
    const auto gradient = [&](double t) {
      const M3 c = M3::Identity() + 2 * t * rate;
      return M3(Eigen::SelfAdjointEigenSolver<M3>(c).operatorSqrt());
    };
    Damped::State state;
    const double dt = 1e-3, eta = relaxation * mu, zeta = relaxation * (lambda + 2 * mu / 3);
    viscous(damped, gradient(0.05), state, 0);
    const M3 f = gradient(0.05 + dt);
    const M3 s =
        2 * eta * (rate - rate.trace() / 3 * M3::Identity()) + zeta * rate.trace() * M3::Identity();
    // F by eigenvectors has strains good to 1e-15: over dt and times η, with a margin of 20.
    EXPECT_LE(distance(viscous(damped, f, state, dt), f * s), 1e-12);
    // Power times dt: S_v : Ė dt.
    EXPECT_NEAR(damped.viscous_work(state), s.cwiseProduct(rate).sum() * dt, 1e-14);
    EXPECT_GT(damped.viscous_work(state), 0);
  }
}

TEST(Viscosity, ProportionalDampingIsTauTimesTheElasticStressOfTheRate) {
  // η = τ μ and ζ = τ (λ + ⅔ μ): S_v = τ C : Ė.
  const Sym3<double> rate{0.3, -0.2, 0.5, 0.1, 0.7, -0.4};
  const Mat3d found = damped.viscous_stress(rate);
  const Sym3<double> expected = relaxation * green.hooke.stress(rate);
  EXPECT_LE(distance(eigen(found), eigen(full(expected))), 1e-16);
}

TEST(Viscosity, RigidMotionCostsNothingHoweverFast) {
  Deformations any(2);
  const M3 shape = any.gradient(0.7, 1.4);
  Damped::State state;
  viscous(damped, shape, state, 0);
  for (int k = 0; k < 200; ++k) {
    const double dt = 1e-3;
    // Rounding of Green's strain, 1e-15, over dt and times 2 η: 1e-13; measured: 2.5e-13.
    EXPECT_LE(viscous(damped, any.rotation() * shape, state, dt).cwiseAbs().maxCoeff(), 1e-12);
  }
  EXPECT_LE(damped.viscous_work(state), 200 * 1e-12 * 1e-15);
}

TEST(Viscosity, TakesNoAngularMomentumAndOnlyEverTakesEnergy) {
  Deformations any(3);
  Damped::State state;
  M3 f = M3::Identity(), last = f;
  double dissipated = 0, work = 0;
  viscous(damped, f, state, 0);
  for (int k = 0; k < 2000; ++k) {
    f = (f + any.noise(1e-4) + 1e-3 * std::sin(0.01 * k) * M3(V3(1, -0.5, 0.2).asDiagonal()))
            .eval();
    const M3 p = viscous(damped, f, state, 1e-2), tau = p * f.transpose();
    // A symmetric Kirchhoff stress has no moment.
    EXPECT_LE(distance(tau, tau.transpose()), 1e-15);
    EXPECT_GE(damped.viscous_work(state), dissipated);
    dissipated = damped.viscous_work(state);
    work += p.cwiseProduct(f - last).sum();
    last = f;
  }
  EXPECT_GT(work, 0);
  // F at the end of a step and not at its middle: of first order in ΔF, 3e-4.
  EXPECT_NEAR(work / dissipated, 1, 1e-3);
}

TEST(Viscosity, WithoutAStepThereIsNoRate) {
  Deformations any(4);
  for (int k = 0; k < 100; ++k) {
    const Mat3d g = mat3(any.noise(0.2));
    Damped::State state;
    damped.first_piola_stress(mat3(any.noise(0.2)), state, 0.1);
    const double before = damped.viscous_work(state);
    const Mat3d p = damped.first_piola_stress(g, state, 0), expected = green.first_piola_stress(g);
    for (int e = 0; e < 9; ++e) EXPECT_EQ(p(e / 3, e % 3), expected(e / 3, e % 3));
    EXPECT_EQ(damped.viscous_work(state), before);
    EXPECT_EQ(damped.energy(g, state), green.energy(g));
    // The strain is that from which the next step starts.
    EXPECT_EQ(eigen(damped.first_piola_stress(g, state, 0.1)), eigen(expected));
  }
}

TEST(Viscosity, StandsBesideALawWithAHistory) {
  Deformations any(5);
  const J2<double> metal = copper<double>(0.1);
  const DampedMetal both{metal, relaxation};
  DampedMetal::State state;
  J2<double>::State alone;
  M3 f = M3::Identity(), last = M3::Zero();
  for (int k = 0; k < 200; ++k) {
    f = ((M3::Identity() + any.noise(5e-3)) * f).eval();
    const double dt = 0.1;
    const M3 p = eigen(both.first_piola_stress(grad_u(f), state, dt));
    const M3 q = eigen(metal.first_piola_stress(grad_u(f), alone, dt));
    const M3 rate = (strain(f) - last) / dt;
    last = strain(f);
    const M3 s = 2 * relaxation * metal.mu * rate +
                 relaxation * metal.lambda * rate.trace() * M3::Identity();
    EXPECT_LE(distance(p, q + f * s), 1e-12);  // rounding of 100, the stress of a rate of 1
    EXPECT_EQ(state.law.equivalent_plastic_strain, alone.equivalent_plastic_strain);
    EXPECT_EQ(both.energy(grad_u(f), state), metal.energy(grad_u(f), alone));
    EXPECT_EQ(both.plastic_work(state), metal.plastic_work(alone));
  }
  EXPECT_GT(alone.equivalent_plastic_strain, 0.01);
  EXPECT_EQ(both.wave_stiffness({1.2, 1, 0.9}), metal.wave_stiffness({1.2, 1, 0.9}));
}

TEST(Viscosity, DecrementOfAModeIsTheTextbooks) {
  // A mass of 1 on a small uniaxial strain, M = λ + 2μ: ω = √M, damping ratio ξ = τ ω/2. Verlet's
  // steps as the solver takes them: the force of the present u, and a rate from the last u.
  const double stiffness = lambda + 2 * mu, omega = std::sqrt(stiffness);
  for (const double xi : {0.01, 0.1, 0.3}) {
    const Damped law{green, 2 * xi / omega};
    Damped::State state;
    const double dt = 1e-4 / omega;
    double u = 1e-6, v = 0, last_peak = u;
    const auto force = [&](double step) {
      Mat3d g{};
      g(0, 0) = u;
      return -law.first_piola_stress(g, state, step)(0, 0);
    };
    v = 0.5 * dt * force(0);
    for (int peaks = 0; peaks < 3;) {
      u += dt * v;
      const double before = v;
      v += dt * force(dt);
      if (before > 0 && v <= 0) {
        // ln of two amplitudes: 2π ξ/√(1 - ξ²). The rate is half a step old, ω Δt/2 = 5e-5 of it.
        EXPECT_NEAR(std::log(last_peak / u) / (2 * M_PI * xi / std::sqrt(1 - xi * xi)), 1, 1e-3);
        last_peak = u, ++peaks;
      }
    }
  }
}

TEST(Viscosity, WaveViscosityIsAnUpperBound) {
  Deformations any(6);
  for (int k = 0; k < 200; ++k) {
    const M3 f = any.gradient(-0.8, 2);
    const double bound = damped.wave_viscosity(principal_stretches(grad_u(f)));
    for (int n = 0; n < 50; ++n) {
      const M3 wave = any.direction() * any.direction().transpose();
      const M3 rate = 0.5 * (f.transpose() * wave + wave.transpose() * f);
      const M3 s = relaxation * (2 * mu * rate + lambda * rate.trace() * M3::Identity());
      EXPECT_LE((f * s).cwiseProduct(wave).sum(),
                bound * (1 + 1e-7));  // stretches: an arc cosine's
    }
  }
  // λ + 2μ, times τ, at rest.
  EXPECT_NEAR(damped.wave_viscosity({1, 1, 1}), relaxation * (lambda + 2 * mu), 1e-15);
}

/// Lanes have the bits of scalars with g++, which builds the kernels. Clang adds a scalar's terms
/// in another order than a pack's (2e-6 seen in float, over twenty steps of flow).
TEST(Viscosity, LanesOfAPackAreScalars) {
  Deformations any(7);
  const auto check = [&]<class T, int W>(Pack<T, W>) {
    using P = Pack<T, W>;
    using Scalar = WithViscosity<J2<T>, T>;
    const auto metal = copper<T>(0);
    const Scalar scalar{metal, T(0.1)};
    const auto wide = packed<WithViscosity<J2<P>, P>, P>(scalar);
    typename WithViscosity<J2<P>, P>::State lanes;
    typename Scalar::State states[W];
    for (int step = 0; step < 20; ++step) {
      Mat3<T> g[W];
      for (auto& lane : g) lane = mat3<T>(any.noise(0.01));
      const T dt = step % 5 == 0 ? T(0) : T(0.01);
      const Mat3<P> p = wide.first_piola_stress(packed_matrices<P>(g), lanes, P(dt));
      for (int l = 0; l < W; ++l) {
        const Mat3<T> expected = scalar.first_piola_stress(g[l], states[l], dt);
#if defined(__clang__)
        // Stresses are some tens of the unit of the modulus, 117.
        const double tolerance = sizeof(T) == 4 ? 1e-3 : 1e-11;
#else
        const double tolerance = 0;
#endif
        const auto expect_same = [&](T lane, T alone) { EXPECT_NEAR(lane, alone, tolerance); };
        for (int e = 0; e < 9; ++e) expect_same(p(e / 3, e % 3)[l], expected(e / 3, e % 3));
        T numbers[14];
        std::memcpy(numbers, &states[l], sizeof(numbers));
        for (int n = 0; n < 14; ++n) expect_same(lane_of<T, P>(lanes, n, l), numbers[n]);
      }
    }
  };
  check(Pack<float, 16>{}), check(Pack<double, 8>{});
}

}  // namespace
}  // namespace phyxel
