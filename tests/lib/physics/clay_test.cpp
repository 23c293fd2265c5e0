/// Müller's plastic state with its creep, at a point.
#include "phyxel/physics/laws/clay.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <string>

#include "support/plastic_points.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;
using Law = Clay<double>;

struct Dough {
  double young = 10, poisson = 0.3, yield = 0.02, creep = 0, limit = 1, volume = 0;

  operator Material() const {  // NOLINT: tests hand these to what takes materials
    Material m{.young = young, .poisson = poisson, .law = "clay"};
    m.parameters = {{"yield_strain", yield},
                    {"creep_time", creep},
                    {"plastic_limit", limit},
                    {"plastic_volume", volume}};
    return m;
  }
};

M3 tensor(const Sym3<double>& s) {
  M3 m;
  m << s.xx, s.xy, s.xz, s.xy, s.yy, s.yz, s.xz, s.yz, s.zz;
  return m;
}
M3 green(const M3& f) { return 0.5 * (f.transpose() * f - M3::Identity()); }
/// The part of a strain that may flow.
M3 flowing(const M3& strain, double volume) {
  return strain - (1 - volume) * strain.trace() / 3 * M3::Identity();
}

/// The law as the papers write it, with Eigen.
struct Oracle {
  Dough p;
  M3 plastic = M3::Zero();

  M3 stress(const M3& f, double dt) {
    const M3 trial = green(f) - plastic, e = flowing(trial, p.volume);
    const double excess = e.norm() - p.yield;
    const double share = p.creep > 0 ? 1 - std::exp(-dt / p.creep) : 1;
    M3 next = plastic;
    if (excess > 0) next += share * excess / e.norm() * e;
    if (next.norm() > p.limit) next *= p.limit / next.norm();
    const double mu = p.young / (2 * (1 + p.poisson)),
                 lambda = p.young * p.poisson / ((1 + p.poisson) * (1 - 2 * p.poisson));
    const auto second_piola = [&](const M3& left) {
      return M3(lambda * left.trace() * M3::Identity() + 2 * mu * left);
    };
    plastic = next;
    return f * second_piola(green(f) - plastic);
  }
};

TEST(Clay, IsThePapersAlgorithm) {
  Deformations any(2);
  for (const Dough& p : {Dough{}, Dough{.creep = 0.3}, Dough{.limit = 0.1}, Dough{.volume = 1},
                         Dough{.creep = 0.1, .limit = 0.2, .volume = 0.5}}) {
    const Law law = law_of<Law>(p);
    Oracle oracle{p};
    Law::State state;
    for (int k = 0; k < 300; ++k) {
      const M3 f = any.gradient(0.7, 1.4);
      const double dt = k % 10 == 0 ? 0 : any.uniform(0, 0.2);
      // Rounding of E ε of order 10, which steps of flow pass on without growth.
      EXPECT_LE(distance(stress_at(law, f, state, dt), oracle.stress(f, dt)), 1e-12 * p.young);
      EXPECT_LE(distance(tensor(state.plastic_strain), oracle.plastic), 1e-13);
    }
  }
}

/// What is stretched beyond yield and let go stays longer; what is not, does not.
TEST(Clay, KeepsAStretchAfterRelease) {
  const Law law = law_of<Law>(Dough{});
  for (const double stretch : {0.01, 0.5}) {
    Law::State state;
    stress_at(law, V3(1 + stretch, 1, 1).asDiagonal(), state, 1);
    // Release: the stretches for which all stresses are zero, where E = ε_p.
    const M3 p = tensor(state.plastic_strain);
    EXPECT_NEAR(p.trace(), 0, 1e-16);
    const V3 left = (M3::Identity() + 2 * p).diagonal().cwiseSqrt();
    EXPECT_LE(stress_at(law, left.asDiagonal(), state, 1).norm(), 1e-14);
    if (stretch < 0.02) {
      EXPECT_EQ(p.norm(), 0);
      continue;
    }
    // The deviator of E less the yield strain: length |dev E| - yield, two thirds of it along x.
    const double e = 0.5 * (1.5 * 1.5 - 1), length = std::sqrt(2.0 / 3) * e - 0.02;
    EXPECT_NEAR(left[0], std::sqrt(1 + 2 * std::sqrt(2.0 / 3) * length), 1e-14);
  }
}

TEST(Clay, PlasticStrainNeverPassesItsLimit) {
  Deformations any(3);
  const auto check = [&](auto zero) {
    using T = decltype(zero);
    for (const double limit : {0.0, 1e-3, 0.1, 0.7}) {
      const auto law = law_of<Clay<T>>(Dough{.creep = 0.01, .limit = limit, .volume = 0.3});
      typename Clay<T>::State state;
      double longest = 0;
      for (int k = 0; k < 2000; ++k) {
        law.first_piola_stress(grad_u<T>(any.gradient(0.5, 2)), state, T(0.02));
        const double length =
            tensor({state.plastic_strain.xx, state.plastic_strain.xy, state.plastic_strain.xz,
                    state.plastic_strain.yy, state.plastic_strain.yz, state.plastic_strain.zz})
                .norm();
        ASSERT_LE(length, static_cast<double>(static_cast<T>(limit)));
        longest = std::max(longest, length);
      }
      EXPECT_GE(longest, limit * (1 - 1e-6));  // and it is reached
    }
  };
  check(0.0), check(0.0F);
}

/// At a fixed E the excess decays as exp(-t/τ), in however many steps.
TEST(Clay, CreepDoesNotDependOnTheStep) {
  const Dough p{.creep = 0.2};
  const Law law = law_of<Law>(p);
  M3 f = M3::Identity();
  f(0, 1) = 0.3, f(2, 2) = 1.1;
  const M3 e = flowing(green(f), 0);
  for (const int steps : {1, 7, 100}) {
    Law::State state;
    for (int k = 0; k < steps; ++k) stress_at(law, f, state, 0.5 / steps);
    const double excess = (e - tensor(state.plastic_strain)).norm() - p.yield;
    // The closed form; each step rounds.
    EXPECT_NEAR(excess, (e.norm() - p.yield) * std::exp(-0.5 / p.creep), 1e-15 * (1 + steps));
  }
  Law::State rest;
  stress_at(law, f, rest, 0);
  EXPECT_EQ(tensor(rest.plastic_strain).norm(), 0);
  stress_at(law, f, rest, endless_time);
  EXPECT_NEAR((e - tensor(rest.plastic_strain)).norm(), p.yield, 1e-15);
}

TEST(Clay, TurningBodiesChangesNothing) {
  expect_rotation_invariance(law_of<Law>(Dough{.creep = 1e-3}), Dough{}.young, 1e-3);
}
TEST(Clay, WorkIsStoredOrDissipated) {
  expect_balance_of_work(law_of<Law>(Dough{}), 1);
  // The heat of a creeping step is that of the stress at its end: first order in the step.
  expect_balance_of_work(law_of<Law>(Dough{.creep = 0.1, .volume = 1}), 1, 1.5e-2);
}

/// Flow never gives energy back if it keeps to deviators: each step's work is heat.
TEST(Clay, HeatOnlyGrows) {
  Deformations any(5);
  for (const Dough& p : {Dough{.limit = 0.2}, Dough{.creep = 0.3, .limit = 0.2}}) {
    const Law law = law_of<Law>(p);
    Law::State state;
    for (int k = 0; k < 2000; ++k) {
      const double before = state.plastic_work;
      stress_at(law, any.gradient(0.6, 1.6), state, 0.05);
      EXPECT_GE(state.plastic_work, before - 1e-14 * p.young);
    }
    EXPECT_GT(state.plastic_work, 0.01 * p.young);
  }
}

TEST(Clay, StressIsTheDerivativeOfTheStoredEnergyAtAFrozenHistory) {
  expect_gradient_of_energy(law_of<Law>(Dough{.creep = 1e-3}));
}
/// Within yield, the law is Hooke's of the strain that is left, with the bits of its elastic
/// stress.
TEST(Clay, ElasticStepsHaveTheBitsOfStVenantKirchhoffs) {
  Deformations any(1);
  const Law law = law_of<Law>(Dough{});
  const StVenantKirchhoff<double> elastic{law.hooke};
  for (int k = 0; k < 500; ++k) {
    const Mat3d g = mat3(any.noise(3e-3));
    Law::State state;
    const Mat3d p = law.first_piola_stress(g, state, 0.1), expected = elastic.first_piola_stress(g);
    for (int e = 0; e < 9; ++e) EXPECT_EQ(p(e / 3, e % 3), expected(e / 3, e % 3));
    EXPECT_EQ(state.plastic_work, 0);
  }
}
TEST(Clay, LanesOfAPackHaveTheBitsOfScalars) {
  expect_lanes_to_have_the_bits_of_scalars<Clay, float, 16>(Dough{.creep = 0.02}, 0.01);
  expect_lanes_to_have_the_bits_of_scalars<Clay, double, 8>(Dough{.creep = 0.02}, 0.01);
  expect_lanes_to_have_the_bits_of_scalars<Clay, double, 8>(Dough{.limit = 0.05, .volume = 1}, 0);
}
TEST(Clay, WaveStiffnessIsBounded) {
  for (const Dough& p : {Dough{.limit = 0.3}, Dough{.limit = 0.3, .volume = 1}}) {
    Law strong = law_of<Law>(p);
    strong.yield_strain = 1e6;
    expect_wave_bound(law_of<Law>(p), strong);
  }
}

TEST(Clay, RefusesWhatCannotBeAndSaysWhy) {
  EXPECT_EQ(law_refusal(Dough{}), "");
  EXPECT_THAT(law_refusal(Dough{.yield = 0}),
              HasSubstr("yield_strain = 0 found; allowed: 1e-09 <= yield_strain <= 10"));
  EXPECT_THAT(law_refusal(Dough{.creep = -1}),
              HasSubstr("creep_time = -1 found; allowed: 0 <= creep_time <= 1e+12 [s]"));
  EXPECT_THAT(law_refusal(Dough{.limit = 11}),
              HasSubstr("plastic_limit = 11 found; allowed: 0 <="));
  EXPECT_THAT(law_refusal(Dough{.volume = 2}),
              HasSubstr("plastic_volume = 2 found; allowed: 0 <= plastic_volume <= 1"));
}

}  // namespace
}  // namespace phyxel
