/// The ways of launching steps on a GPU against each other: the same bits resident, by graphs and
/// by two launches a step, however steps are divided into calls.
#include <gtest/gtest.h>

#include "cuda_cases.hpp"
#include "solver/cuda_backend.hpp"
#include "support/backend.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

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
  // Half the limit at rest is too long for the plastic bodies, which have no hourglass control.
  const double dt = 0.3 * step_limit(model).largest_step;
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
                     {lattice(17, 13, 15, 0.1, 0.2, 3)}},
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
        ResidentCase{"MailPairs",
                     "blocks",
                     {.name = "", .everything = true, .pairs = true},
                     with_surface(large_clouds(), {1.4, 1, 1.2})},
        ResidentCase{"MailPairsBesideAdaptive",
                     "blocks",
                     {.name = "", .everything = true, .one_each = true, .pairs = true},
                     with_surface(large_clouds(), {1.4, 1, 1.2})},
        ResidentCase{"ClusterPairs",
                     "clusters",
                     {.name = "", .everything = true, .pairs = true},
                     small_clouds()},
        ResidentCase{
            "ClusterClosedPairsBesideAdaptive",
            "clusters",
            {.name = "", .everything = true, .closed = true, .one_each = true, .pairs = true},
            with_surface(small_clouds(), {1.3, 0.4, 0.6})},
        ResidentCase{"ManyClusters", "clusters", {"", false, false, false}, many_clouds()}),
    [](const auto& test) { return std::string(test.param.name); });

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

}  // namespace
}  // namespace phyxel
