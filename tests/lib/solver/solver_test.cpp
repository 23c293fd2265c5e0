/// The time loop: step limit, energy, momentum, boundary conditions, restart.
#include "phyxel/solver.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <numbers>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// The largest frequency of a model, from the dense stiffness matrix of the components that no
/// support prescribes.
double dense_frequency(const Model& model) {
  const auto backend = make_test_backend(model, Precision::double_);
  std::vector<int> free;
  const std::vector<char> axes = prescribed_axes(model);
  for (int k = 0; k < 3 * model.size(); ++k) {
    if (!(axes[k / 3] >> k % 3 & 1)) free.push_back(k);
  }
  const auto size = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd stiffness(size, size);
  const double step = 1e-9;
  std::vector<Vec3d> force;
  for (Eigen::Index c = 0; c < size; ++c) {
    const int column = free[c];
    std::vector<Vec3d> u(model.position.size());
    (&u[column / 3].x)[column % 3] = step;
    backend->put_displacements(u);
    backend->internal_forces(force);
    for (Eigen::Index r = 0; r < size; ++r) {
      const int row = free[r];
      stiffness(r, c) = -(&force[row / 3].x)[row % 3] / step /
                        std::sqrt(model.mass[row / 3] * model.mass[column / 3]);
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
      0.5 * (stiffness + stiffness.transpose()).eval());
  return std::sqrt(solver.eigenvalues()[size - 1]);
}

TEST(StepLimit, EqualsTheLargestEigenvalueOfTheDenseStiffness) {
  Material material = rubber();
  material.volume_stiffness = 2e5;
  const Model model = model_of(one_body(material), lattice(4, 4, 3, 0.1, 0.2));
  const double omega = dense_frequency(model);
  const StepLimit limit = step_limit(model);
  // Lanczos stops at a residual of 0.2% of the eigenvalue and adds it: 0.1% of the frequency.
  EXPECT_GE(limit.omega_max, omega * (1 - 1e-6));
  EXPECT_LE(limit.omega_max, omega * 1.0015);
}

/// A lattice of which one layer is fixed and two others are moved along one and two axes.
Scene supported_scene() {
  Scene scene = one_body();
  BodyRequest& body = scene.bodies[0];
  const auto layer = [](double low, double high) {
    Selection made;
    made.box = Selection::Box{{-9, -9, low}, {9, 9, high}};
    return made;
  };
  body.fixed = {{.select = layer(-9, 0.05)},
                {.select = layer(0.25, 0.35), .axes = {true, false, true}}};
  MotionRequest motion;
  motion.select = layer(0.35, 9);
  motion.velocity = {0, 0.1, 0};
  motion.axes = {false, true, false};
  body.motions = {motion};
  return scene;
}

/// Components that supports prescribe do not vibrate, however stiff their phyxels are.
TEST(StepLimit, IsThatOfFreeComponents) {
  const Model model = model_of(supported_scene(), lattice(4, 4, 5, 0.1, 0.2));
  const double omega = dense_frequency(model);
  Model loose = model;
  loose.motions.clear();
  EXPECT_LT(omega, 0.97 * dense_frequency(loose));
  const double found = step_limit(model).omega_max;
  EXPECT_GE(found, omega * (1 - 1e-6));
  EXPECT_LE(found, omega * 1.0015);
  const auto backend = make_test_backend(model, Precision::double_);
  EXPECT_NEAR(present_step_limit(model, *backend).omega_max, omega, 0.02 * omega);
}

/// A body all of which is prescribed has the limit that it would have without supports.
TEST(StepLimit, OfAWhollyHeldBodyIsThatOfAFreeOne) {
  Scene scene = one_body();
  Selection all;
  all.all = true;
  scene.bodies[0].fixed = {{.select = all}};
  const Model model = model_of(scene, lattice(4, 4, 3, 0.1, 0.2));
  Model loose = model;
  loose.motions.clear();
  EXPECT_EQ(step_limit(model).omega_max, step_limit(loose).omega_max);
}

double energy_after(const Model& model, const Scene& scene, double dt, int steps) {
  const auto backend = make_test_backend(model, Precision::double_);
  Solver solver(*backend, initial_state(model, scene, dt));
  solver.step(steps);
  const Diagnostics d = diagnose(model, *backend, solver.steps(), dt);
  return d.kinetic_energy + d.strain_energy;
}

TEST(StepLimit, IsTheBorderOfStability) {
  Scene scene = one_body();
  scene.bodies[0].material.law = "small-strain";  // linear, so that the border is sharp
  scene.bodies[0].spin = {0.01, 0.02, 0};
  const Model model = model_of(scene, lattice(5, 4, 4, 0.1, 0.2));
  const double limit = step_limit(model).largest_step;
  const double start = energy_after(model, scene, 0.95 * limit, 0);
  // A growing mode starts from rounding, 1e-16 of the displacement, and gains a factor of
  // e^0.6 or so a step: 1000 steps leave no doubt.
  EXPECT_LT(energy_after(model, scene, 0.98 * limit, 1000), 3 * start);
  EXPECT_FALSE(energy_after(model, scene, 1.03 * limit, 1000) < 1e6 * start);
}

TEST(StepLimit, OfNothingThatResistsIsAnError) {
  Scene scene = one_body();
  Cloud cloud;
  cloud.position = {{0, 0, 0}, {50, 0, 0}};
  cloud.volume = {1, 1};
  scene.bodies[0].neighbourhood.radius = 1;
  const Model model = model_of(scene, cloud);
  EXPECT_EQ(model.degenerate.isolated.size(), 2u);
  EXPECT_THROW(step_limit(model), InputError);
}

TEST(Verlet, EnergyStaysBoundedOver100000Steps) {
  Scene scene = one_body();
  scene.bodies[0].spin = {0, 0, 4};
  const Model model = model_of(scene, lattice(3, 3, 4, 0.1, 0.1));
  const double dt = 0.5 * step_limit(model).largest_step;
  const auto backend = make_test_backend(model, Precision::double_, 1);
  Solver solver(*backend, initial_state(model, scene, dt));
  const Diagnostics start = diagnose(model, *backend, 0, dt);
  double early = 0, late = 0;
  for (int s = 1; s <= 100000; ++s) {
    solver.step();
    if (s % 100) continue;
    const Diagnostics d = diagnose(model, *backend, solver.steps(), dt);
    const double error = std::abs(d.total_energy() / start.total_energy() - 1);
    (s <= 10000 ? early : late) = std::max(s <= 10000 ? early : late, error);
    // Pairwise cancelling forces: momentum only gathers rounding, some 1e-16 a step.
    ASSERT_LT(norm(d.momentum), 1e-11 * std::sqrt(2 * start.kinetic_energy * 36 * 1.0));
    ASSERT_LT(norm(d.angular_momentum - start.angular_momentum),
              1e-10 * norm(start.angular_momentum));
  }
  // A symplectic method's energy error oscillates within a few percent at half the stable step and
  // does not grow: the late error is no larger than the early one but for sampling.
  EXPECT_LT(early, 0.05);
  EXPECT_LT(late, 1.5 * early);
}

TEST(Verlet, IsThePapersRecursion) {
  // u⁺ = 2u - u⁻ + Δt² f/m, carried out on the side from the backend's forces.
  Scene scene = busy_scene();
  scene.gravity = {1, 2, -9.81};  // along every axis
  Model model = busy_model();
  model.gravity = scene.gravity;
  model.motions.clear();
  model.loads.clear();
  const double dt = 0.4 * step_limit(model).largest_step;
  const auto backend = make_test_backend(model, Precision::double_);
  State start = initial_state(model, scene, dt);
  std::vector<Vec3d> now = start.displacement, before, force;
  for (std::size_t i = 0; i < now.size(); ++i) before.push_back(now[i] - dt * start.velocity[i]);
  Solver solver(*backend, start);
  for (int s = 0; s < 100; ++s) {
    backend->internal_forces(force);
    std::vector<Vec3d> next(now.size());
    for (std::size_t i = 0; i < now.size(); ++i) {
      next[i] =
          2.0 * now[i] - before[i] + dt * dt * ((1 / model.mass[i]) * force[i] + scene.gravity);
    }
    before = now;
    now = next;
    solver.step();
  }
  const State end = solver.state();
  for (std::size_t i = 0; i < now.size(); ++i) {
    // The recursion loses digits as 2u - u⁻ cancels; 100 steps of 1e-16 of a displacement of 0.1.
    EXPECT_NEAR(end.displacement[i].x, now[i].x, 1e-13);
    EXPECT_NEAR(end.displacement[i].y, now[i].y, 1e-13);
    EXPECT_NEAR(end.displacement[i].z, now[i].z, 1e-13);
    EXPECT_GT(std::abs(now[i].y), 1e-6);  // there is something to be wrong about
  }
}

TEST(Verlet, FallsFreelyAsGravitySays) {
  Scene scene = one_body();
  scene.gravity = {1, 0, -9.81};
  const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
  for (const Precision precision : {Precision::double_, Precision::single, Precision::mixed}) {
    const auto backend = make_test_backend(model, precision);
    const double dt = 1e-3;
    Solver solver(*backend, initial_state(model, scene, dt));
    solver.step(500);
    const State end = solver.state();
    // Verlet is exact for constant acceleration: ½ g t². Float accumulates 500 roundings.
    const double tolerance = precision == Precision::single ? 1e-5 : 1e-13;
    EXPECT_NEAR(end.displacement[13].z, -9.81 * 0.125, 9.81 * tolerance);
    EXPECT_NEAR(end.displacement[13].x, 0.125, tolerance);
  }
}

TEST(Damping, DecaysMomentumExponentially) {
  Scene scene = one_body();
  scene.bodies[0].material.damping = 2;
  scene.bodies[0].velocity = {1, 0, 0};
  const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
  const auto backend = make_test_backend(model, Precision::double_);
  const double dt = 1e-4;
  Solver solver(*backend, initial_state(model, scene, dt));
  solver.step(10000);
  const Diagnostics d = diagnose(model, *backend, solver.steps(), dt);
  const double mass = 27 * 1.0;
  EXPECT_NEAR(d.momentum.x / mass, std::exp(-2.0), 2e-4);  // first sample half a step off: c dt / 2
}

TEST(Motion, FollowsItsPath) {
  Scene scene = one_body();
  MotionRequest request;
  request.select.box = Selection::Box{{-1, -1, -1}, {0.1, 1, 1}};
  request.displacement = {0, 0.02, 0};
  request.duration = 0.1;
  request.velocity = {0.1, 0, 0};
  request.amplitude = {0, 0, 0.01};
  request.frequency = 5;
  scene.bodies[0].motions.push_back(request);
  const Model model = model_of(scene, lattice(4, 3, 3, 0.1));
  ASSERT_EQ(model.motions[0].phyxels.size(), 9u);
  const auto backend = make_test_backend(model, Precision::double_);
  const double dt = 1e-4;
  Solver solver(*backend, initial_state(model, scene, dt));
  solver.step(730);
  const double t = 0.073, s = 0.73;
  const Vec3d expected{0.1 * t, 0.02 * s * s * (3 - 2 * s),
                       0.01 * std::sin(2 * std::numbers::pi * 5 * t)};
  const State state = solver.state();
  for (const Index i : model.motions[0].phyxels) {
    EXPECT_NEAR(state.displacement[i].x, expected.x, 1e-15);  // set, not integrated
    EXPECT_NEAR(state.displacement[i].y, expected.y, 1e-15);
    EXPECT_NEAR(state.displacement[i].z, expected.z, 1e-15);
  }
}

/// A smooth step of two turns about an axis beside the body, and more: positions are set.
/// A motion that takes no time has always been at its end, and goes on from there.
TEST(Motion, OfNoDurationIsAtItsEnd) {
  Motion motion;
  motion.displacement = {1, -2, 3};
  motion.velocity = {0, 0, 2};
  for (const double time : {0.0, 1e-3, 7.0}) {
    const Vec3d expected = Vec3d{1, -2, 3} + time * Vec3d{0, 0, 2};
    EXPECT_EQ(motion.path_at(time).at({5, 6, 7}), expected) << time;
  }
}

TEST(Motion, TurnsAboutAnAxis) {
  Scene scene = one_body();
  MotionRequest request;
  request.select.all = true;
  request.rotation = {0, 0, 720};
  request.about = {0.5, 0, 0};
  request.displacement = {0, 0, 0.1};
  request.duration = 0.1;
  scene.bodies[0].motions.push_back(request);
  const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
  for (const Precision precision : {Precision::double_, Precision::single, Precision::mixed}) {
    const auto backend = make_test_backend(model, precision);
    Solver solver(*backend, initial_state(model, scene, 1e-4));
    solver.step(730);
    const double smooth = 0.73 * 0.73 * (3 - 2 * 0.73), angle = 4 * std::numbers::pi * smooth;
    const State state = solver.state();
    // A GPU's rest positions are floats in mixed precision, too.
    const double tolerance = precision == Precision::double_ ? 1e-14 : 1e-6;
    for (Index i = 0; i < model.size(); ++i) {
      const Vec3d x = model.position[i], y = x + state.displacement[i];
      EXPECT_NEAR(y.x, 0.5 + std::cos(angle) * (x.x - 0.5) - std::sin(angle) * x.y, tolerance);
      EXPECT_NEAR(y.y, std::sin(angle) * (x.x - 0.5) + std::cos(angle) * x.y, tolerance);
      EXPECT_NEAR(y.z, x.z + 0.1 * smooth, tolerance);
    }
    // Nothing is strained, but by rounding; of gradients in float, where forces are.
    EXPECT_LT(diagnose(model, *backend, solver.now()).strain_energy,
              precision == Precision::double_ ? 1e-20 : 1e-6);
  }
}

/// Held along z, a body falls freely along x: in steps of every precision.
TEST(Motion, RollersHoldAlongTheirAxesOnly) {
  Scene scene = one_body();
  scene.gravity = {1, 0, -9.81};
  scene.bodies[0].fixed.push_back(
      {.select = {.all = true}, .axes = {.x = false, .y = false, .z = true}});
  const Model model = model_of(scene, lattice(3, 3, 3, 0.1));
  for (const Precision precision : {Precision::double_, Precision::single, Precision::mixed}) {
    const auto backend = make_test_backend(model, precision);
    const double dt = 1e-3;
    Solver solver(*backend, initial_state(model, scene, dt));
    solver.step(500);
    const State end = solver.state();
    // As in Verlet.FallsFreelyAsGravitySays.
    const double tolerance = precision == Precision::single ? 1e-5 : 1e-13;
    for (const Vec3d& u : end.displacement) {
      EXPECT_EQ(u.z, 0);
      EXPECT_NEAR(u.x, 0.125, tolerance);
    }
    const Diagnostics d = diagnose(model, *backend, solver.now());
    EXPECT_NEAR(d.kinetic_energy, 0.5 * model.parts[0].mass * 0.25, 10 * tolerance);
  }
}

/// Pulls a bar by body forces and a clamp-free mirror load until it rests; returns (E, ν).
std::pair<double, double> measured_constants(const char* law) {
  Material material = rubber();
  material.law = law;
  material.damping = 40;
  Scene scene = one_body(material);
  const Cloud cloud = lattice(16, 6, 6, 0.05);
  const double stress = 50;  // [Pa]: strain 5e-4, so that Green and Cauchy agree to 1e-3
  for (const double side : {-1.0, 1.0}) {
    LoadRequest pull;
    pull.select.box = side < 0 ? Selection::Box{{-1, -1, -1}, {0.05, 1, 1}}
                               : Selection::Box{{0.75, -1, -1}, {1, 1, 1}};
    pull.force = {side * stress * 0.3 * 0.3, 0, 0};
    scene.bodies[0].loads.push_back(pull);
  }
  const Model model = model_of(scene, cloud);
  const double dt = 0.8 * step_limit(model).largest_step;
  const auto backend = make_test_backend(model, Precision::double_);
  Solver solver(*backend, initial_state(model, scene, dt));
  while (solver.time() < 1.5) solver.step();  // exp(-40 · 1.5 / 2) is 1e-13
  std::vector<Mat3d> gradient;
  backend->displacement_gradients(gradient);
  double axial = 0, lateral = 0;
  int count = 0;
  for (Index i = 0; i < model.size(); ++i) {
    const Vec3d p = model.position[i];
    if (std::abs(p.x - 0.4) > 0.08 || std::abs(p.y - 0.15) > 0.08 || std::abs(p.z - 0.15) > 0.08)
      continue;
    axial += gradient[i](0, 0);
    lateral += 0.5 * (gradient[i](1, 1) + gradient[i](2, 2));
    ++count;
  }
  return {stress / (axial / count), -lateral / axial};
}

TEST(Motions, OfChosenPhyxelsAreThoseOfAll) {
  const Scene scene = one_body(rubber());
  const Model model = model_of(scene, lattice(7, 6, 5, 0.05));
  State state = initial_state(model, scene, 1e-6);
  for (Index i = 0; i < model.size(); ++i) {
    const Vec3d x = model.position[i];
    state.displacement[i] = {1e-3 * x.x * x.y, 2e-3 * x.z * x.z, -1e-3 * x.x * x.z};
    state.velocity[i] = {x.z, -x.x, 3 * x.y};
  }
  const std::vector<Index> chosen{17, 3, 3, model.size() - 1, 0};
  for (const Precision precision : {Precision::double_, Precision::mixed, Precision::single}) {
    const auto backend = make_test_backend(model, precision);
    backend->upload(state);
    State all;
    backend->download(all);
    std::vector<Mat3d> gradient;
    backend->displacement_gradients(gradient);
    const std::vector<PhyxelMotion> motions = backend->motions_of(chosen);
    ASSERT_EQ(motions.size(), chosen.size());
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      EXPECT_EQ(motions[k].displacement, all.displacement[chosen[k]]);
      EXPECT_EQ(motions[k].velocity, all.velocity[chosen[k]]);
      for (int e = 0; e < 9; ++e) {
        EXPECT_EQ(motions[k].gradient(e / 3, e % 3), gradient[chosen[k]](e / 3, e % 3));
      }
    }
    EXPECT_TRUE(backend->motions_of({}).empty());
  }
}

TEST(Tension, GivesBackYoungsModulusAndPoissonsRatio) {
  for (const char* law : {"st-venant-kirchhoff", "small-strain"}) {
    const auto [young, poisson] = measured_constants(law);
    // Nodal forces on the end layers are not exactly a uniform traction and the lateral surface
    // is one-sided: 5% at 6 phyxels across, which the mid section feels.
    EXPECT_NEAR(young, 1e5, 0.05e5);
    EXPECT_NEAR(poisson, 0.3, 0.02);
  }
}

class Restart : public ::testing::TestWithParam<Precision> {};

TEST_P(Restart, IsBitwiseTheRunThatNeverStopped) {
  const Scene scene = busy_scene();
  const Model model = busy_model();
  const double dt = 0.5 * step_limit(model).largest_step;
  const auto straight = make_test_backend(model, GetParam(), 2);
  Solver whole(*straight, initial_state(model, scene, dt));
  std::vector<State> kept;
  for (int s = 0; s < 400; ++s) {
    if (s % 57 == 0) kept.push_back(whole.state());
    whole.step();
  }
  const State end = whole.state();
  for (const State& middle : kept) {
    const auto fresh = make_test_backend(model, GetParam(), 1);
    Solver rest(*fresh, middle);
    while (rest.steps() < 400) rest.step();
    const State again = rest.state();
    EXPECT_EQ(again.time, end.time);
    EXPECT_TRUE(again.displacement == end.displacement);
    EXPECT_TRUE(again.velocity == end.velocity);
  }
}

INSTANTIATE_TEST_SUITE_P(Precision, Restart,
                         ::testing::Values(Precision::single, Precision::double_, Precision::mixed),
                         [](const auto& test) {
                           return test.param == Precision::single    ? "Float"
                                  : test.param == Precision::double_ ? "Double"
                                                                     : "Mixed";
                         });

TEST(Bodies, DoNotFeelEachOther) {
  // Two overlapping bodies of different sizes and materials move as each would alone.
  Scene scene = one_body();
  scene.bodies[0].spin = {1, 0, 2};
  scene.bodies.push_back(scene.bodies[0]);
  scene.bodies[1].material.young = 4e5;
  scene.bodies[1].material.law = "small-strain";
  scene.bodies[1].neighbourhood.support = NeighbourhoodRule::Support::adaptive;
  const std::vector<Cloud> clouds{lattice(4, 3, 3, 0.1, 0.1), lattice(3, 5, 3, 0.08, 0.1)};
  const Model both = build_model(scene, clouds);
  const double dt = 0.5 * step_limit(both).largest_step;
  const auto run = [&](const Scene& s, const Model& model) {
    const auto backend = make_test_backend(model, Precision::single);
    Solver solver(*backend, initial_state(model, s, dt));
    solver.step(200);
    return solver.state();
  };
  const State together = run(scene, both);
  for (std::size_t b = 0; b < 2; ++b) {
    Scene alone = scene;
    alone.bodies = {scene.bodies[b]};
    const State single = run(alone, model_of(alone, clouds[b]));
    for (Index i = both.parts[b].begin; i < both.parts[b].end; ++i) {
      EXPECT_EQ(together.displacement[i], single.displacement[i - both.parts[b].begin]);
    }
  }
}

}  // namespace
}  // namespace phyxel
