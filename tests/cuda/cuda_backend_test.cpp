/// The GPU solver against the CPU solver, on bodies of many tiles with every term. (The physics
/// itself is tested by the CPU's tests, which also run on the GPU: cuda.*)
#include "solver/cuda_backend.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/laws.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

struct Case {
  const char* name;
  bool adaptive, capped, everything;
  bool closed = false;      ///< Gradients of the first body,
  bool one_each = false;    ///< whose neighbour has supports of its own.
  bool inclusions = false;  ///< Of other materials, in the first body.
  bool plastic = false;     ///< The first body yields.
  bool viscous = false;     ///< All materials are viscous.
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

/// Two bodies of thousands of phyxels, sizes not multiples of a tile or a warp.
Scene scene_of(const Case& c) {
  Scene scene = one_body();
  scene.gravity = {0.3, 0, -9.81};
  BodyRequest body = scene.bodies[0];
  body.spin = {0, 1, 2};
  if (c.adaptive) body.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  if (c.capped) body.neighbourhood.max_neighbours = 24;
  scene.bodies = {body, body};
  BodyRequest &first = scene.bodies[0], &second = scene.bodies[1];
  if (c.closed) {
    first.closure = 0.01;
    if (c.one_each) second.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  }
  FixRequest fix;
  fix.select.box = Selection::Box{{-1, -1, -1}, {0.15, 3, 3}};
  first.fixed.push_back(fix);
  second.material.young = 4e5;
  if (c.everything) {
    first.material.volume_stiffness = 2e5;
    first.material.damping = 1.5;
    if (!c.adaptive) first.material.hourglass = 0.2;  // and the second has none
    if (c.adaptive) first.material.law = "neo-hookean";
    second.material.law = c.adaptive ? "corotated" : "small-strain";
    LoadRequest load;
    load.select.box = Selection::Box{{1.2, -1, -1}, {3, 3, 3}};
    load.force = {0, 30, 0};
    load.ramp = 0.02;
    first.loads.push_back(load);
    MotionRequest motion;
    motion.select.box = Selection::Box{{-1, -1, -1}, {3, 0.1, 3}};
    motion.velocity = {0.1, 0, 0};
    motion.amplitude = {0, 0.01, 0};
    motion.frequency = 3;
    second.motions.push_back(motion);
  }
  if (c.plastic) {
    first.material.law = "j2";
    first.material.parameters = {{"yield_stress", 1e4}, {"hardening", 5e4}};
  }
  if (c.viscous) {
    first.material.viscosity = 2e-4;
    second.material.viscosity = 1e-4;
  }
  if (c.inclusions) {
    Material hard = first.material, light = first.material;
    hard.young *= 4;
    hard.law = "neo-hookean";
    hard.parameters = {};
    light.poisson = 0.1;
    light.density *= 0.5;
    light.damping = 3;
    first.inclusions = {
        {.select = {.ball = Selection::Ball{{0.5, 0.3, 0.4}, 0.3}}, .material = hard},
        {.select = {.box = Selection::Box{{0.9, -1, -1}, {3, 3, 3}}}, .material = light}};
  }
  return scene;
}
/// A block with a surface, which its gradients are closed to, with a corner at the origin.
Cloud block(Vec3d size) {
  Cloud cloud = make_shape({.name = "block",
                            .size = size,
                            .spacing = 0.1,
                            .jitter = 0.2,
                            .placement = ShapeRequest::Placement::nodes});
  for (Vec3d& x : cloud.position) x += 0.5 * size;
  for (Vec3d& x : cloud.surface.position) x += 0.5 * size;
  return cloud;
}
Model model_of_case(const Case& c) {
  std::vector<Cloud> clouds{lattice(17, 13, 15, 0.1, 0.2, 3), lattice(9, 14, 8, 0.12, 0.1, 4)};
  if (c.closed) clouds[0] = block({1.6, 1.2, 1.4});
  return build_model(scene_of(c), clouds);
}

double largest(const std::vector<Vec3d>& values) {
  double most = 0;
  for (const Vec3d& v : values) most = std::max(most, norm(v));
  return most;
}
double apart(const std::vector<Vec3d>& a, const std::vector<Vec3d>& b) {
  double most = 0;
  for (std::size_t i = 0; i < b.size(); ++i) most = std::max(most, norm(a[i] - b[i]));
  return most / largest(b);
}

class CudaBackend : public ::testing::TestWithParam<Case> {};

TEST_P(CudaBackend, ForcesAndGradientsEqualTheCpus) {
  const Model model = model_of_case(GetParam());
  const State state = state_of(random_deformation(model, 0.005));
  const auto cpu = make_cpu_backend(model, Precision::double_);
  cpu->upload(state);
  std::vector<Vec3d> expected, force;
  std::vector<Mat3d> expected_gradient, gradient;
  cpu->internal_forces(expected);
  cpu->displacement_gradients(expected_gradient);
  // As for the CPU's own: 40 neighbours' roundings through an inverse matrix.
  const std::pair<Precision, double> cases[] = {
      {Precision::double_, 1e-12}, {Precision::single, 3e-5}, {Precision::mixed, 3e-5}};
  for (const auto& [precision, tolerance] : cases) {
    const auto gpu = make_test_backend(model, precision);
    gpu->upload(state);
    gpu->internal_forces(force);
    gpu->displacement_gradients(gradient);
    EXPECT_LT(apart(force, expected), tolerance);
    double worst = 0;
    for (std::size_t i = 0; i < gradient.size(); ++i) {
      for (int e = 0; e < 9; ++e) {
        worst = std::max(worst,
                         std::abs(gradient[i](e / 3, e % 3) - expected_gradient[i](e / 3, e % 3)));
      }
    }
    EXPECT_LT(worst, tolerance);
  }
}

State after(Backend& backend, const Model& model, const Scene& scene, double dt, int steps) {
  Solver solver(backend, initial_state(model, scene, dt));
  solver.step(steps);
  return solver.state();
}

TEST_P(CudaBackend, TrajectoriesStayWithTheCpus) {
  const Scene scene = scene_of(GetParam());
  const Model model = model_of_case(GetParam());
  const double dt = 0.5 * step_limit(model).largest_step;
  const auto cpu = make_cpu_backend(model, Precision::double_);
  const State expected = after(*cpu, model, scene, dt, 300);
  // 300 steps: 1e-16 and 6e-8 a step, grown by the motion some tenfold.
  const std::pair<Precision, double> cases[] = {
      {Precision::double_, 1e-12}, {Precision::single, 3e-4}, {Precision::mixed, 3e-4}};
  for (const auto& [precision, tolerance] : cases) {
    const auto gpu = make_test_backend(model, precision);
    const State found = after(*gpu, model, scene, dt, 300);
    EXPECT_LT(apart(found.displacement, expected.displacement), tolerance);
    EXPECT_LT(apart(found.velocity, expected.velocity), 30 * tolerance);
    ASSERT_EQ(found.history.size(), expected.history.size());
    for (std::size_t k = 0; k < found.history.size(); ++k) {
      const std::vector<double>&a = found.history[k].values, &b = expected.history[k].values;
      double worst = 0, most = 0;
      for (std::size_t i = 0; i < b.size(); ++i) {
        worst = std::max(worst, std::abs(a[i] - b[i]));
        most = std::max(most, std::abs(b[i]));
      }
      EXPECT_LT(worst, 30 * tolerance * most) << found.history[k].name;
      EXPECT_GT(most, 0) << found.history[k].name;
    }
  }
}

TEST_P(CudaBackend, TwoRunsAndARestartAreBitwiseEqual) {
  const Scene scene = scene_of(GetParam());
  const Model model = model_of_case(GetParam());
  const double dt = 0.5 * step_limit(model).largest_step;
  for (const Precision precision : {Precision::single, Precision::double_, Precision::mixed}) {
    const auto first = make_test_backend(model, precision),
               second = make_test_backend(model, precision);
    const State whole = after(*first, model, scene, dt, 200);
    Solver begun(*second, initial_state(model, scene, dt));
    for (int s = 0; s < 77; ++s) begun.step();
    const State middle = begun.state();
    const auto third = make_test_backend(model, precision);
    Solver rest(*third, middle);
    while (rest.steps() < 200) rest.step();
    EXPECT_TRUE(rest.state().displacement == whole.displacement);
    EXPECT_TRUE(rest.state().velocity == whole.velocity);
    EXPECT_TRUE(rest.state().history == whole.history);
  }
}

/// The limit at a deformed state is that of the host, and looking for it changes no bit of what
/// comes after.
TEST_P(CudaBackend, TheLimitOfADeformedStateIsTheHosts) {
  const Scene scene = scene_of(GetParam());
  const Model model = model_of_case(GetParam());
  const double dt = 0.5 * step_limit(model).largest_step;
  const auto cpu = make_cpu_backend(model, Precision::double_);
  // Rounding, in double; in float, forces lose three digits in the difference, and the iteration
  // may end one earlier or later, at 2% either way.
  const std::pair<Precision, double> cases[] = {
      {Precision::double_, 1e-6}, {Precision::single, 0.02}, {Precision::mixed, 0.02}};
  for (const auto& [precision, tolerance] : cases) {
    const auto gpu = make_test_backend(model, precision),
               unbroken = make_test_backend(model, precision);
    const State start = initial_state(model, scene, dt);
    Solver solver(*gpu, start), other(*unbroken, start);
    for (int s = 0; s < 60; ++s) {
      if (s == 40) {
        const State middle = solver.state();
        const double found = present_step_limit(model, *gpu).omega_max;
        cpu->upload(middle);
        const double expected = present_step_limit(model, *cpu).omega_max;
        EXPECT_NEAR(found, expected, tolerance * expected);
        EXPECT_TRUE(solver.state().displacement == middle.displacement);
      }
      solver.step();
      other.step();
    }
    EXPECT_TRUE(solver.state().displacement == other.state().displacement);
    EXPECT_TRUE(solver.state().velocity == other.state().velocity);
    EXPECT_TRUE(solver.state().history == other.state().history);
  }
}

/// Bodies that stay in shared memory for many steps a launch.
struct ResidentCase {
  const char* name;
  const char* path;  ///< A part of the backend's name in float.
  Case terms;
  std::vector<Cloud> clouds;
};
void PrintTo(const ResidentCase& c, std::ostream* out) { *out << c.name; }

const std::vector<Cloud>& large_clouds() {
  static const std::vector<Cloud> clouds{lattice(17, 13, 15, 0.1, 0.2, 3),
                                         lattice(9, 14, 8, 0.12, 0.1, 4)};
  return clouds;
}
/// Bodies of a cluster each.
const std::vector<Cloud>& small_clouds() {
  static const std::vector<Cloud> clouds{lattice(15, 5, 7, 0.1, 0.2, 3),
                                         lattice(9, 5, 8, 0.12, 0.1, 4)};
  return clouds;
}
/// The same sizes, the first with a surface.
std::vector<Cloud> with_surface(std::vector<Cloud> clouds, Vec3d size) {
  clouds[0] = block(size);
  return clouds;
}
/// Many, of which one takes fewer blocks than the others.
std::vector<Cloud> many_clouds() {
  std::vector<Cloud> clouds(20, lattice(7, 5, 6, 0.1, 0.2, 5));
  clouds[7] = lattice(5, 4, 3, 0.1, 0.2, 6);
  return clouds;
}

class CudaResidence : public ::testing::TestWithParam<ResidentCase> {};

TEST_P(CudaResidence, EqualsLaunchesToTheLastBit) {
  Scene scene = scene_of(GetParam().terms);
  if (GetParam().terms.everything) {  // but what changes from step to step
    scene.bodies[0].loads[0].ramp = 0;
    scene.bodies[1].motions.clear();
  }
  scene.bodies.resize(GetParam().clouds.size(), scene.bodies[0]);
  const Model model = build_model(scene, GetParam().clouds);
  const double dt = 0.5 * step_limit(model).largest_step;
  for (const Precision precision : {Precision::single, Precision::mixed, Precision::double_}) {
    const auto resident = make_cuda_backend(model, precision),
               launched = make_cuda_backend(model, precision, 0, CudaPath::launches);
    if (precision == Precision::single) {
      EXPECT_NE(resident->name().find(GetParam().path), std::string::npos) << resident->name();
    }
    EXPECT_EQ(launched->name().find("resident"), std::string::npos);
    for (const int steps : {2, 300}) {  // within a launch, and more than one
      const State a = after(*resident, model, scene, dt, steps),
                  b = after(*launched, model, scene, dt, steps);
      EXPECT_TRUE(a.displacement == b.displacement) << resident->name() << ' ' << steps;
      EXPECT_TRUE(a.velocity == b.velocity) << resident->name() << ' ' << steps;
      EXPECT_TRUE(a.history == b.history) << resident->name() << ' ' << steps;
    }
    Solver looked_at(*resident, initial_state(model, scene, dt));
    for (int s = 0; s < 40; ++s) {
      if (s == 17) present_step_limit(model, *resident);
      looked_at.step();
    }
    const State unseen = after(*launched, model, scene, dt, 40);
    EXPECT_TRUE(looked_at.state().displacement == unseen.displacement) << resident->name();
    EXPECT_TRUE(looked_at.state().velocity == unseen.velocity) << resident->name();
    EXPECT_TRUE(looked_at.state().history == unseen.history) << resident->name();
  }
}

TEST(CudaResidenceOf, BodiesWithListsOfTheirOwnForEachPassInEveryPrecision) {
  const Case terms{"", true, true, true};
  Scene scene = scene_of(terms);
  scene.bodies.resize(1);
  scene.bodies[0].loads[0].ramp = 0;
  scene.bodies[0].fixed[0].select = {.indices = {{0, 1, 2}}};
  scene.bodies[0].loads[0].select = {.all = true};
  const std::vector<Cloud> clouds{lattice(7, 5, 5, 0.1, 0.3, 8)};
  const Model model = build_model(scene, clouds);
  const double dt = 0.2 * step_limit(model).largest_step;
  for (const Precision precision : {Precision::single, Precision::mixed, Precision::double_}) {
    const auto resident = make_cuda_backend(model, precision),
               launched = make_cuda_backend(model, precision, 0, CudaPath::launches);
    EXPECT_NE(resident->name().find("resident"), std::string::npos) << resident->name();
    for (Backend* backend : {resident.get(), launched.get()}) {
      backend->upload(initial_state(model, scene, dt));
      backend->step(0, dt, 13);
      backend->step(7, 2 * dt, 17);  // while steps are under way
    }
    State a, b;
    resident->download(a);
    launched->download(b);
    EXPECT_TRUE(a.displacement == b.displacement) << resident->name();
    EXPECT_TRUE(a.velocity == b.velocity) << resident->name();
    EXPECT_GT(largest(a.displacement), 0);
  }
}

TEST(CudaGraphs, EqualLaunchesToTheLastBit) {
  const Scene scene = one_body();
  const std::vector<Cloud> clouds{lattice(34, 31, 29, 0.1, 0.2, 9)};
  const Model model = build_model(scene, clouds);
  const double dt = 0.2 * step_limit(model).largest_step;
  for (const Precision precision : {Precision::single, Precision::mixed, Precision::double_}) {
    const auto recorded = make_cuda_backend(model, precision),
               launched = make_cuda_backend(model, precision, 0, CudaPath::launches);
    EXPECT_NE(recorded->name().find("graphs of 16 steps"), std::string::npos) << recorded->name();
    State start = initial_state(model, scene, dt), a, b;
    start.displacement = random_deformation(model, 0.003);
    for (const auto& [backend, out] : {std::pair{&recorded, &a}, std::pair{&launched, &b}}) {
      (*backend)->upload(start);
      (*backend)->step(0, dt, 21);
      (*backend)->download(*out);  // with steps under way
      (*backend)->step(21, dt, 17);
      (*backend)->step(25, 1.5 * dt, 22);  // a graph of the step before is then void
      (*backend)->download(*out);
    }
    EXPECT_TRUE(a.displacement == b.displacement) << recorded->name();
    EXPECT_TRUE(a.velocity == b.velocity) << recorded->name();
    EXPECT_GT(largest(a.velocity), 0);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Bodies, CudaResidence,
    ::testing::Values(
        ResidentCase{"Mail", "blocks", {"", false, false, false}, large_clouds()},
        ResidentCase{"MailAdaptive", "blocks", {"", true, false, false}, large_clouds()},
        ResidentCase{"MailEverything", "blocks", {"", false, false, true}, large_clouds()},
        ResidentCase{"Cluster", "clusters", {"", false, false, false}, small_clouds()},
        ResidentCase{"ClusterAdaptive", "clusters", {"", true, false, false}, small_clouds()},
        ResidentCase{"ClusterEverything", "clusters", {"", false, false, true}, small_clouds()},
        ResidentCase{
            "ClusterAdaptiveEverything", "clusters", {"", true, false, true}, small_clouds()},
        ResidentCase{"MailInclusions",
                     "blocks",
                     {"", false, false, true, false, false, true},
                     large_clouds()},
        ResidentCase{"ClusterInclusions",
                     "clusters",
                     {"", false, false, true, false, false, true},
                     small_clouds()},
        ResidentCase{"MailClosed",
                     "blocks",
                     {"", false, false, false, true},
                     with_surface(large_clouds(), {1.4, 1, 1.2})},
        ResidentCase{"MailClosedBesideAdaptive",
                     "blocks",
                     {"", false, false, true, true, true},
                     with_surface(large_clouds(), {1.4, 1, 1.2})},
        ResidentCase{"ClusterClosed",
                     "clusters",
                     {"", false, false, false, true},
                     with_surface(small_clouds(), {1.3, 0.4, 0.6})},
        ResidentCase{"ClusterClosedBesideAdaptive",
                     "clusters",
                     {"", false, false, true, true, true},
                     with_surface(small_clouds(), {1.3, 0.4, 0.6})},
        ResidentCase{"ClusterClosedInclusions",
                     "clusters",
                     {"", false, false, true, true, false, true},
                     with_surface(small_clouds(), {1.3, 0.4, 0.6})},
        ResidentCase{"MailPlastic",
                     "blocks",
                     {"", false, false, false, false, false, false, true},
                     with_surface(large_clouds(), {1.4, 1, 1.2})},
        ResidentCase{"ClusterPlastic",
                     "clusters",
                     {"", false, false, false, false, false, false, true},
                     {lattice(15, 5, 7, 0.1, 0.2, 3)}},
        ResidentCase{"ClusterPlasticViscousInclusions",
                     "clusters",
                     {"", false, false, true, false, false, true, true, true},
                     small_clouds()},
        ResidentCase{"MailClosedPlasticViscous",
                     "blocks",
                     {"", false, false, true, true, false, false, true, true},
                     with_surface(large_clouds(), {1.4, 1, 1.2})},
        ResidentCase{"ManyClusters", "clusters", {"", false, false, false}, many_clouds()}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_P(CudaBackend, EnergiesAndMomentaEqualTheHosts) {
  const Scene scene = scene_of(GetParam());
  const Model model = model_of_case(GetParam());
  const double dt = 0.5 * step_limit(model).largest_step;
  const auto cpu = make_cpu_backend(model, Precision::double_);
  const auto gpu = make_test_backend(model, Precision::double_);
  const State state = after(*cpu, model, scene, dt, 150);
  gpu->upload(state);
  const Diagnostics e = diagnose(model, *cpu, 150, dt), d = diagnose(model, *gpu, 150, dt);
  EXPECT_EQ(d.step, 150);
  EXPECT_EQ(d.time, 150 * dt);
  // Sums of 4,323 terms in another order.
  const double energy = e.kinetic_energy + e.strain_energy;
  EXPECT_NEAR(d.kinetic_energy, e.kinetic_energy, 1e-12 * energy);
  EXPECT_NEAR(d.strain_energy, e.strain_energy, 1e-12 * energy);
  EXPECT_NEAR(d.volume_energy, e.volume_energy, 1e-12 * energy);
  EXPECT_NEAR(d.hourglass_energy, e.hourglass_energy, 1e-12 * energy);
  EXPECT_EQ(e.hourglass_energy > 0, GetParam().everything && !GetParam().adaptive);
  EXPECT_NEAR(d.gravity_energy, e.gravity_energy, 1e-12 * energy);
  EXPECT_NEAR(d.load_energy, e.load_energy, 1e-12 * energy);
  EXPECT_GT(e.kinetic_energy, 0.1 * energy);
  EXPECT_LT(norm(d.momentum - e.momentum), 1e-12 * norm(e.momentum));
  EXPECT_LT(norm(d.angular_momentum - e.angular_momentum), 1e-12 * norm(e.angular_momentum));
  EXPECT_NEAR(d.force_scale, e.force_scale, 1e-11 * e.force_scale);
  EXPECT_NEAR(d.torque_scale, e.torque_scale, 1e-11 * e.torque_scale);
  EXPECT_LT(norm(d.internal_force), 1e-12 * e.force_scale);
  EXPECT_NEAR(d.largest_speed, e.largest_speed, 1e-12 * e.largest_speed);
  EXPECT_NEAR(d.largest_displacement, e.largest_displacement, 1e-12 * e.largest_displacement);
  EXPECT_EQ(d.fastest_phyxel, e.fastest_phyxel);
  EXPECT_EQ(d.bad_phyxel, -1);
  EXPECT_EQ(d.inverted, e.inverted);

  State broken = state;
  broken.displacement[1234].y = std::nan("");
  gpu->upload(broken);
  const Diagnostics bad = diagnose(model, *gpu, 150, dt);
  ASSERT_GE(bad.bad_phyxel, 0);  // it, or a neighbour that its NaN has reached
  EXPECT_LT(norm(model.position[bad.bad_phyxel] - model.position[1234]), 1);
}

INSTANTIATE_TEST_SUITE_P(
    Terms, CudaBackend,
    ::testing::Values(
        Case{"Uniform", false, false, false}, Case{"Adaptive", true, false, false},
        Case{"Capped", true, true, false}, Case{"UniformEverything", false, false, true},
        Case{"AdaptiveEverything", true, false, true}, Case{"Closed", false, false, false, true},
        Case{"ClosedEverything", false, false, true, true},
        Case{"ClosedBesideAdaptive", false, false, true, true, true},
        Case{"Inclusions", false, false, true, false, false, true},
        Case{"Plastic", false, false, true, false, false, false, true},
        Case{"PlasticViscous", false, false, false, false, false, true, true, true},
        Case{"ClosedPlasticViscous", false, false, true, true, false, false, true, true}),
    [](const auto& test) { return std::string(test.param.name); });

TEST(CudaSurfels, EqualTheCpus) {
  const Model model = built_in_bodies("dino", "alien_head");
  const State state = state_of(random_deformation(model, 0.001));
  const auto cpu = make_cpu_backend(model, Precision::double_);
  cpu->upload(state);
  SurfelState expected, found;
  cpu->advect_surfels(expected);
  const double size = largest(expected.position);
  for (const auto& [precision, tolerance] :
       {std::pair{Precision::double_, 1e-13}, std::pair{Precision::single, 3e-6}}) {
    const auto gpu = make_test_backend(model, precision);
    gpu->upload(state);
    gpu->advect_surfels(found);
    ASSERT_EQ(found.position.size(), expected.position.size());
    double off = 0, turned = 0;
    for (std::size_t s = 0; s < found.position.size(); ++s) {
      off = std::max(off, norm(found.position[s] - expected.position[s]) / size);
      turned = std::max(turned, norm(found.normal[s] - expected.normal[s]));
    }
    EXPECT_LT(off, tolerance);
    EXPECT_LT(turned, 30 * tolerance);  // normals come from gradients
  }
}

/// Surfels that are moved after each step of a call are where the phyxels are, and leave those and
/// what they remember alone.
TEST(CudaSurfels, FollowEveryStepOnEveryPath) {
  Scene scene = one_body();
  scene.bodies[0].source.shape.name = "horn_bug";
  scene.bodies.push_back(scene.bodies[0]);
  scene.bodies[1].translation = {40, 0, 0};
  Material& metal = scene.bodies[1].material;
  metal.law = "j2";
  metal.parameters = {{"yield_stress", 50}, {"hardening", 1e4}};
  const Model model = build_model(scene);
  for (const Precision precision : {Precision::single, Precision::mixed, Precision::double_}) {
    const auto resident = make_cuda_backend(model, precision),
               launched = make_cuda_backend(model, precision, 0, CudaPath::launches),
               bare = make_cuda_backend(model, precision);
    // Step 1 goes by launches; then sixteen go together, and three. Surfels after 17 and after 20.
    std::vector<SurfelState> a, b;
    std::vector<State> after;
    const State start = state_of(random_deformation(model, 0.001));
    for (const auto& [backend, out] : {std::pair{&resident, &a}, std::pair{&launched, &b}}) {
      Solver solver(**backend, start);
      solver.step(17, true);
      (*backend)->advect_surfels(out->emplace_back());
      solver.step(3, true);
      (*backend)->advect_surfels(out->emplace_back());
      after.push_back(solver.state());
    }
    Solver alone(*bare, start);
    alone.step(20);
    after.push_back(alone.state());
    for (int k = 0; k < 2; ++k) {
      EXPECT_TRUE(a[k].position == b[k].position);
      EXPECT_TRUE(a[k].normal == b[k].normal);
      EXPECT_TRUE(after[k].displacement == after[2].displacement) << k;
      EXPECT_TRUE(after[k].history == after[2].history) << k;
    }
    EXPECT_FALSE(a[0].position == a[1].position);
    std::vector<Vec3d> moved;
    for (std::size_t s = 0; s < a[1].position.size(); ++s) {
      moved.push_back(a[1].position[s] - model.surfels.position[s]);
    }
    EXPECT_GT(largest(moved), 0);
  }
}

TEST(CudaMemory, TermsThatAreOffTakeNone) {
  const auto names = [](const Model& model, Precision precision) {
    std::vector<std::string> list;
    const auto backend = make_test_backend(model, precision);
    for (const ArrayBytes& array : backend->memory()) list.push_back(array.name);
    return list;
  };
  using ::testing::AnyOf;
  using ::testing::Contains;
  using ::testing::Not;
  EXPECT_THAT(names(model_of(one_body(), lattice(8, 8, 8, 0.1)), Precision::single),
              Not(Contains(AnyOf("loads", "supports", "inverse neighbour lists", "displacements",
                                 "surfels"))));
  EXPECT_THAT(
      names(model_of_case({"", true, true, true}), Precision::mixed),
      ::testing::IsSupersetOf({"loads", "supports", "inverse neighbour lists", "displacements"}));
}

/// Resident steps and launches add the caller's forces alike, before and after they change.
TEST(CudaExternalForces, AreTheSameBitsResidentAndByLaunches) {
  const Model model = model_of(one_body(), lattice(9, 5, 4, 0.1, 0.1));
  for (const Precision precision : {Precision::single, Precision::mixed, Precision::double_}) {
    const auto resident = make_cuda_backend(model, precision),
               launched = make_cuda_backend(model, precision, 0, CudaPath::launches);
    const State start = state_of(std::vector<Vec3d>(static_cast<std::size_t>(model.size())));
    Solver one(*resident, start), other(*launched, start);
    for (const double size : {2.0, -1.0, 0.0}) {
      std::vector<Vec3d> force;
      for (const Vec3d& x : model.position) force.push_back({size * x.y, size, -size * x.x});
      if (size == 0) force.clear();
      resident->set_external_forces(force);
      launched->set_external_forces(force);
      for (int k = 0; k < 25; ++k) one.step(), other.step();
      EXPECT_EQ(one.state().displacement, other.state().displacement);
      EXPECT_EQ(one.state().velocity, other.state().velocity);
    }
  }
}

TEST(CudaRefusal, OfWhatIsTheCallersOwn) {
  const auto refusal_of = [](auto&& work) -> std::string {
    try {
      work();
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  using ::testing::HasSubstr;
  const Cloud cloud = lattice(8, 8, 8, 0.1);
  Material material = rubber();
  material.custom_law = std::make_shared<Repeated>(material);
  const Model custom = model_of(one_body(material), cloud), ours = model_of(one_body(), cloud);
  EXPECT_THAT(refusal_of([&] { make_test_backend(custom, Precision::single); }),
              HasSubstr("body \"body\" has a law of the caller's own, \"repeated"));
  const auto backend = make_test_backend(ours, Precision::single);
  EXPECT_FALSE(backend->view());
}

}  // namespace
}  // namespace phyxel
