/// Masses, volumes, selections, degenerate clouds and surfels.
#include "phyxel/model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "model/assembly.hpp"
#include "model/cloud_piece.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/physics/weight.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

TEST(Weight, IntegratesToOne) {
  const double h = 0.7;
  double sum = 0;
  const int n = 20000;
  for (int k = 0; k < n; ++k) {
    const double r = (k + 0.5) * h / n;
    sum += 4 * M_PI * r * r * weight(r, h) * h / n;
  }
  EXPECT_NEAR(sum, 1, 1e-8);  // midpoint rule, h²/24 n² times the second derivative
  EXPECT_EQ(weight(h, h), 0);
}

/// A rotation keeps its axis and lengths, and turns what is across by its angle, by the right hand.
TEST(Rotation, TurnsByItsAngleAboutItsAxis) {
  for (const Vec3d& axis : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}, Vec3d{2, -1, 3}}) {
    const Vec3d a = axis / norm(axis);
    for (const double angle : {1e-3, 1.0, 3.0, 5.0}) {
      const Mat3d r = rotation_by(angle * a);
      EXPECT_LT(norm(r * a - a), 1e-15);
      for (const Vec3d& v : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0.3, 0.4, -0.5}}) {
        const Vec3d across = v - dot(v, a) * a, ahead = cross(a, across);
        EXPECT_LT(norm(r * across - std::cos(angle) * across - std::sin(angle) * ahead), 1e-15);
      }
    }
  }
  EXPECT_EQ(rotation_by({}) * (Vec3d{1, 2, 3}), (Vec3d{1, 2, 3}));
}

/// Ranks that read files of their own are told apart by whatever the files hold.
TEST(CloudDigest, TellsCloudsApartByAllTheyHave) {
  Cloud cloud = lattice(2, 2, 2, 0.1);
  cloud.surface = {
      {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}}, {{0, 1, 2}}};
  cloud.regions = {{"a", {0, 1}}, {"b", {}}};
  std::set<std::uint64_t> seen{cloud_digest(cloud)};
  const auto changed = [&](const auto& change) {
    Cloud other = cloud;
    change(other);
    seen.insert(cloud_digest(other));
  };
  changed([](Cloud& c) { c.position[7].z += 1e-15; });
  changed([](Cloud& c) { c.volume[7] *= 2; });
  changed([](Cloud& c) { c.volume.clear(); });
  changed([](Cloud& c) { c.surface.position[2].y = 2; });
  changed([](Cloud& c) { c.surface.triangle[0] = {0, 2, 1}; });
  changed([](Cloud& c) { c.surface.triangle.clear(); });
  changed([](Cloud& c) { c.regions["a"] = {0, 2}; });
  changed([](Cloud& c) { c.regions["c"] = {}; });
  changed([](Cloud& c) { c.regions = {{"a", {}}, {"b", {0, 1}}}; });
  EXPECT_EQ(seen.size(), 10u);
  EXPECT_EQ(seen.count(cloud_digest(cloud)), 1u);
}

TEST(KernelMasses, HaveTheBodysDensityOnAverage) {
  Scene scene = one_body();
  scene.bodies[0].volume_rule = VolumeRule::kernel;
  scene.bodies[0].neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  const Model model = model_of(scene, lattice(6, 5, 7, 0.1, 0.2));
  EXPECT_TRUE(model.parts[0].kernel_volumes);
  const auto spacing = mean_spacing(model.position, 10);
  double mean = 0;
  for (Index i = 0; i < model.size(); ++i) {
    double density = model.mass[i] * weight(0, model.neighbourhood.support[i]);
    for (const Index j : model.neighbourhood.neighbours.row(i)) {
      density += model.mass[j] * weight(norm(model.position[j] - model.position[i]),
                                        model.neighbourhood.support[i]);
    }
    EXPECT_NEAR(model.mass[i] / model.volume[i], density, 1e-10 * density);  // v = m / ρ_i
    // m_i = s r̄_i³ ρ with one s for all.
    EXPECT_NEAR(model.mass[i] / std::pow(spacing[i], 3), model.mass[0] / std::pow(spacing[0], 3),
                1e-10 * model.mass[0] / std::pow(spacing[0], 3));
    mean += density / model.size();
  }
  EXPECT_NEAR(mean, 1000, 1e-9);
}

TEST(GeometricMasses, AreDensityTimesVolume) {
  const Model model = model_of(one_body(), lattice(3, 3, 3, 0.1, 0.1));
  EXPECT_FALSE(model.parts[0].kernel_volumes);
  for (Index i = 0; i < model.size(); ++i) EXPECT_DOUBLE_EQ(model.mass[i], 1.0);
}

TEST(Degenerate, IsolatedCollinearCoplanarAndCoincidentAreNamed) {
  Cloud cloud = lattice(3, 3, 3, 1);                                       // 0 to 26, sound
  for (int k = 0; k < 3; ++k) cloud.position.push_back({20.0 + k, 0, 0});  // 27-29 thread
  for (int k = 0; k < 9; ++k)
    cloud.position.push_back({40.0 + k % 3, k / 3 * 1.0, 0});  // 30-38 sheet
  cloud.position.push_back({80, 0, 0});                        // 39 alone
  cloud.position.push_back({0.5, 0.5, 0.5});                   // 40 on top of phyxel 0
  cloud.volume.assign(cloud.position.size(), 1);
  Scene scene = one_body();
  scene.bodies[0].neighbourhood.radius = 1.6;
  const Model model = model_of(scene, cloud);
  EXPECT_EQ(model.degenerate.isolated, (std::vector<Index>{39}));
  EXPECT_EQ(model.degenerate.collinear, (std::vector<Index>{27, 28, 29}));
  EXPECT_EQ(model.degenerate.coplanar, (std::vector<Index>{30, 31, 32, 33, 34, 35, 36, 37, 38}));
  EXPECT_EQ(model.degenerate.coincident, (std::vector<Index>{0, 40}));
  ASSERT_FALSE(model.warnings.empty());
  EXPECT_THAT(model.warnings[0], HasSubstr("1 isolated (39)"));
  EXPECT_THAT(model.warnings[0], HasSubstr("9 with coplanar neighbours (30, 31, 32, 33, 34, ...)"));
}

/// Closer than 1e-10 of the support, a phyxel counts as on top of another.
TEST(Degenerate, CoincidentMeansCloserThanATenBillionthOfTheSupport) {
  for (const double apart : {0.0, 0.9e-10, 1.1e-10, 1e-8}) {
    Cloud cloud = lattice(3, 3, 3, 1);
    for (Vec3d& p : cloud.position) p -= Vec3d{0.5, 0.5, 0.5};  // the first one at 0, exactly
    cloud.position.push_back({2 * apart, 0, 0});
    cloud.volume.assign(cloud.position.size(), 1);
    Scene scene = one_body();
    scene.bodies[0].neighbourhood.radius = 2;
    EXPECT_EQ(model_of(scene, cloud).degenerate.coincident.size(), apart < 1e-10 ? 2u : 0u)
        << apart;
  }
}

std::string message_of(const Selection& selection) {
  Scene scene = one_body();
  FixRequest fix{selection};
  fix.select.where = "s.toml:9:3";
  scene.bodies[0].fixed.push_back(fix);
  Cloud cloud = lattice(2, 2, 2, 1);
  cloud.regions["mouth"] = {0};
  try {
    model_of(scene, cloud);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Selection, ErrorsNameTheLineAndWhatThereIs) {
  Selection selection;
  selection.region = "moth";
  EXPECT_THAT(message_of(selection), HasSubstr("s.toml:9:3"));
  EXPECT_THAT(message_of(selection), HasSubstr("did you mean \"mouth\"?"));
  selection = {};
  selection.box = Selection::Box{{5, 5, 5}, {6, 6, 6}};
  EXPECT_THAT(message_of(selection), HasSubstr("[0.5, 0.5, 0.5] to [1.5, 1.5, 1.5]"));
  selection = {};
  selection.indices = std::vector<Index>{8};
  EXPECT_THAT(message_of(selection), HasSubstr("phyxel 8"));
  selection = {};
  selection.ball = Selection::Ball{{0.5, 0.5, 0.5}, 0.1};
  EXPECT_EQ(message_of(selection), "");
}

TEST(Selection, APhyxelFollowsOneMotionOnly) {
  Scene scene = one_body();
  FixRequest fix;
  fix.select.all = true;
  scene.bodies[0].fixed = {fix, fix};
  EXPECT_THROW(model_of(scene, lattice(2, 2, 2, 1)), InputError);
}

TEST(Loads, ForceIsSharedByMassAndDensityByVolume) {
  Scene scene = one_body();
  LoadRequest load;
  load.select.indices = std::vector<Index>{1, 2};
  load.force = {6, 0, 0};
  load.force_density = {0, 10, 0};
  scene.bodies[0].loads.push_back(load);
  Cloud cloud = lattice(2, 2, 2, 1);
  cloud.volume[2] = 2;
  const Model model = model_of(scene, cloud);
  EXPECT_EQ(model.loads[0].phyxels, (std::vector<Index>{1, 2}));
  EXPECT_DOUBLE_EQ(model.loads[0].force[0].x, 2);
  EXPECT_DOUBLE_EQ(model.loads[0].force[1].x, 4);
  EXPECT_DOUBLE_EQ(model.loads[0].force[1].y, 20);
}

/// Surfels around a lattice block.
Cloud block_with_surfels() {
  Cloud cloud = lattice(5, 5, 5, 0.1, 0.1);
  std::mt19937_64 engine(9);
  for (int s = 0; s < 60; ++s) {
    Vec3d n = normalised(uniform_vector(engine, 1));
    cloud.surface.position.push_back(Vec3d{0.25, 0.25, 0.25} + 0.3 * n);
    cloud.surface.normal.push_back(n);
  }
  return cloud;
}

TEST(Surfels, FollowAnAffineMapExactly) {
  const Cloud cloud = block_with_surfels();
  const Model model = model_of(one_body(), cloud);
  EXPECT_EQ(model.surfels.unreached, 0);
  Mat3d g;
  std::mt19937_64 engine(4);
  for (int e = 0; e < 9; ++e) g(e / 3, e % 3) = uniform(engine, -0.4, 0.4);
  std::vector<Vec3d> u;
  for (const Vec3d& x : model.position) u.push_back(g * x + Vec3d{1, 2, 3});
  for (const auto& [precision, tolerance] :
       {std::pair{Precision::double_, 1e-13}, std::pair{Precision::single, 2e-5}}) {
    const auto backend = make_test_backend(model, precision);
    backend->upload(state_of(u));
    SurfelState surfels;
    backend->advect_surfels(surfels);
    const Mat3d f = identity<double>() + g;
    for (std::size_t s = 0; s < surfels.position.size(); ++s) {
      const Vec3d x = cloud.surface.position[s];
      EXPECT_LT(norm(surfels.position[s] - (f * x + Vec3d{1, 2, 3})), tolerance);  // rounding
      // Normals go with F⁻ᵀ: they stay normal to mapped tangents.
      const Vec3d n = cloud.surface.normal[s];
      const Vec3d tangent = cross(n, Vec3d{0.3, -0.5, 0.8});
      EXPECT_NEAR(dot(surfels.normal[s], f * tangent), 0, 10 * tolerance);
      EXPECT_NEAR(norm(surfels.normal[s]), 1, 1e-12);
      EXPECT_GT(dot(surfels.normal[s], cofactor(f) * n), 0);
    }
  }
}

TEST(Surfels, OutOfReachFollowTheNearestPhyxel) {
  Cloud cloud = lattice(4, 4, 4, 0.1);
  cloud.surface.position = {{3, 0.2, 0.2}};
  cloud.surface.normal = {{1, 0, 0}};
  const Model model = model_of(one_body(), cloud);
  EXPECT_EQ(model.surfels.unreached, 1);
  ASSERT_EQ(model.warnings.size(), 1u);
  const auto backend = make_test_backend(model, Precision::double_);
  backend->upload(state_of(std::vector<Vec3d>(64, Vec3d{0.5, 0, 0})));
  SurfelState surfels;
  backend->advect_surfels(surfels);
  EXPECT_NEAR(surfels.position[0].x, 3.5, 1e-12);  // a translation carries it along
}

TEST(Model, InverseListsCostNothingWhereSupportIsUniform) {
  const Cloud cloud = lattice(4, 4, 4, 0.1, 0.2);
  const Model uniform = model_of(one_body(), cloud);
  EXPECT_TRUE(uniform.neighbourhood.symmetric);
  EXPECT_EQ(uniform.neighbourhood.inverse_lists.indices.size(), 0u);
  EXPECT_EQ(&uniform.neighbourhood.inverse(), &uniform.neighbourhood.neighbours);
  EXPECT_EQ(uniform.pairs(), uniform.neighbourhood.neighbours.entries());
  const auto names = [](const Backend& backend) {
    std::vector<std::string> list;
    for (const ArrayBytes& array : backend.memory()) list.push_back(array.name);
    return list;
  };
  // Terms a scene leaves out allocate nothing.
  EXPECT_THAT(
      names(*make_test_backend(uniform, Precision::single)),
      ::testing::Not(::testing::Contains(::testing::AnyOf("loads", "inverse neighbour lists"))));
  Scene scene = one_body();
  scene.bodies[0].neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  LoadRequest load;
  load.select.all = true;
  load.force = {1, 0, 0};
  scene.bodies[0].loads.push_back(load);
  const Model adaptive = model_of(scene, cloud);
  EXPECT_THAT(names(*make_test_backend(adaptive, Precision::single)),
              ::testing::IsSupersetOf({"loads", "inverse neighbour lists"}));
}

/// Phyxels are sorted by material, the body's own first; where inclusions overlap, the last counts;
/// selections by number mean the cloud's, before that.
TEST(Inclusions, HaveMaterialsOfTheirOwn) {
  Scene scene = one_body();
  const Cloud cloud = lattice(4, 2, 2, 0.1);  // phyxel i is in column i % 4 along x
  BodyRequest& body = scene.bodies[0];
  body.spin = {0, 0, 1};
  Material hard = body.material, heavy = body.material;
  hard.young = 7e5;
  heavy.density = 3000;
  body.inclusions = {
      {.select = {.box = Selection::Box{{0.2, -1, -1}, {1, 1, 1}}}, .material = hard},
      {.select = {.box = Selection::Box{{0.3, -1, -1}, {1, 1, 1}}}, .material = heavy}};
  body.fixed.push_back({.select = {.indices = std::vector<Index>{3, 4}}});
  const Model model = model_of(scene, cloud);
  ASSERT_EQ(model.parts.size(), 3u);
  EXPECT_TRUE(model.has_inclusions());
  EXPECT_EQ(model.parts[0].end, 8);
  EXPECT_EQ(model.parts[1].end, 12);
  EXPECT_EQ(model.parts[1].material.young, 7e5);
  EXPECT_EQ(model.parts[2].name, "body, inclusion 2");
  for (const Part& part : model.parts) EXPECT_EQ(part.size, part.end - part.begin) << part.name;
  EXPECT_THAT(describe_phyxel(model, 7), HasSubstr("phyxel 7 of body \"body\", at rest at (0."));
  EXPECT_THAT(describe_phyxel(model, 8), HasSubstr("of body \"body, inclusion 1\""));
  EXPECT_THAT(describe_phyxel(model, 15), HasSubstr("of body \"body, inclusion 2\""));
  EXPECT_EQ(describe_phyxel(model, 16), "no phyxel");
  EXPECT_NEAR(model.parts[0].mass, 8, 1e-12);
  EXPECT_NEAR(model.parts[2].mass, 12, 1e-12);
  for (Index i = 0; i < model.size(); ++i) {
    const double x = model.position[i].x;
    EXPECT_EQ(x < 0.2, i < 8);
    EXPECT_EQ(x > 0.3, i >= 12);
  }
  ASSERT_EQ(model.motions[0].phyxels.size(), 2u);
  EXPECT_EQ(model.position[model.motions[0].phyxels[0]], cloud.position[4]);
  EXPECT_EQ(model.position[model.motions[0].phyxels[1]], cloud.position[3]);
  // All turn about the mass centre of the body, (0.05 4 + 0.15 4 + 0.25 4 + 0.35 12) / 24 along x.
  for (const Part& part : model.parts) EXPECT_NEAR(part.centre.x, 0.25, 1e-12);
}

TEST(Inclusions, OfNothingOrOfAllAreRefused) {
  Scene scene = one_body();
  const Cloud cloud = lattice(2, 2, 2, 0.1);
  scene.bodies[0].inclusions = {
      {.select = {.box = Selection::Box{{5, 5, 5}, {6, 6, 6}}, .where = "a.toml:7:1"},
       .material = rubber()}};
  const auto message = [&] {
    try {
      model_of(scene, cloud);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(message(), HasSubstr("a.toml:7:1"));
  scene.bodies[0].inclusions[0].select = {.all = true, .where = "a.toml:8:1"};
  EXPECT_THAT(message(), HasSubstr("no phyxel is left of its own material"));
}

/// The kernel's volumes are those of a body of one material; masses have each material's density.
TEST(Inclusions, HaveTheKernelsVolumes) {
  Scene scene = one_body();
  Cloud cloud = lattice(4, 3, 2, 0.1);
  cloud.volume.clear();
  const Model plain = model_of(scene, cloud);
  Material heavy = scene.bodies[0].material;
  heavy.density *= 3;
  scene.bodies[0].inclusions = {
      {.select = {.box = Selection::Box{{0.2, -1, -1}, {1, 1, 1}}}, .material = heavy}};
  const Model model = model_of(scene, cloud);
  ASSERT_EQ(model.parts.size(), 2u);
  for (Index i = 0; i < model.size(); ++i) {
    const auto at = std::find(plain.position.begin(), plain.position.end(), model.position[i]) -
                    plain.position.begin();
    // Sums over the same neighbours in another order.
    EXPECT_NEAR(model.volume[i], plain.volume[at], 1e-14 * plain.volume[at]);
    EXPECT_NEAR(model.mass[i], (i < 12 ? 1 : 3) * plain.mass[at], 1e-14 * plain.mass[at]);
  }
}

/// One entry for each axis of a phyxel.
TEST(Selection, EntriesMayShareAPhyxelAlongOtherAxes) {
  Scene scene = one_body();
  const Cloud cloud = lattice(3, 3, 3, 0.1);
  auto& fixed = scene.bodies[0].fixed;
  fixed = {{.select = {.all = true}, .axes = {.x = false, .y = false, .z = true}},
           {.select = {.indices = std::vector<Index>{0, 1}},
            .axes = {.x = true, .y = true, .z = false}}};
  const Model model = model_of(scene, cloud);
  EXPECT_EQ(model.motions.size(), 2u);
  const std::vector<char> held = held_phyxels(model);  // along all axes by one entry
  EXPECT_EQ(std::count(held.begin(), held.end(), 1), 0);
  // Along z, too, the phyxels are the second entry's, which holds more axes.
  fixed[1].axes.z = true;
  const Model shared = model_of(scene, cloud);
  EXPECT_EQ(shared.motions[0].phyxels.size(), 25u);
  EXPECT_EQ(shared.motions[1].phyxels, (std::vector<Index>{0, 1}));
  // Neither holds all that the other does.
  fixed[0].axes.y = true;
  fixed[1].axes.y = false;
  EXPECT_THROW(model_of(scene, cloud), InputError);
}

TEST(Model, FarFromTheOriginFloatLosesNothing) {
  // A million metres away: displacements and offsets are relative, so float forces agree with
  // those at the origin to the rounding of positions in double, 1e-10 m over 0.1 m.
  Scene scene = one_body();
  Cloud near = lattice(4, 4, 4, 0.125, 0.2), far = near;
  for (Vec3d& p : far.position) p += Vec3d{1048576, -1048576, 524288};
  const Model model_near = model_of(scene, near), model_far = model_of(scene, far);
  const auto u = random_deformation(model_near, 0.01);
  std::vector<Vec3d> force[2];
  for (int k = 0; k < 2; ++k) {
    const auto backend = make_test_backend(k ? model_far : model_near, Precision::single);
    backend->upload(state_of(u));
    backend->internal_forces(force[k]);
  }
  double worst = 0, largest = 0;
  for (std::size_t i = 0; i < u.size(); ++i) {
    worst = std::max(worst, norm(force[0][i] - force[1][i]));
    largest = std::max(largest, norm(force[0][i]));
  }
  EXPECT_LT(worst, 2e-6 * largest);
}

}  // namespace
}  // namespace phyxel
