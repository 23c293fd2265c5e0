/// Hencky's law at a point, and the functions of symmetric tensors beneath it.
#include "phyxel/physics/laws/hencky.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <type_traits>

#include "solver/pack.hpp"
#include "support/deformations.hpp"
#include "support/laws.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

constexpr double young = 2.6, poisson = 0.3;
template <class Real>
Hencky<Real> hencky_of(double young_modulus, double poisson_ratio) {
  Material m;
  m.young = young_modulus;
  m.poisson = poisson_ratio;
  return law_of<Hencky<Real>>(m);
}
const Hencky<double> law = hencky_of<double>(young, poisson);

static_assert(std::is_trivially_copyable_v<Hencky<float>> && sizeof(Hencky<float>) == 8);

/// The law as written in its source, by eigenvectors of FᵀF - I, which squares the ratio of
/// stretches: in long double, so that its rounding does not count. For det F > 0.
struct Oracle {
  using M = Eigen::Matrix<long double, 3, 3>;
  using V = Eigen::Matrix<long double, 3, 1>;
  long double lambda, mu;
  V strain;
  M axes, f;
  Oracle(const Hencky<double>& of, const M3& grad_u)
      : lambda(of.lambda), mu(of.mu), f(M::Identity() + grad_u.cast<long double>()) {
    const M g = grad_u.cast<long double>();
    const Eigen::SelfAdjointEigenSolver<M> solver(M(g + g.transpose() + g.transpose() * g));
    axes = solver.eigenvectors();
    for (int a = 0; a < 3; ++a) strain[a] = 0.5L * std::log1p(solver.eigenvalues()[a]);
  }
  double energy() const {
    return static_cast<double>(mu * strain.squaredNorm() +
                               lambda * strain.sum() * strain.sum() / 2);
  }
  M3 stress() const {
    const V kirchhoff = 2 * mu * strain + V::Constant(lambda * strain.sum());
    const V second = kirchhoff.cwiseQuotient((2 * strain.array()).exp().matrix());
    return M(f * axes * second.asDiagonal() * axes.transpose()).cast<double>();
  }
};

M3 stress(const M3& f) { return eigen(law.first_piola_stress(grad_u(f))); }
double energy(const M3& f) { return law.energy(grad_u(f)); }

TEST(SymmetricFunctions, LogarithmKeepsItsDigits) {
  Deformations any(1);
  for (int k = 0; k < 100000; ++k) {
    // Half over the range that is promised, half near zero.
    const double x = k % 2 == 0 ? std::exp(any.uniform(std::log(0.09), std::log(4e4))) - 1
                                : std::copysign(std::exp(any.uniform(-60, -1.3)), k % 4 - 2);
    const float single = static_cast<float>(x);
    // Four roundings of the result (measured: two in double, 1.8 in float).
    EXPECT_NEAR(log_one_plus(x) / std::log1p(x), 1, 4 * 2.2e-16) << x;
    EXPECT_NEAR(log_one_plus(single) / std::log1p(static_cast<double>(single)), 1, 4 * 1.2e-7) << x;
  }
  EXPECT_EQ(log_one_plus(0.0), 0);
}

TEST(SymmetricFunctions, ExponentialKeepsItsDigits) {
  Deformations any(2);
  for (int k = 0; k < 100000; ++k) {
    const double y = std::exp(any.uniform(-30, 4));
    const float single = static_cast<float>(y);
    // Relative to the result, which is at most 1: two roundings in double, two in float.
    EXPECT_NEAR(exp_minus_one(y), std::expm1(-y), 4.5e-16 * std::min(1.0, 2 * y)) << y;
    EXPECT_NEAR(exp_minus_one(single), std::expm1(-static_cast<double>(single)),
                2.5e-7 * std::min(1.0, 2 * y))
        << y;
  }
  EXPECT_EQ(exp_minus_one(0.0), 0);
  EXPECT_NEAR(exp_minus_one(1e30), -1, 1e-15);
}

TEST(SymmetricFunctions, EigenvaluesAreThoseOfEigen) {
  Deformations any(3);
  for (int k = 0; k < 20000; ++k) {
    V3 of(any.uniform(-1, 1), any.uniform(-1, 1), 0);
    if (k % 3 == 0) of[1] = of[0] + std::exp(any.uniform(-40, 0));
    if (k % 50 == 0) of[1] = of[0];
    of[2] = -of[0] - of[1];
    const double size = std::exp(any.uniform(-30, 3));
    const M3 axes = any.rotation(), m = size * axes * of.asDiagonal() * axes.transpose();
    const auto y =
        traceless_eigenvalues<double>({m(0, 0), m(0, 1), m(0, 2), m(1, 1), m(1, 2), m(2, 2)});
    V3 found(y.isolated, y.near, y.far), expected = size * of;
    EXPECT_LE(std::abs(y.near - y.far), std::abs(y.isolated - y.near) * (1 + 1e-12));
    EXPECT_LE(std::abs(y.isolated - y.near), std::abs(y.isolated - y.far));
    std::sort(found.begin(), found.end()), std::sort(expected.begin(), expected.end());
    const double gap = std::min(expected[1] - expected[0], expected[2] - expected[1]) / size;
    // A pair a gap apart is known to the rounding error of its characteristic polynomial over the
    // gap, a double one to its root.
    EXPECT_LE((found - expected).cwiseAbs().maxCoeff() / size, 2e-15 / std::max(gap, 4e-8));
  }
}

TEST(SymmetricFunctions, ExponentialOfATracelessTensorIsTheSumOfItsSeries) {
  Deformations any(4);
  for (int k = 0; k < 3000; ++k) {
    M3 a = any.noise(1);
    a = (0.5 * (a + a.transpose())).eval();
    a -= a.trace() / 3 * M3::Identity();
    a *= (k % 2 == 0 ? 2 : std::exp(any.uniform(-30, 0))) / a.norm();
    M3 sum = M3::Zero(), term = M3::Identity();
    for (int n = 1; n < 40; ++n) sum += term = (term * a / n).eval();
    const Sym3<double> found =
        exp_minus_identity<double>({a(0, 0), a(0, 1), a(0, 2), a(1, 1), a(1, 2), a(2, 2)},
                                   0.5 * a.squaredNorm(), a.determinant());
    // Three squarings double the rounding error of the series, each: 8 roundings, of |a|; at |a| =
    // 2 the series leaves 2.5e-16.
    EXPECT_LE(distance(eigen(full(found)), sum), 8 * 2.2e-16 * sum.norm()) << a.norm();
  }
}

TEST(Hencky, IsTheLawOfItsSource) {
  Deformations any(5);
  for (int k = 0; k < 3000; ++k) {
    V3 s(any.uniform(0.2, 2), any.uniform(0.2, 2), any.uniform(0.2, 2));
    if (k % 4 == 1) s[1] = s[0] + std::exp(any.uniform(-40, -1));  // nearly equal
    if (k % 4 == 2) s[2] = s[1] = s[0];
    const M3 f = any.stretched(s);
    const Oracle oracle(law, f - M3::Identity());
    // F has a rounding error of its largest stretch, seen through (1 - ln s)/s² of the smallest;
    // some 200 of them, with those of the constants (measured: 120).
    const double rounding = 200 * 2.2e-16 * s.maxCoeff() / std::pow(s.minCoeff(), 2);
    EXPECT_LE(distance(stress(f), oracle.stress()), (law.lambda + 2 * law.mu) * rounding);
    EXPECT_NEAR(energy(f), oracle.energy(), 2 * (law.lambda + 2 * law.mu) * rounding);
  }
}

TEST(Hencky, KeepsTheDigitsOfSmallStrainsInBothPrecisions) {
  Deformations any(6);
  for (const double size : {1e-1, 1e-3, 1e-6, 1e-9, 1e-12}) {
    for (int k = 0; k < 300; ++k) {
      const Mat3<float> single = mat3<float>(any.noise(size));
      const Mat3<double> g = to<double>(single);
      const Oracle oracle({double(float(law.lambda)), double(float(law.mu))}, eigen(g));
      const Hencky<float> in_single{static_cast<float>(law.lambda), static_cast<float>(law.mu)};
      const Hencky<double> in_double{in_single.lambda, in_single.mu};
      const M3 expected = oracle.stress();
      const double largest = expected.cwiseAbs().maxCoeff();
      // Some ten roundings, whatever the size (measured: 8 in float, 10 in double).
      EXPECT_LE(distance(eigen(in_single.first_piola_stress(single)), expected),
                16 * 1.2e-7 * largest);
      EXPECT_LE(distance(eigen(in_double.first_piola_stress(g)), expected), 32 * 2.2e-16 * largest);
      EXPECT_NEAR(in_double.energy(g) / oracle.energy(), 1, 32 * 2.2e-16);
      EXPECT_NEAR(in_single.energy(single) / oracle.energy(), 1, 16 * 1.2e-7);
    }
  }
}

TEST(Hencky, IsHookesLawAtSmallStrains) {
  Deformations any(7);
  const Hooke<double> hooke{law.lambda, law.mu};
  for (int k = 0; k < 100; ++k) {
    const Mat3d g = mat3(any.noise(1e-7));
    const M3 expected = eigen(full(hooke.stress(cauchy_strain(g))));
    // What is of second order: 1e-7 of the stress, and a few times that.
    EXPECT_LE(distance(eigen(law.first_piola_stress(g)), expected), 1e-6 * expected.norm());
  }
}

TEST(Hencky, StressIsTheDerivativeOfItsEnergyAlsoInsideOut) {
  Deformations any(8);
  for (int k = 0; k < 2000; ++k) {
    V3 s(any.uniform(0.15, 2), any.uniform(0.15, 2), any.uniform(0.15, 2));
    if (k % 4 == 1) s[2] = any.uniform(-0.1, 0.09);                          // flat
    if (k % 4 == 2) s[2] = -any.uniform(0.1, 0.9) * s.head<2>().minCoeff();  // inside out
    if (k % 4 == 3) s[1] = s[0] * (1 + 1e-7 * any.uniform(-1, 1));
    // Where L's tangent begins, and where two stretches cancel, the energy has no higher
    // derivatives.
    if ((s.array() - 0.1).abs().minCoeff() < 1e-2) continue;
    const M3 f = any.stretched(s);
    const double scale = (law.lambda + 2 * law.mu) / std::pow(std::max(0.1, s.minCoeff()), 2);
    // Fourth-order differences at 1e-3 of the smallest stretch leave 1e-12, rounding 1e-16/1e-4.
    const double step = 1e-3 * std::max(0.1, s.minCoeff());
    EXPECT_LE(distance(stress(f), gradient_of(energy, f, step)), 3e-9 * scale) << s.transpose();
  }
}

TEST(Hencky, TurnsWithTheBodyAndSeesNoAxes) {
  Deformations any(9);
  for (int k = 0; k < 500; ++k) {
    const M3 f = any.gradient(0.3, 2), q = any.rotation();
    const M3 p = stress(f);
    // Stretches of 2 lose a rounding, which 1/0.3² and λ + 2μ = 3.5 magnify.
    EXPECT_LE(distance(stress(q * f), q * p), 2e-13);
    EXPECT_LE(distance(stress(f * q), p * q), 2e-13);
    EXPECT_NEAR(energy(q * f), energy(f), 2e-13);
    EXPECT_LE((p * f.transpose() - f * p.transpose()).cwiseAbs().maxCoeff(), 2e-13);
  }
}

TEST(Hencky, UniaxialKirchhoffStressIsYoungsModulusTimesTheLogarithm) {
  for (const double s : {0.2, 0.5, 0.9, 1.0, 1.2, 2.0, 5.0}) {
    const double across = std::pow(s, -poisson);
    const M3 f = V3(s, across, across).asDiagonal();
    const M3 tau = stress(f) * f.transpose();
    // Some roundings of a stress of four.
    EXPECT_NEAR(tau(0, 0), young * std::log(s), 4e-14);
    EXPECT_NEAR(tau(1, 1), 0, 4e-14);
    EXPECT_NEAR(tau(2, 2), 0, 4e-14);
    EXPECT_NEAR(energy(f), 0.5 * young * std::pow(std::log(s), 2), 4e-14);
  }
}

TEST(Hencky, PushesBackWhatIsFlattenedOrInsideOut) {
  Deformations any(10);
  for (double s = 0.3; s >= -0.7; s -= 0.01) {
    const M3 r = any.rotation(), q = any.rotation();
    const M3 f = r * V3(1.1, 0.9, s).asDiagonal() * q;
    const M3 p = r.transpose() * stress(f) * q.transpose();
    // The force along the smallest stretch is one of pressure, and grows as the body goes through.
    EXPECT_LT(p(2, 2), s < 0.09 ? 20 * law.mu * std::log(0.1) : -law.mu);
    EXPECT_TRUE(std::isfinite(energy(f)));
  }
  // Points, lines, mirrors: finite.
  for (const V3& s : {V3(0, 0, 0), V3(1, 0, 0), V3(1, 1, 0), V3(-1, -1, -1), V3(1, 1, -1),
                      V3(1e-20, 1, 1), V3(1e3, 1e3, -1e3), V3(100, 0.01, 0.01)}) {
    EXPECT_TRUE(stress(M3(s.asDiagonal())).allFinite()) << s.transpose();
    EXPECT_TRUE(std::isfinite(energy(s.asDiagonal()))) << s.transpose();
    const Hencky<float> in_single = hencky_of<float>(young, poisson);
    EXPECT_TRUE(eigen(in_single.first_piola_stress(grad_u<float>(s.asDiagonal()))).allFinite())
        << s.transpose();
  }
}

TEST(Hencky, RestIsFreeOfStressAndWhatIsNotANumberStaysSo) {
  EXPECT_EQ(eigen(law.first_piola_stress({})), M3::Zero().eval());
  EXPECT_EQ(law.energy({}), 0);
  Mat3d g{};
  g(1, 2) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(eigen(law.first_piola_stress(g)).allFinite());
  EXPECT_TRUE(std::isnan(law.energy(g)));
  const double nan = g(1, 2);
  EXPECT_TRUE(std::isnan(law.wave_stiffness({nan, nan, nan})));
}

template <class T, int W>
void expect_lanes_to_have_the_bits_of_scalars() {
  using P = Pack<T, W>;
  Deformations any(11);
  const Hencky<T> scalar = hencky_of<T>(young, poisson);
  const auto wide = packed<Hencky<P>, P>(scalar);
  for (int k = 0; k < 100; ++k) {
    Mat3<T> g[W];
    for (auto& lane : g) {
      lane = k % 2 == 0 ? mat3<T>(any.noise(std::exp(any.uniform(-20, 0))))
                        : grad_u<T>(any.gradient(-0.5, 2));
    }
    const Mat3<P> p = wide.first_piola_stress(packed_matrices<P>(g));
    const P psi = wide.energy(packed_matrices<P>(g));
    for (int l = 0; l < W; ++l) {
      const Mat3<T> expected = scalar.first_piola_stress(g[l]);
      for (int e = 0; e < 9; ++e) EXPECT_EQ(p(e / 3, e % 3)[l], expected(e / 3, e % 3));
      EXPECT_EQ(psi[l], scalar.energy(g[l]));
    }
  }
}
TEST(Hencky, LanesOfAPackHaveTheBitsOfScalars) {
  expect_lanes_to_have_the_bits_of_scalars<float, 16>();
  expect_lanes_to_have_the_bits_of_scalars<double, 8>();
}

class HenckyWaves : public ::testing::TestWithParam<double> {};
TEST_P(HenckyWaves, StiffnessIsBoundedAndNotByMuchMore) {
  const Hencky<double> of = hencky_of<double>(1, GetParam());
  const double at_rest = of.lambda + 2 * of.mu;
  // To rounding.
  EXPECT_NEAR(of.wave_stiffness({1, 1, 1}), at_rest, 1e-14 * at_rest);
  Deformations any(12);
  const auto p = [&](const M3& f) { return eigen(of.first_piola_stress(grad_u(f))); };
  double worst = 1;
  for (int k = 0; k < 120; ++k) {
    V3 s(any.uniform(0.2, 2.5), any.uniform(0.2, 2.5), any.uniform(0.2, 2.5));
    if (k % 4 == 0) s[2] = -s[2];
    if (k % 4 == 1) s[2] = any.uniform(0, 0.09);
    const M3 f = any.stretched(s);
    const PrincipalStretches<double> sorted = principal_stretches(grad_u(f));
    // Where two stretches cancel, the nearest rotation jumps, and differences say nothing.
    if (sorted.middle + sorted.smallest < 0.05) continue;
    const double is = largest_wave_stiffness(p, f, any), bound = of.wave_stiffness(sorted);
    // Central differences at 1e-5 of stresses that bend over 0.1: 1e-8 of stiffness.
    EXPECT_GE(bound, is * (1 - 1e-6)) << s.transpose();
    if (is > at_rest) worst = std::max(worst, bound / is);
  }
  // A looser bound would shorten steps for nothing; each term at its own largest costs this much.
  EXPECT_LE(worst, 2);
}
INSTANTIATE_TEST_SUITE_P(Poisson, HenckyWaves, ::testing::Values(-0.5, 0.0, 0.3, 0.49));

}  // namespace
}  // namespace phyxel
