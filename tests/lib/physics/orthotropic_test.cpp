/// The orthotropic law at a point, against the isotropic one and the formulas of engineering
/// constants.
#include "phyxel/physics/laws/orthotropic.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <string>
#include <type_traits>

#include "phyxel/physics/laws.hpp"
#include "solver/pack.hpp"
#include "support/deformations.hpp"
#include "support/laws.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

static_assert(sizeof(Orthotropic<float>) == 18 * sizeof(float));
static_assert(std::is_trivially_copyable_v<Orthotropic<double>>);

/// An orthotropic material by the keys of its parameters.
struct OrthotropicParameters {
  double young1 = 0, young2 = 0, young3 = 0, poisson12 = 0, poisson13 = 0, poisson23 = 0,
         shear12 = 0, shear13 = 0, shear23 = 0;
  Vec3d axis1{1, 0, 0}, axis2{0, 1, 0};

  operator Material() const {  // NOLINT: tests hand these to what takes materials
    Material m;
    m.law = "orthotropic";
    m.parameters = {{"young1", young1},       {"young2", young2},       {"young3", young3},
                    {"poisson12", poisson12}, {"poisson13", poisson13}, {"poisson23", poisson23},
                    {"shear12", shear12},     {"shear13", shear13},     {"shear23", shear23},
                    {"axis1", axis1},         {"axis2", axis2}};
    return m;
  }
};

/// λ and μ of an isotropic material.
Hooke<double> hooke_of(double young, double poisson) {
  return {lame_lambda(young, poisson), lame_mu(young, poisson)};
}

/// Spruce, in GPa: along the grain, radially, tangentially.
const OrthotropicParameters spruce{.young1 = 11.6,
                                   .young2 = 0.9,
                                   .young3 = 0.5,
                                   .poisson12 = 0.37,
                                   .poisson13 = 0.47,
                                   .poisson23 = 0.44,
                                   .shear12 = 0.75,
                                   .shear13 = 0.72,
                                   .shear23 = 0.04};

OrthotropicParameters isotropic(double young, double poisson) {
  const double g = young / (2 * (1 + poisson));
  return {young, young, young, poisson, poisson, poisson, g, g, g};
}
OrthotropicParameters turned(OrthotropicParameters p, const M3& r) {
  p.axis1 = {r(0, 0), r(1, 0), r(2, 0)}, p.axis2 = {r(0, 1), r(1, 1), r(2, 1)};
  return p;
}
M3 stress(const Orthotropic<double>& law, const M3& f) {
  return eigen(law.first_piola_stress(grad_u(f)));
}

/// The compliance in the frame at rest of xx, yy, zz, 2 yz, 2 xz, 2 xy, by six small strains.
Eigen::Matrix<double, 6, 6> compliance(const Orthotropic<double>& law) {
  const int rows[6] = {0, 1, 2, 1, 0, 0}, columns[6] = {0, 1, 2, 2, 2, 1};
  const double size = 1e-9;
  Eigen::Matrix<double, 6, 6> stiffness;
  for (int k = 0; k < 6; ++k) {
    Mat3d g{};
    g(rows[k], columns[k]) += size / 2, g(columns[k], rows[k]) += size / 2;
    const Mat3d p = law.first_piola_stress(g);
    for (int r = 0; r < 6; ++r) stiffness(r, k) = p(rows[r], columns[r]) / size;
  }
  return stiffness.inverse();
}

TEST(Orthotropic, HasTheEngineeringConstantsItIsMadeOf) {
  Deformations any(1);
  for (int k = 0; k < 20; ++k) {
    OrthotropicParameters p = spruce;
    if (k > 0) {
      for (double* e : {&p.young1, &p.young2, &p.young3, &p.shear12, &p.shear13, &p.shear23}) {
        *e = any.uniform(0.5, 2);
      }
      for (double* n : {&p.poisson12, &p.poisson13, &p.poisson23}) *n = any.uniform(-0.3, 0.3);
      if (!law_refusal(p).empty()) continue;
    }
    const auto s = compliance(law_of<Orthotropic<double>>(p));
    // Terms of second order in strains of 1e-9.
    EXPECT_NEAR(s(0, 0) * p.young1, 1, 1e-7);
    EXPECT_NEAR(s(1, 1) * p.young2, 1, 1e-7);
    EXPECT_NEAR(s(2, 2) * p.young3, 1, 1e-7);
    EXPECT_NEAR(s(3, 3) * p.shear23, 1, 1e-7);
    EXPECT_NEAR(s(4, 4) * p.shear13, 1, 1e-7);
    EXPECT_NEAR(s(5, 5) * p.shear12, 1, 1e-7);
    EXPECT_NEAR(-s(1, 0) * p.young1, p.poisson12, 1e-7);
    EXPECT_NEAR(-s(2, 0) * p.young1, p.poisson13, 1e-7);
    EXPECT_NEAR(-s(2, 1) * p.young2, p.poisson23, 1e-7);
  }
}

TEST(Orthotropic, OffAxisModulusIsTheFormula) {
  const OrthotropicParameters& p = spruce;
  for (int degrees = 0; degrees <= 90; degrees += 5) {
    const double phi = degrees * M_PI / 180, c = std::cos(phi), s = std::sin(phi);
    const M3 r = Eigen::AngleAxisd(phi, V3::UnitZ()).toRotationMatrix();
    const double found = compliance(law_of<Orthotropic<double>>(turned(p, r)))(0, 0);
    const double expected = std::pow(c, 4) / p.young1 + std::pow(s, 4) / p.young2 +
                            c * c * s * s * (1 / p.shear12 - 2 * p.poisson12 / p.young1);
    // Strains of 1e-9, and a stiffness whose ratio is 300.
    EXPECT_NEAR(found / expected, 1, 1e-6) << degrees;
  }
}

TEST(Orthotropic, WithIsotropicConstantsIsStVenantKirchhoff) {
  Deformations any(2);
  for (const double poisson : {-0.4, 0.0, 0.3, 0.45}) {
    const Hooke<double> lame = hooke_of(1.7, poisson);
    const StVenantKirchhoff<double> expected{{lame.lambda, lame.mu}};
    for (int k = 0; k < 300; ++k) {
      const auto law = law_of<Orthotropic<double>>(
          turned(isotropic(1.7, poisson), k % 2 == 0 ? M3(M3::Identity()) : any.rotation()));
      const Mat3d g = k % 3 == 0 ? mat3(any.noise(1e-8)) : grad_u(any.gradient(-0.5, 2));
      const M3 p = eigen(expected.first_piola_stress(g));
      // Sums of a few terms in another order.
      const double scale =
          (lame.lambda + 2 * lame.mu) * (1 + eigen(g).squaredNorm()) * eigen(g).norm();
      EXPECT_LE(distance(eigen(law.first_piola_stress(g)), p), 3e-15 * scale);
      EXPECT_NEAR(law.energy(g), expected.energy(g), 3e-15 * scale * eigen(g).norm());
    }
  }
}

TEST(Orthotropic, StressIsTheDerivativeOfItsEnergy) {
  Deformations any(3);
  for (int k = 0; k < 200; ++k) {
    const auto law = law_of<Orthotropic<double>>(turned(spruce, any.rotation()));
    const M3 f = any.gradient(-0.8, 2);
    const auto energy = [&](const M3& at) { return law.energy(grad_u(at)); };
    // A polynomial of degree four: fourth-order differences leave rounding only, 1e-14/1e-2.
    EXPECT_LE(distance(stress(law, f), gradient_of(energy, f, 1e-2)), 1e-10);
  }
}

TEST(Orthotropic, TurnsWithTheBodyAndItsAxesWithTheMaterial) {
  Deformations any(4);
  const auto straight = law_of<Orthotropic<double>>(spruce);
  for (int k = 0; k < 200; ++k) {
    const M3 f = any.gradient(0.3, 2), q = any.rotation();
    // Rounding of stresses of order 10.
    EXPECT_LE(distance(stress(straight, q * f), q * stress(straight, f)), 1e-13);
    const auto other = law_of<Orthotropic<double>>(turned(spruce, q));
    EXPECT_LE(distance(stress(other, f), stress(straight, f * q) * q.transpose()), 1e-13);
  }
  // Axes of any length, the second slanting.
  OrthotropicParameters slanting = spruce;
  slanting.axis1 = {0, 3, 0}, slanting.axis2 = {-2, 1, 0};
  const auto law = law_of<Orthotropic<double>>(slanting);
  EXPECT_NEAR(compliance(law)(1, 1) * spruce.young1, 1, 1e-7);
  EXPECT_NEAR(compliance(law)(0, 0) * spruce.young2, 1, 1e-7);
}

TEST(Orthotropic, LanesOfAPackHaveTheBitsOfScalars) {
  Deformations any(5);
  const auto check = [&]<class T, int W>(Pack<T, W>) {
    using P = Pack<T, W>;
    const auto scalar = law_of<Orthotropic<T>>(turned(spruce, any.rotation()));
    const auto wide = packed<Orthotropic<P>, P>(scalar);
    Mat3<T> g[W];
    for (auto& lane : g) lane = mat3<T>(any.noise(0.5));
    const Mat3<P> p = wide.first_piola_stress(packed_matrices<P>(g));
    const P energy = wide.energy(packed_matrices<P>(g));
    for (int l = 0; l < W; ++l) {
      const Mat3<T> expected = scalar.first_piola_stress(g[l]);
      for (int e = 0; e < 9; ++e) EXPECT_EQ(p(e / 3, e % 3)[l], expected(e / 3, e % 3));
      EXPECT_EQ(energy[l], scalar.energy(g[l]));
    }
  };
  check(Pack<float, 16>{}), check(Pack<double, 8>{});
}

TEST(Orthotropic, WaveStiffnessIsBoundedAndForIsotropyAsTightAsThere) {
  Deformations any(6);
  double worst = 0;
  for (int k = 0; k < 200; ++k) {
    OrthotropicParameters p = turned(spruce, any.rotation());
    if (k % 2 == 0) {
      for (double* e : {&p.young1, &p.young2, &p.young3, &p.shear12, &p.shear13, &p.shear23}) {
        *e = any.uniform(0.2, 2);
      }
      for (double* n : {&p.poisson12, &p.poisson13, &p.poisson23}) *n = any.uniform(-0.3, 0.5);
      if (!law_refusal(p).empty()) continue;
    }
    const auto law = law_of<Orthotropic<double>>(p);
    const M3 f = k % 5 == 0 ? M3(M3::Identity()) : any.gradient(0.3, 2);
    const auto of = [&](const M3& at) { return stress(law, at); };
    const double is = largest_wave_stiffness(of, f, any);
    const double bound = law.wave_stiffness(principal_stretches(grad_u(f)));
    // Central differences at 1e-5 of a polynomial of degree three: 1e-9.
    EXPECT_GE(bound, is * (1 - 1e-7));
    worst = std::max(worst, k % 5 == 0 ? bound / is : 0);
  }
  // At rest the largest shear modulus and the largest coupling may belong to different axes.
  // Measured: 1.6.
  EXPECT_LE(worst, 2);
  const auto same = law_of<Orthotropic<double>>(isotropic(1, 0.3));
  const Hooke<double> lame = hooke_of(1, 0.3);
  for (const PrincipalStretches<double>& s :
       {PrincipalStretches<double>{1, 1, 1}, {2, 1.2, 0.5}, {0.9, 0.6, -0.4}}) {
    const double expected = StVenantKirchhoff<double>{{lame.lambda, lame.mu}}.wave_stiffness(s);
    EXPECT_NEAR(same.wave_stiffness(s), expected, 1e-14 * std::abs(expected) + 1e-14);
  }
}

TEST(Orthotropic, RefusesWhatIsNotPositiveDefiniteAndNamesTheSubDeterminant) {
  EXPECT_EQ(law_refusal(spruce), "");
  const auto refusal = [](auto change) {
    OrthotropicParameters p = isotropic(1, 0.3);
    change(p);
    return law_refusal(p);
  };
  using P = OrthotropicParameters;
  const auto expect = [](const std::string& text, const char* part) {
    EXPECT_NE(text.find(part), std::string::npos) << text;
  };
  expect(refusal([](P& p) { p.young2 = -1; }), "young2 = -1 found; allowed: ");
  expect(refusal([](P& p) { p.shear23 = 0; }), "shear23 = 0 found; allowed: ");
  // 1 - 4 = -3.
  const std::string second = refusal([](P& p) { p.poisson12 = 2; });
  expect(second, "poisson12 = 2"), expect(second, "second sub-determinant");
  // 1 - 3/4 - 2/8 = 0: ν = ½ of an isotropic body.
  const std::string third = refusal([](P& p) { p.poisson12 = p.poisson13 = p.poisson23 = 0.5; });
  expect(third, "poisson23 = 0.5"), expect(third, "third sub-determinant");
  const std::string parallel = refusal([](P& p) { p.axis2 = {-2, 0, 0}; });
  expect(parallel, "axis2 = [-2, 0, 0]"), expect(parallel, "not parallel");
  expect(refusal([](P& p) { p.axis1 = {0, 0, 0}; }), "axis1 = [0, 0, 0]");
  // The determinant is that of the matrix itself.
  Deformations any(7);
  for (int k = 0; k < 300; ++k) {
    OrthotropicParameters p = isotropic(1, 0);
    for (double* e : {&p.young1, &p.young2, &p.young3}) *e = any.uniform(0.2, 2);
    for (double* n : {&p.poisson12, &p.poisson13, &p.poisson23}) *n = any.uniform(-1.2, 1.2);
    M3 s;
    s << 1 / p.young1, -p.poisson12 / p.young1, -p.poisson13 / p.young1,  //
        -p.poisson12 / p.young1, 1 / p.young2, -p.poisson23 / p.young2,   //
        -p.poisson13 / p.young1, -p.poisson23 / p.young2, 1 / p.young3;
    const double least = Eigen::SelfAdjointEigenSolver<M3>(s).eigenvalues()[0];
    EXPECT_EQ(law_refusal(p).empty(), least > 0) << least;
  }
}

}  // namespace
}  // namespace phyxel
