/// The pseudo-inverse against Eigen's singular value decomposition in long double.
#include "phyxel/physics/moment.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using MatrixL = Eigen::Matrix<long double, 3, 3>;

/// A = sum of `rank` weighted outer products of random directions, times `scale`.
Sym3d random_moment(std::mt19937_64& engine, int rank, double scale) {
  Sym3d a;
  for (int k = 0; k < rank; ++k) {
    a += moment_term(uniform_vector(engine, 1), scale * uniform(engine, 0.5, 1));
  }
  return a;
}

MatrixL svd_pseudo_inverse(const Sym3d& a, long double cutoff, int* rank) {
  MatrixL m;
  m << a.xx, a.xy, a.xz, a.xy, a.yy, a.yz, a.xz, a.yz, a.zz;
  const Eigen::JacobiSVD<MatrixL> svd(m, Eigen::ComputeFullU | Eigen::ComputeFullV);
  MatrixL inverse = MatrixL::Zero();
  *rank = 0;
  for (int k = 0; k < 3; ++k) {
    const long double s = svd.singularValues()[k];
    if (!(s > cutoff * svd.singularValues()[0])) continue;
    inverse += svd.matrixV().col(k) * svd.matrixU().col(k).transpose() / s;
    ++*rank;
  }
  return inverse;
}

template <class Real>
void expect_equals_svd(int rank, double scale, double tolerance, Real cutoff) {
  std::mt19937_64 engine(static_cast<std::uint64_t>(rank));
  int of_that_rank = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const Sym3d a = random_moment(engine, rank, scale);
    const Sym3<Real> given{Real(a.xx), Real(a.xy), Real(a.xz), Real(a.yy), Real(a.yz), Real(a.zz)};
    int expected_rank = 0;
    const MatrixL expected = svd_pseudo_inverse(
        {given.xx, given.xy, given.xz, given.yy, given.yz, given.zz}, cutoff, &expected_rank);
    const PseudoInverse<Real> found = pseudo_inverse(given, cutoff);
    ASSERT_EQ(found.rank, expected_rank);
    of_that_rank += expected_rank == rank;
    const Mat3<Real> f = full(found.matrix);
    const long double size = expected.cwiseAbs().maxCoeff();
    // The error of an inverse is the condition number times rounding.
    long double worst = 0;
    for (int e = 0; e < 9; ++e) {
      worst = std::max(worst, std::abs(f(e / 3, e % 3) - expected(e / 3, e % 3)) / size);
    }
    const Eigen::JacobiSVD<MatrixL> svd(expected);
    const long double condition =
        svd.singularValues()[0] / svd.singularValues()[std::max(0, expected_rank - 1)];
    EXPECT_LE(worst, tolerance * condition);
  }
  EXPECT_GT(of_that_rank, 1900);  // random directions are seldom nearly dependent
}

TEST(PseudoInverse, EqualsSvdForRanksOneToThreeInDouble) {
  for (const int rank : {1, 2, 3}) {
    for (const double scale : {1e-30, 1e-12, 1.0, 1e20}) {
      expect_equals_svd<double>(rank, scale, 2e-15, moment_cutoff);
    }
  }
}

TEST(PseudoInverse, EqualsSvdForRanksOneToThreeInFloat) {
  // In float a rank-2 matrix carries eigenvalues of rounding size, 1e-7: the cut-off lies above.
  for (const int rank : {1, 2, 3}) {
    for (const double scale : {1e-12, 1.0, 1e12})
      expect_equals_svd<float>(rank, scale, 2e-6, 1e-5f);
  }
}

TEST(PseudoInverse, OfNothingIsNothing) {
  const PseudoInverse<double> none = pseudo_inverse(Sym3d{});
  EXPECT_EQ(none.rank, 0);
  EXPECT_EQ(contract(none.matrix, none.matrix), 0);
}

/// A neighbourhood thinner than a thousandth of its width is a sheet, a thicker one is not: squares
/// of extents stand in the moments, so that the limit is at a millionth.
TEST(PseudoInverse, TakesAThousandthOfTheWidthForFlat) {
  EXPECT_EQ(moment_cutoff, 1e-6);
  for (const double thickness : {0.9e-3, 1.1e-3}) {
    const Sym3d a{1, 0, 0, 0.5, 0, thickness * thickness};
    const PseudoInverse<double> p = pseudo_inverse(a);
    EXPECT_EQ(p.rank, thickness < 1e-3 ? 2 : 3);
    // The thin direction counts in full or not at all.
    EXPECT_NEAR(p.matrix.zz * thickness * thickness, thickness < 1e-3 ? 0 : 1, 1e-14);
    const PseudoInverse<float> single =
        pseudo_inverse(Sym3<float>{1, 0, 0, 0.5F, 0, static_cast<float>(thickness * thickness)});
    EXPECT_EQ(single.rank, p.rank);
  }
}

TEST(PseudoInverse, SatisfiesPenroseOnASheet) {
  // Neighbours in the plane z = 0: the inverse acts in the plane and ignores its normal.
  Sym3d a;
  std::mt19937_64 engine(5);
  for (int k = 0; k < 12; ++k) {
    Vec3d x = uniform_vector(engine, 1);
    x.z = 0;
    a += moment_term(x, 1.0);
  }
  const PseudoInverse<double> p = pseudo_inverse(a);
  EXPECT_EQ(p.rank, 2);
  const Mat3d m = full(a), inverse = full(p.matrix), again = m * inverse * m;
  for (int e = 0; e < 9; ++e) EXPECT_NEAR(again(e / 3, e % 3), m(e / 3, e % 3), 1e-14);  // rounding
  EXPECT_EQ(p.matrix * (Vec3d{0, 0, 1}), (Vec3d{0, 0, 0}));
}

}  // namespace
}  // namespace phyxel
