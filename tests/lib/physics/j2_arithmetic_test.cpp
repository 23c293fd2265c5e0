/// J2 plasticity in the solver's arithmetic: its precisions and packs, its bound of wave speeds,
/// and values that are extreme or refused.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>

#include "solver/pack.hpp"
#include "support/j2.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using namespace phyxel::testing::j2;
using testing::j2::State;  // not that of a model

TEST(J2, ElasticStepsHaveTheBitsOfHenckysLaw) {
  Deformations any(1);
  const auto check = [&](auto zero) {
    using T = decltype(zero);
    const J2<T> law = law_of<J2<T>>(voce);
    const Hencky<T> elastic = law_of<Hencky<T>>(voce_elastic());
    for (int k = 0; k < 500; ++k) {
      const Mat3<T> g = mat3<T>(any.noise(1e-3));
      typename J2<T>::State state;
      const Mat3<T> p = law.first_piola_stress(g, state, T(0.1));
      const Mat3<T> expected = elastic.first_piola_stress(g);
      for (int e = 0; e < 9; ++e) EXPECT_EQ(p(e / 3, e % 3), expected(e / 3, e % 3));
      EXPECT_EQ(law.energy(g, state), elastic.energy(g));
      EXPECT_EQ(state.equivalent_plastic_strain, 0);
      EXPECT_EQ(state.xx, 0);
      EXPECT_EQ(law.plastic_work(state), 0);
    }
  };
  check(0.0), check(0.0F);
}

TEST(J2, SinglePrecisionHoldsTheYieldSurfaceInLargeShear) {
  const J2<float> law = law_of<J2<float>>(perfect);
  J2<float>::State state;
  for (int k = 1; k <= 5000; ++k) {
    M3 f = M3::Identity();
    f(0, 1) = 1e-3 * k;
    const Mat3<float> g = grad_u<float>(f);
    const M3 p = eigen(law.first_piola_stress(g, state, 1));
    if (k < 10) continue;
    // A rounding of F is seen as 6e-8 times γ E/σ₀, a strain of 1.5e-3 and some times that of L.
    EXPECT_NEAR(von_mises(p, M3::Identity() + eigen(g)) / perfect.yield_stress, 1, 2e-3) << k;
  }
  // 5,000 increments of 6e-4 each.
  EXPECT_NEAR(state.equivalent_plastic_strain, 5 / std::sqrt(3), 0.02);
}

TEST(J2, StaysFiniteWhereABodyIsCrushed) {
  Deformations any(9);
  const auto check = [&](auto zero) {
    using T = decltype(zero);
    const J2<T> law = law_of<J2<T>>(voce);
    for (int k = 0; k < 300; ++k) {
      typename J2<T>::State state;
      for (int step = 0; step < 5; ++step) {
        const M3 f = any.stretched(
            V3(any.uniform(-1, 2), k % 2 == 0 ? 0 : any.uniform(-0.2, 3), any.uniform(-1, 1)));
        EXPECT_TRUE(eigen(law.first_piola_stress(grad_u<T>(f), state, T(1))).allFinite());
        EXPECT_TRUE(std::isfinite(state.equivalent_plastic_strain + state.xx + state.yx + state.yy +
                                  state.zx + state.zy + state.zz));
        EXPECT_TRUE(std::isfinite(law.energy(grad_u<T>(f), state)));
      }
    }
    // Inside out: pressed back.
    typename J2<T>::State state;
    const M3 p = eigen(law.first_piola_stress(grad_u<T>(V3(1, 1, -0.2).asDiagonal()), state, T(1)));
    EXPECT_LT(p(2, 2), 0);
  };
  check(0.0), check(0.0F);
}

template <class T, int W>
void expect_lanes_to_have_the_bits_of_scalars(const J2Parameters& parameters) {
  using P = Pack<T, W>;
  Deformations any(10);
  const J2<T> scalar = law_of<J2<T>>(parameters);
  const auto wide = packed<J2<P>, P>(scalar);
  typename J2<P>::State lanes;
  typename J2<T>::State states[W];
  M3 f[W];
  for (auto& each : f) each = M3::Identity();
  for (int k = 0; k < 200; ++k) {
    Mat3<T> g[W];
    for (int l = 0; l < W; ++l) {
      f[l] = ((M3::Identity() + any.noise(l % 3 == 0 ? 1e-4 : 0.01)) * f[l]).eval();
      g[l] = grad_u<T>(f[l]);
    }
    const Mat3<P> together = packed_matrices<P>(g);
    const Mat3<P> p = wide.first_piola_stress(together, lanes, P(0.5));
    const P energy = wide.energy(together, lanes), dissipated = wide.plastic_work(lanes);
    for (int l = 0; l < W; ++l) {
      const Mat3<T> expected = scalar.first_piola_stress(g[l], states[l], T(0.5));
      for (int e = 0; e < 9; ++e) EXPECT_EQ(p(e / 3, e % 3)[l], expected(e / 3, e % 3));
      T numbers[7];
      std::memcpy(numbers, &states[l], sizeof(numbers));
      for (int n = 0; n < 7; ++n) EXPECT_EQ((lane_of<T, P>(lanes, n, l)), numbers[n]);
      EXPECT_EQ(energy[l], scalar.energy(g[l], states[l]));
      EXPECT_EQ(dissipated[l], scalar.plastic_work(states[l]));
    }
  }
}
TEST(J2, LanesOfAPackHaveTheBitsOfScalars) {
  expect_lanes_to_have_the_bits_of_scalars<float, 16>(linear);
  expect_lanes_to_have_the_bits_of_scalars<double, 8>(linear);
  expect_lanes_to_have_the_bits_of_scalars<float, 16>(voce);
  expect_lanes_to_have_the_bits_of_scalars<double, 8>(voce);
}

TEST(J2, WaveStiffnessIsBoundedAndNotByMuchMore) {
  Deformations any(11);
  for (const double hardening : {0.1, 2.0}) {
    J2Parameters p = linear;
    p.hardening = hardening;
    const Law law = law_of<Law>(p);
    const double at_rest = law.lambda + 2 * law.mu;
    // The elastic stretches may differ by q/(√3 μ) at rest, too, after a cycle.
    EXPECT_GE(law.wave_stiffness({1, 1, 1}), at_rest);
    EXPECT_LE(law.wave_stiffness({1, 1, 1}), at_rest * (1 + 2 * flow_stress(p, 10) / law.mu));
    double worst = 1;
    for (int k = 0; k < 60; ++k) {
      State state;
      // A history, then the deformation that is looked at: volumes of a third to three.
      stress(law, any.gradient(0.7, 1.5), state);
      const M3 f = any.gradient(0.6, 1.6);
      stress(law, f, state);
      Law strong = law;
      strong.yield_stress = strong.saturation_stress = 1e6;
      const auto unloading = [&](const M3& at) {
        State same = state;
        return stress(strong, at, same);
      };
      const auto either = [&](const M3& at) {
        State same = state;
        return stress(law, at, same);
      };
      const double bound = law.wave_stiffness(principal_stretches(grad_u(f)));
      const double is = largest_wave_stiffness(unloading, f, any);
      // Central differences at 1e-5 leave 1e-8.
      EXPECT_GE(bound, is * (1 - 1e-6));
      EXPECT_GE(bound, largest_wave_stiffness(either, f, any) * (1 - 1e-6));
      worst = std::max(worst, bound / is);
    }
    // Where the smallest stretch is, a wave need not be stiffest along it: the plastic part is not
    // known. Measured: 1.6.
    EXPECT_LE(worst, 2);
  }
}

TEST(J2, RefusesWhatCannotBeAndSaysWhy) {
  EXPECT_EQ(law_refusal(linear), "");
  EXPECT_EQ(law_refusal(voce), "");
  EXPECT_EQ(law_refusal(perfect), "");
  const auto refusal = [](auto change) {
    J2Parameters p = voce;
    change(p);
    return law_refusal(p);
  };
  using P = J2Parameters;
  const auto expect = [](const std::string& text, const char* name, const char* value) {
    EXPECT_NE(text.find(std::string(name) + " = " + value), std::string::npos) << text;
    EXPECT_NE(text.find("allowed: "), std::string::npos) << text;
  };
  expect(refusal([](P& p) { p.young = 0; }), "young", "0");
  expect(refusal([](P& p) { p.poisson = 0.5; }), "poisson", "0.5");
  expect(refusal([](P& p) { p.poisson = -1; }), "poisson", "-1");
  expect(refusal([](P& p) { p.yield_stress = 0; }), "yield_stress", "0");
  expect(refusal([](P& p) { p.yield_stress = -2; }), "yield_stress", "-2");
  expect(refusal([](P& p) { p.hardening = -0.1; }), "hardening", "-0.1");
  expect(refusal([](P& p) { p.saturation_stress = 0.3; }), "saturation_stress", "0.3");
  expect(refusal([](P& p) { p.saturation_rate = -1; }), "saturation_rate", "-1");
  expect(refusal([](P& p) { p.yield_stress = std::nan(""); }), "yield_stress", "nan");
}

}  // namespace
}  // namespace phyxel
