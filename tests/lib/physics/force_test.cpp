/// The force on every phyxel, against the papers' equations and against the energy.
#include <gtest/gtest.h>

#include <algorithm>

#include "phyxel/backend.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/laws.hpp"
#include "support/oracle.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

struct Terms {
  const char* name;
  const char* law;
  double volume_stiffness;
  NeighbourhoodRule::Support support;
  std::optional<int> max_neighbours;
  double hourglass = 0;
  bool closed = false;
  bool inclusions = false;
};

/// A law with the constants of `rubber_of` it.
template <class Law>
Law chosen_by_name() {
  return make_law<Law, double>(chosen_law(rubber_of(Law::name)).constants.data());
}

void PrintTo(const Terms& terms, std::ostream* out) { *out << terms.name; }

constexpr const char *st_venant_kirchhoff = StVenantKirchhoff<double>::name,
                     *small_strain = SmallStrain<double>::name,
                     *neo_hookean = NeoHookean<double>::name, *corotated = Corotated<double>::name,
                     *hencky = Hencky<double>::name, *mooney_rivlin = MooneyRivlin<double>::name;
constexpr auto uniform_support = NeighbourhoodRule::Support::uniform,
               adaptive_support = NeighbourhoodRule::Support::adaptive,
               pair_supports = NeighbourhoodRule::Support::pairwise;

const Terms all_terms[] = {
    {"GreenUniform", st_venant_kirchhoff, 0, uniform_support, {}, 0, false, false},
    {"CauchyUniform", small_strain, 0, uniform_support, {}, 0, false, false},
    {"GreenVolumeUniform", st_venant_kirchhoff, 3e5, uniform_support, {}, 0, false, false},
    {"CauchyVolumeAdaptive", small_strain, 3e5, adaptive_support, {}, 0, false, false},
    {"GreenAdaptive", st_venant_kirchhoff, 0, adaptive_support, {}, 0, false, false},
    {"GreenVolumeCapped", st_venant_kirchhoff, 2e5, adaptive_support, 12, 0, false, false},
    {"GreenHourglass", st_venant_kirchhoff, 0, uniform_support, {}, 0.3, false, false},
    {"CauchyVolumeHourglass", small_strain, 2e5, uniform_support, {}, 0.1, false, false},
    {"NeoHooke", neo_hookean, 0, adaptive_support, {}, 0, false, false},
    {"NeoHookeVolumeHourglass", neo_hookean, 2e5, uniform_support, {}, 0.1, false, false},
    {"Corotated", corotated, 0, adaptive_support, {}, 0, false, false},
    {"CorotatedVolumeHourglass", corotated, 2e5, uniform_support, {}, 0.1, false, false},
    {"Hencky", hencky, 0, adaptive_support, {}, 0, false, false},
    {"HenckyVolumeHourglass", hencky, 2e5, uniform_support, {}, 0.1, false, false},
    {"MooneyRivlin", mooney_rivlin, 0, adaptive_support, {}, 0, false, false},
    {"MooneyRivlinVolumeHourglass", mooney_rivlin, 2e5, uniform_support, {}, 0.1, false, false},
    {"Closed", st_venant_kirchhoff, 0, uniform_support, {}, 0, true, false},
    {"ClosedCauchyVolume", small_strain, 2e5, uniform_support, {}, 0, true, false},
    {"ClosedNeoHookeHourglass", neo_hookean, 0, uniform_support, {}, 0.1, true, false},
    {"Inclusions", st_venant_kirchhoff, 0, uniform_support, {}, 0.1, false, true},
    {"Pairs", st_venant_kirchhoff, 0, pair_supports, {}, 0, false, false},
    {"PairsVolumeHourglass", neo_hookean, 2e5, pair_supports, {}, 0.1, false, false},
    {"PairsClosedHourglass", hencky, 0, pair_supports, {}, 0.3, true, false},
    {"PairsInclusions", corotated, 0, pair_supports, {}, 0.1, false, true},
    {"ClosedInclusions", corotated, 2e5, uniform_support, {}, 0, true, true},
};

/// An irregular cloud of 5 x 4 x 6 phyxels whose spacings vary 2.5 to 1, with spacings of its own.
Cloud graded_block() {
  Cloud cloud = lattice(5, 4, 6, 0.1, 0.25);
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    Vec3d& p = cloud.position[i];
    const double growth = 0.6 + 1.5 * p.z;
    cloud.spacing.push_back(0.1 * growth);
    cloud.volume[i] *= growth * growth * growth;
    p = {p.x * growth, p.y * growth, p.z * (0.6 + 0.75 * p.z)};
  }
  return cloud;
}

/// An irregular cloud of 5 x 4 x 6 phyxels with the given terms.
struct Case {
  Model model;
  oracle::Body body;
  std::vector<Vec3d> u;
};

Case make_case(const Terms& terms) {
  Material material = rubber_of(terms.law);
  material.volume_stiffness = terms.volume_stiffness;
  material.hourglass = terms.hourglass;
  NeighbourhoodRule rule;
  rule.support = terms.support;
  rule.max_neighbours = terms.max_neighbours;
  Scene scene = one_body(material, rule);
  if (terms.inclusions) {
    Material hard = material, light = material;
    hard.young *= 20;
    hard.law = neo_hookean;
    light.poisson = 0.1;
    light.volume_stiffness = 1e5;
    scene.bodies[0].inclusions = {
        {.select = {.ball = Selection::Ball{{0.25, 0.2, 0.3}, 0.2}}, .material = hard},
        {.select = {.box = Selection::Box{{-1, -1, 0.4}, {1, 1, 1}}}, .material = light}};
  }
  const Cloud cloud = terms.support == pair_supports ? graded_block() : lattice(5, 4, 6, 0.1, 0.25);
  Case c{model_of(scene, cloud), {}, {}};
  c.u = random_deformation(c.model, 0.01);
  if (terms.closed) {
    // Forces follow from the energy for any closing vectors; these make a tenth of the gradient.
    std::mt19937_64 engine(11);
    for (Index i = 0; i < c.model.size(); ++i) {
      const Vec3d closing{uniform(engine, -1, 1), uniform(engine, -1, 1), uniform(engine, -1, 1)};
      c.model.closing.push_back(closing);
      c.body.closing.push_back({closing.x, closing.y, closing.z});
    }
  }
  for (Index i = 0; i < c.model.size(); ++i) {
    const Vec3d p = c.model.position[i];
    c.body.x.push_back({p.x, p.y, p.z});
    c.body.v.push_back(c.model.volume[i]);
    c.body.h.push_back(c.model.neighbourhood.support[i]);
    const auto row = c.model.neighbourhood.neighbours.row(i);
    c.body.neighbours.emplace_back(row.begin(), row.end());
  }
  const auto told = [](const Material& m) {
    std::map<std::string, double> numbers;
    for (const auto& [name, value] : m.parameters) numbers[name] = value.number();
    return oracle::Material{m.young, m.poisson, m.volume_stiffness, m.law, numbers};
  };
  static_cast<oracle::Material&>(c.body) = told(material);
  for (const Part& part : c.model.parts) {
    for (Index i = part.begin; i < part.end && terms.inclusions; ++i) {
      c.body.material.push_back(told(part.material));
    }
  }
  // κ = α E v / tr A, where tr A sums w r² over a continuum of density 1 / v: by many shells.
  double volume = 0;
  for (const Part& part : c.model.parts) volume += part.volume;
  double h = c.body.h[0], v = volume / c.model.size();
  if (terms.support == pair_supports) {
    // A phyxel of support H, as large as the others for its support.
    std::vector<double> supports = c.body.h;
    std::sort(supports.begin(), supports.end());
    h = c.body.pair_length = supports[supports.size() / 2];
    double cubes = 0;
    for (const double own : c.body.h) cubes += own * own * own;
    v = volume / cubes * h * h * h;
  }
  double sum = 0;
  const int shells = 100'000;
  for (int k = 0; k < shells; ++k) {
    const double t = (k + 0.5) / shells;
    sum += std::pow(1 - t * t, 3) * t * t * 4 * M_PI * t * t / shells;
  }
  c.body.hourglass = terms.hourglass * hourglass_modulus(material) * v * v / (sum * std::pow(h, 5));
  return c;
}

std::vector<oracle::V3> to_eigen(const std::vector<Vec3d>& vectors) {
  std::vector<oracle::V3> result;
  for (const Vec3d& v : vectors) result.push_back({v.x, v.y, v.z});
  return result;
}

double largest_norm(const std::vector<oracle::V3>& vectors) {
  double largest = 0;
  for (const auto& v : vectors) largest = std::max(largest, v.norm());
  return largest;
}

class Force : public ::testing::TestWithParam<Terms> {};

std::vector<Vec3d> backend_forces(const Model& model, const std::vector<Vec3d>& u,
                                  Precision precision) {
  const auto backend = make_test_backend(model, precision, 2);
  backend->upload(state_of(u));
  std::vector<Vec3d> force;
  backend->internal_forces(force);
  return force;
}

TEST_P(Force, EqualsTheOracle) {
  const Case c = make_case(GetParam());
  const auto expected = oracle::forces(c.body, to_eigen(c.u));
  const double scale = largest_norm(expected);
  // Double: some 40 neighbours' rounding through an inverse matrix. Float: the same at 6e-8, with
  // strains of order one.
  // Hourglass control is known to the shells of its oracle.
  const double exact = GetParam().hourglass > 0 ? 1e-9 : 1e-12;
  const std::pair<Precision, double> cases[] = {
      {Precision::double_, exact}, {Precision::single, 2e-5}, {Precision::mixed, 2e-5}};
  for (const auto& [precision, tolerance] : cases) {
    const auto force = backend_forces(c.model, c.u, precision);
    double worst = 0;
    for (std::size_t i = 0; i < force.size(); ++i) {
      worst = std::max(worst, (to_eigen({force[i]})[0] - expected[i]).norm() / scale);
    }
    EXPECT_LT(worst, tolerance);
  }
}

TEST_P(Force, IsMinusTheEnergyGradient) {
  const Case c = make_case(GetParam());
  const auto force = backend_forces(c.model, c.u, Precision::double_);
  auto u = to_eigen(c.u);
  const double scale = largest_norm(to_eigen(force));
  // Central differences with step 1e-6 m: truncation 1e-12 x third derivatives / 0.1 m, rounding
  // 1e-16 / 1e-6 of the energy; both near 1e-9 of the force.
  const double step = 1e-6;
  for (const std::size_t i : {0u, 7u, 33u, 61u, 87u, 119u}) {
    for (int a = 0; a < 3; ++a) {
      const double here = u[i][a];
      u[i][a] = here + step;
      const double above = oracle::energy(c.body, u);
      u[i][a] = here - step;
      const double below = oracle::energy(c.body, u);
      u[i][a] = here;
      const double derivative = (above - below) / (2 * step);
      EXPECT_NEAR(to_eigen({force[i]})[0][a], -derivative, 1e-7 * scale);
    }
  }
}

TEST_P(Force, ReportedEnergyIsTheOracles) {
  const Case c = make_case(GetParam());
  const auto backend = make_test_backend(c.model, Precision::double_);
  backend->upload(state_of(c.u));
  const Diagnostics d = diagnose(c.model, *backend, 0, 1e-3);
  const double expected = oracle::energy(c.body, to_eigen(c.u));
  EXPECT_NEAR(d.elastic_energy(), expected, 1e-9 * expected);  // κ's shells: 1e-10
  EXPECT_NEAR(d.hourglass_energy, oracle::hourglass_energy(c.body, to_eigen(c.u)), 1e-9 * expected);
  EXPECT_EQ(d.hourglass_energy > 0, GetParam().hourglass > 0);
  EXPECT_EQ(d.volume_energy > 0, GetParam().volume_stiffness > 0 || GetParam().inclusions);
}

TEST_P(Force, TotalForceAndTorqueVanish) {
  const Case c = make_case(GetParam());
  const auto backend = make_test_backend(c.model, Precision::double_);
  backend->upload(state_of(c.u));
  const Diagnostics d = diagnose(c.model, *backend, 0, 1e-3);
  // Pairwise cancellation: only rounding of 120 sums is left.
  EXPECT_LT(norm(d.internal_force), 1e-14 * d.force_scale);
  if (GetParam().law != std::string(small_strain)) {
    EXPECT_LT(norm(d.internal_torque), 1e-13 * d.torque_scale);
  } else {
    // The linear strain does not know rotations: under this deformation torque is really lost.
    EXPECT_GT(norm(d.internal_torque), 1e-4 * d.torque_scale);
  }
}

TEST_P(Force, LinearFieldIsReproduced) {
  const Case c = make_case(GetParam());
  const auto u = random_deformation(c.model, 0);
  const auto backend = make_test_backend(c.model, Precision::double_);
  backend->upload(state_of(u));
  std::vector<Mat3d> gradient;
  backend->displacement_gradients(gradient);
  std::mt19937_64 engine(7);  // as random_deformation draws it
  Mat3d expected;
  for (int e = 0; e < 9; ++e) expected(e / 3, e % 3) = uniform(engine, -0.3, 0.3);
  for (Index i = 0; i < c.model.size(); ++i) {
    for (int e = 0; e < 9; ++e) {
      // Rounding, times the condition of a 12-neighbour moment matrix.
      EXPECT_NEAR(gradient[i](e / 3, e % 3), expected(e / 3, e % 3), 1e-12);
    }
  }
}

TEST_P(Force, TranslationAndRotationCostNothing) {
  const Case c = make_case(GetParam());
  const double angle = GetParam().law != std::string(small_strain) ? 2.1 : 0;
  Mat3d rotation = identity<double>();
  rotation(0, 0) = rotation(1, 1) = std::cos(angle);
  rotation(1, 0) = std::sin(angle);
  rotation(0, 1) = -rotation(1, 0);
  std::vector<Vec3d> u;
  for (const Vec3d& x : c.model.position) u.push_back(rotation * x - x + Vec3d{3, -2, 1});
  const auto backend = make_test_backend(c.model, Precision::double_);
  backend->upload(state_of(u));
  const Diagnostics d = diagnose(c.model, *backend, 0, 1e-3);
  // Strain is rounding (1e-15, through the condition of the moments), against E of 1e5 and a face
  // of 0.01 m² a phyxel.
  EXPECT_LT(d.force_scale,
            (GetParam().inclusions ? 2e-12 : 1e-13) * 1e5 * 0.01 * c.model.size());  // 20 E
  EXPECT_LT(d.strain_energy, 1e-20);
  EXPECT_LT(d.hourglass_energy, 1e-20);
}

INSTANTIATE_TEST_SUITE_P(Terms, Force, ::testing::ValuesIn(all_terms),
                         [](const auto& test) { return std::string(test.param.name); });

/// Every second layer of phyxels to one side, the others to the other: a motion whose gradient is
/// zero where neighbours lie symmetrically, so that hourglass control alone holds it.
TEST(Force, HourglassModesAreSeenByTheResidualAlone) {
  Material material = rubber();
  material.hourglass = 0.1;
  const Model model = model_of(one_body(material), lattice(9, 9, 9, 0.1, 0));
  std::vector<Vec3d> u;
  for (Index i = 0; i < model.size(); ++i) {
    const auto row = static_cast<int>(model.position[i].x / 0.1);
    u.push_back({0, row % 2 ? 0.001 : -0.001, 0});
  }
  const auto backend = make_test_backend(model, Precision::double_);
  backend->upload(state_of(u));
  std::vector<Mat3d> gradient;
  backend->displacement_gradients(gradient);
  std::vector<double> residual;
  backend->fit_residuals(residual);
  const Index centre = 4 + 9 * (4 + 9 * 4);
  for (int e = 0; e < 9; ++e) EXPECT_NEAR(gradient[centre](e / 3, e % 3), 0, 1e-16);  // of 0.02
  const double h = model.neighbourhood.support[centre];
  double expected = 0;
  for (const Index j : model.neighbourhood.neighbours.row(centre)) {
    const Vec3d x = model.position[j] - model.position[centre];
    const double apart = norm(u[j] - u[centre]);
    expected += std::pow(1 - dot(x, x) / (h * h), 3) * apart * apart;
  }
  EXPECT_GT(expected, 1e-6);
  EXPECT_NEAR(residual[centre], expected, 1e-13 * expected);
}

/// Pressed flat along x, and turned inside out: Hooke's law in Green's strain gives way where the
/// body is pressed below 1/√3 of its length; the others push harder the further.
TEST(Force, LawsButHookesResistUntilTheBodyIsInsideOut) {
  Laws::for_each<double>([]<class Law>(std::type_identity<Law>) {
    if (std::is_same_v<Law, SmallStrain<double>>) return;  // linear, whatever is pressed
    double before = 0;
    bool resists = true;
    for (const double stretch : {0.9, 0.7, 0.5, 0.3, 0.1, 0.0, -0.2, -0.5}) {
      Mat3d g{};
      g(0, 0) = stretch - 1;
      const double push = Virgin<Law>{chosen_by_name<Law>()}.first_piola_stress(g)(0, 0);
      resists = resists && push < before;
      before = push;
    }
    const bool in_green_strain = std::is_same_v<Law, StVenantKirchhoff<double>> ||
                                 std::is_same_v<Law, Orthotropic<double>> ||
                                 std::is_same_v<Law, Clay<double>>;
    EXPECT_EQ(resists, !in_green_strain) << Law::name;
  });
}

TEST(Force, LawsAreHookesAtSmallStrains) {
  std::mt19937_64 engine(5);
  for (int trial = 0; trial < 20; ++trial) {
    Mat3d g;
    for (int e = 0; e < 9; ++e) g(e / 3, e % 3) = uniform(engine, -1e-6, 1e-6);
    Laws::for_each<double>([&]<class Law>(std::type_identity<Law>) {
      const Law law = chosen_by_name<Law>();
      // Laws of E and ν are Hooke's of the same; others say themselves whose they are.
      const bool is_of_young = has_parameter(Law::name, "young");
      Hooke<double> hooke{rubber().lame_lambda(), rubber().lame_mu()};
      if constexpr (requires { law.at_rest(0).hooke; }) {
        if (!is_of_young) hooke = law.at_rest(0).hooke;
      } else {
        return;  // anisotropic: tests of its own
      }
      const Mat3d s = full(hooke.stress(cauchy_strain(g)));
      const Mat3d p = Virgin<Law>{law}.first_piola_stress(g);
      // Terms of second order are 1e-6 of the stress; and no digits are lost by what cancels at
      // rest.
      for (int e = 0; e < 9; ++e) EXPECT_NEAR(p(e / 3, e % 3), s(e / 3, e % 3), 1e-5) << Law::name;
      EXPECT_NEAR(Virgin<Law>{law}.energy(g), hooke.energy(cauchy_strain(g)), 1e-11) << Law::name;
    });
  }
}

/// Held against singular values: at rest, strained and turned by any angle, flattened, inside out.
TEST(Force, TheNearestRotationIsThatOfSingularValues) {
  std::mt19937_64 engine(8);
  std::normal_distribution<double> normal;
  for (const double size : {1e-6, 1e-2, 0.3, 1.0, 10.0}) {
    for (int trial = 0; trial < 200; ++trial) {
      oracle::M3 change;
      for (int e = 0; e < 9; ++e) change(e / 3, e % 3) = size * normal(engine);
      oracle::M3 f = oracle::M3::Identity() + change;
      if (trial % 2) {
        const Eigen::Quaterniond turn(normal(engine), normal(engine), normal(engine),
                                      normal(engine));
        f = turn.normalized().toRotationMatrix() * f;
      }
      const Eigen::JacobiSVD<oracle::M3> svd(f);
      const oracle::V3 s = svd.singularValues();
      const double gap = s[1] + (f.determinant() < 0 ? -1 : 1) * s[2];
      Mat3d g;
      for (int e = 0; e < 9; ++e) g(e / 3, e % 3) = f(e / 3, e % 3) - (e % 4 == 0);
      const oracle::M3 expected = oracle::Corotated::rotation(f);
      const NearestRotation<double> r = nearest_rotation(g);
      const NearestRotation<float> rough = nearest_rotation(to<float>(g));
      // Rounding of K's entries, through how far its largest eigenvalues are apart.
      const double tolerance = std::max(1.0, s[0]) / std::min(1.0, gap);
      for (int e = 0; e < 9; ++e) {
        const double exact = expected(e / 3, e % 3) - (e % 4 == 0);
        EXPECT_NEAR(r.change(e / 3, e % 3), exact, 1e-13 * tolerance * tolerance) << size;
        EXPECT_NEAR(rough.change(e / 3, e % 3), exact, 3e-6 * tolerance * tolerance) << size;
      }
      EXPECT_NEAR(r.stretch, (expected.transpose() * f).trace() - 3, 1e-13 * std::max(1.0, s[0]));
    }
  }
  // Digits of small turns and strains are kept in float.
  Mat3<float> small{};
  small(0, 1) = -3e-6F, small(1, 0) = 5e-6F, small(2, 2) = 7e-6F;
  const NearestRotation<float> r = nearest_rotation(small);
  EXPECT_NEAR(r.change(1, 0), 4e-6F, 1e-11F);  // half of what is skew; squares are 1e-11
  EXPECT_NEAR(r.stretch, 7e-6F, 1e-10F);
  // Nothing is nearest to F = 0: whatever it is, it is finite.
  const NearestRotation<double> any = nearest_rotation(-1.0 * identity<double>());
  for (int e = 0; e < 9; ++e) EXPECT_TRUE(std::isfinite(any.change(e / 3, e % 3)));
}

TEST(Force, HourglassControlNeedsOneSupport) {
  Material material = rubber();
  material.hourglass = 0.1;
  NeighbourhoodRule rule;
  rule.support = NeighbourhoodRule::Support::adaptive;
  EXPECT_THROW(model_of(one_body(material, rule), lattice(4, 4, 4, 0.1, 0)), InputError);
}

TEST(Force, CauchyStrainSeesARotationAsStrain) {
  Terms terms = all_terms[1];
  const Case c = make_case(terms);
  std::vector<Vec3d> u;
  for (const Vec3d& x : c.model.position) u.push_back(Vec3d{-x.y, x.x, x.z} - x);
  const auto backend = make_test_backend(c.model, Precision::double_);
  backend->upload(state_of(u));
  EXPECT_GT(diagnose(c.model, *backend, 0, 1e-3).strain_energy, 1);
}

}  // namespace
}  // namespace phyxel
