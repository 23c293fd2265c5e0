/// Weights and hourglass control of bodies whose supports differ from phyxel to phyxel.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "phyxel/physics/weight.hpp"
#include "solver/hourglass.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

std::vector<Vec3d> forces_of(const Model& model, const std::vector<Vec3d>& u) {
  const auto backend = make_test_backend(model, Precision::double_, 2);
  backend->upload(state_of(u));
  std::vector<Vec3d> force;
  backend->internal_forces(force);
  return force;
}

/// Hourglass control needs one κ for a body: α E v / tr A, the same for all phyxels inside a graded
/// cloud by the factor of pairs' weights.
TEST(PairSupports, TheStiffnessOfHourglassControlIsTheSameThroughoutAGradedCloud) {
  Material material = rubber();
  material.hourglass = 0.1;
  const Model model = model_of(one_body(material), graded(14, 0));
  std::vector<double> kappa;
  for (Index i = 0; i < model.size(); ++i) {
    const auto row = model.neighbourhood.neighbours.row(i);
    double trace = 0;
    for (const Index j : row) {
      const Vec3d x = model.position[j] - model.position[i];
      const double h = pair_support(model.neighbourhood.support[i], model.neighbourhood.support[j]);
      trace += h / model.parts[0].pair_length * std::pow(1 - dot(x, x) / (h * h), 3) * dot(x, x);
    }
    const std::array edges{i % 14, i / 14 % 14, i / 196};
    const bool inside = std::ranges::all_of(edges, [](Index k) { return k > 2 && k < 11; });
    if (inside) kappa.push_back(0.1 * material.young * model.volume[i] / trace);
  }
  ASSERT_GT(kappa.size(), 300U);
  const auto [least, most] = std::minmax_element(kappa.begin(), kappa.end());
  EXPECT_LT(*most, 1.25 * *least);  // while supports vary fourfold there
  const double used = hourglass_stiffness(model, model.parts[0]);
  EXPECT_GT(used, 0.75 * *least);
  EXPECT_LT(used, 1.25 * *most);
}

TEST(PairSupports, WeightsOfEqualSupportsAreThoseOfOneSupport) {
  std::mt19937_64 engine(3);
  const auto compare = []<class Real>(Real h, Real r) {
    const auto half = static_cast<Real>(relative_half_support(h, h));
    const Real inverse = 1 / (h * h);
    EXPECT_EQ(pair_weight(r * r, half, half, inverse), weight_shape_anywhere(r * r, inverse));
  };
  for (int trial = 0; trial < 1000; ++trial) {
    const double h = uniform(engine, 1e-3, 10), r = uniform(engine, 0, 1.2) * h;
    compare(h, r);
    compare(static_cast<float>(h), static_cast<float>(r));
    const double a = uniform(engine, 0.1, 3), b = uniform(engine, 0.1, 3);
    EXPECT_EQ(pair_weight(r * r, a, b, 1 / (h * h)), pair_weight(r * r, b, a, 1 / (h * h)));
    EXPECT_GE(pair_weight(r * r, a, b, 1 / (h * h)), 0);
  }
}

/// Supports that happen to be equal give the forces of one support.
TEST(PairSupports, PairsOfEqualSupportsAreABodyOfOneSupport) {
  Cloud cloud = lattice(6, 5, 7, 0.1, 0.2);
  Material material = rubber();
  material.hourglass = 0.2;
  const Model one = model_of(one_body(material), cloud);
  cloud.spacing.assign(cloud.position.size(), 0.1);
  const Model pairs = model_of(one_body(material), cloud);
  EXPECT_EQ(one.parts[0].pair_length, 0);
  EXPECT_GT(pairs.parts[0].pair_length, 0);
  EXPECT_EQ(one.neighbourhood.neighbours.indices, pairs.neighbourhood.neighbours.indices);
  const auto u = random_deformation(one, 0.01);
  const auto expected = forces_of(one, u), found = forces_of(pairs, u);
  double scale = 0;
  for (const Vec3d& f : expected) scale = std::max(scale, norm(f));
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_LT(norm(found[i] - expected[i]), 1e-12 * scale);
  }
}

}  // namespace
}  // namespace phyxel
