/// Bodies that break on the GPU against the CPU, and the ways of launching steps against each
/// other. (The physics itself is tested by the CPU's tests, which also run on the GPU: cuda.*)
#include <gtest/gtest.h>

#include "solver/cuda_backend.hpp"
#include "support/torn_bar.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

/// A solver of the torn bar's model on another backend, from its first state.
struct TornRun {
  TornRun(TornBar& bar, std::unique_ptr<Backend> on) : backend(std::move(on)), model(bar.model) {
    solver = std::make_unique<Solver>(model, *backend, bar.solver->state(), Method::verlet);
  }
  double fracture_energy() { return diagnose(model, *backend, *solver).fracture_energy; }

  std::unique_ptr<Backend> backend;
  const Model& model;
  std::unique_ptr<Solver> solver;
};

/// In double the sums differ by their order: 1e-16 a step, and ten thousand times that by the
/// pieces' turning and by gradients of few neighbours; a pair would break at another step only if
/// it came so near the critical stretch.
TEST(CudaFracture, BreaksThePairsOfTheCpu) {
  TornBar bar;  // on the GPU
  TornRun gpu(bar, make_cuda_backend(bar.model, Precision::double_)),
      cpu(bar, make_cpu_backend(bar.model, Precision::double_));
  for (int k = 0; k < 8; ++k) {
    gpu.solver->step(50);
    cpu.solver->step(50);
    const State a = gpu.solver->state(), b = cpu.solver->state();
    ASSERT_EQ(a.broken, b.broken) << a.step;
    ASSERT_EQ(a.worn.size(), b.worn.size()) << a.step;
    for (std::size_t w = 0; w < a.worn.size(); ++w) {
      EXPECT_EQ(a.worn[w].phyxel, b.worn[w].phyxel);
      EXPECT_NEAR(a.worn[w].carried, b.worn[w].carried, 1e-6);
    }
    double apart = 0;
    for (std::size_t i = 0; i < a.displacement.size(); ++i) {
      apart = std::max(apart, norm(a.displacement[i] - b.displacement[i]));
    }
    EXPECT_LT(apart, 1e-9) << a.step;
    const double taken = cpu.fracture_energy();
    EXPECT_NEAR(gpu.fracture_energy(), taken, 1e-7 * taken) << a.step;
  }
  EXPECT_GT(cpu.solver->state().broken.size(), 100u);
  const Diagnostics d = diagnose(bar.model, *gpu.backend, *gpu.solver),
                    e = diagnose(bar.model, *cpu.backend, *cpu.solver);
  EXPECT_NEAR(d.total_energy(), e.total_energy(), 1e-7 * e.total_energy());
  EXPECT_NEAR(d.strain_energy, e.strain_energy, 1e-6 * e.total_energy());
  EXPECT_NEAR(d.contact_energy, e.contact_energy, 1e-6 * e.total_energy());
  const Breakage found = gpu.backend->breakage().value(),
                 expected = cpu.backend->breakage().value();
  EXPECT_EQ(found.broken, expected.broken);
}

/// In float the pieces are others in detail, and alike on the whole: a twentieth is an estimate of
/// how far counts of some hundred pairs differ between runs that part by rounding.
TEST(CudaFracture, FloatBreaksAsMuchAsDouble) {
  TornBar bar;
  TornRun exact(bar, make_cpu_backend(bar.model, Precision::double_));
  exact.solver->step(400);
  const double pairs = static_cast<double>(exact.solver->state().broken.size()),
               taken = exact.fracture_energy();
  for (const Precision precision : {Precision::single, Precision::mixed}) {
    TornRun gpu(bar, make_cuda_backend(bar.model, precision));
    gpu.solver->step(400);
    EXPECT_NEAR(static_cast<double>(gpu.solver->state().broken.size()), pairs, 0.05 * pairs);
    EXPECT_NEAR(gpu.fracture_energy(), taken, 0.05 * taken);
  }
}

/// By graphs and by launches of single steps, however steps are divided into calls: after an odd
/// number of steps two arrays have changed their roles.
TEST(CudaFracture, HasTheSameBitsByGraphs) {
  for (const Precision precision : {Precision::single, Precision::double_}) {
    TornBar bar(precision);
    TornRun recorded(bar, make_cuda_backend(bar.model, precision)),
        launched(bar, make_cuda_backend(bar.model, precision, 0, CudaPath::launches)),
        divided(bar, make_cuda_backend(bar.model, precision));
    EXPECT_NE(recorded.backend->name().find("graphs of 16 steps"), std::string::npos)
        << recorded.backend->name();
    recorded.solver->step(300);
    launched.solver->step(300);
    for (const int steps : {1, 40, 3, 33, 100, 123}) divided.solver->step(steps);
    const State expected = launched.solver->state();
    EXPECT_GT(expected.broken.size(), 100u);
    for (TornRun* run : {&recorded, &divided}) {
      const State found = run->solver->state();
      EXPECT_EQ(found.broken, expected.broken);
      EXPECT_EQ(found.worn, expected.worn);
      EXPECT_EQ(found.displacement, expected.displacement);
      EXPECT_EQ(found.velocity, expected.velocity);
      EXPECT_EQ(found.step_sums, expected.step_sums);
    }
  }
}

/// A scene whose bodies may break, but do not, has the bits of one whose bodies cannot.
TEST(CudaFracture, WholeBodiesKeepTheirBits) {
  TornBar bar;
  Scene scene = bar.scene;
  scene.bodies[0].fracture->energy_release_rate = 1e9;
  const Model tough = model_of(scene, lattice(24, 5, 5, 0.05));
  scene.bodies[0].fracture.reset();
  const Model plain = model_of(scene, lattice(24, 5, 5, 0.05));
  for (const Precision precision : {Precision::single, Precision::double_, Precision::mixed}) {
    State end[2];
    for (const Model* model : {&tough, &plain}) {
      const auto backend = make_cuda_backend(*model, precision);
      State start = initial_state(*model, scene, bar.dt);
      start.velocity = bar.solver->state().velocity;
      Solver solver(*model, *backend, start, Method::verlet);
      solver.step(200);
      end[model == &plain] = solver.state();
    }
    EXPECT_TRUE(end[0].broken.empty());
    EXPECT_EQ(end[0].displacement, end[1].displacement);
    EXPECT_EQ(end[0].velocity, end[1].velocity);
  }
}

}  // namespace
}  // namespace phyxel
