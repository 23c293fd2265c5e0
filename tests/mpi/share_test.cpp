/// One answer: a body stepped by several ranks moves as by one, to the last bit.
#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <random>

#include "../partition/bodies.hpp"
#include "device.hpp"
#include "mpi/halo_transport.hpp"
#include "partition/partition.hpp"
#include "phyxel/contacts.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/solver.hpp"
#include "ranks.hpp"
#include "setup/tiling.hpp"
#include "solver/cuda_backend.hpp"
#include "solver/nccl.hpp"
#include "support/laws.hpp"
#include "support/oracle.hpp"

namespace phyxel {
namespace {

using test::world;

/// Terms of every kind, lists of one side, something held, moved, pulled; surfels.
Model everything() {
  Scene scene;
  for (const char* shape : {"horn_bug", "alien_head"}) {
    BodyRequest body;
    body.name = shape;
    body.where = "test";
    body.source.shape.name = shape;
    body.translation = {scene.bodies.empty() ? 0.0 : 40.0, 0, 0};
    body.material = testing::rubber();
    body.material.volume_stiffness = 1e4;
    body.material.damping = 0.5;
    body.neighbourhood.support = NeighbourhoodRule::Support::adaptive;
    body.fixed.push_back({.select = {.indices = std::vector<Index>{0, 1, 2}}});
    body.motions.push_back({.select = {.indices = std::vector<Index>{50, 100, 200}},
                            .velocity = {0.1, 0, 0},
                            .amplitude = {0, 0.02, 0},
                            .frequency = 30});
    body.loads.push_back({.select = {.all = true}, .force = {3, 0, 1}, .ramp = 0.01});
    scene.bodies.push_back(body);
  }
  scene.gravity = {0, 0, -9.81};
  return build_model(scene);
}

/// A cube whose hourglass modes are held.
Model controlled() {
  Scene scene = testing::one_body();
  scene.bodies[0].material.hourglass = 0.2;
  scene.bodies[0].spin = {1, 2, 3};
  return testing::model_of(scene, testing::lattice(12, 11, 10, 0.1, 0.3));
}

/// A cube of a law that is the caller's own; forces of the caller's own act on it, too.
Model custom() {
  Material material = testing::rubber();
  material.custom_law = std::make_shared<testing::Repeated>(material, 2);
  Scene scene = testing::one_body(material);
  scene.bodies[0].spin = {1, 2, 3};
  return testing::model_of(scene, testing::lattice(9, 8, 7, 0.1, 0.3));
}

/// Two bodies, cut by one obstacle that rests and one that moves.
Model touching() {
  Scene scene;
  for (const char* shape : {"beam", "block"}) {
    BodyRequest body;
    body.name = shape;
    body.where = "test";
    body.source.shape = {.name = shape, .size = {0.6, 0.4, 0.4}, .spacing = 0.05};
    body.translation = {0, scene.bodies.empty() ? 0.0 : 0.5, 0};
    body.material = testing::rubber();
    body.velocity = {1, 0, -2};
    scene.bodies.push_back(body);
  }
  scene.gravity = {0, 0, -9.81};
  scene.obstacles = {{.name = "floor",
                      .shape = "plane",
                      .translation = {0, 0, -0.2001},
                      .friction = 0.4,
                      .restitution = 0.5},
                     {.name = "ball",
                      .shape = "sphere",
                      .radius = 0.5,
                      .translation = {0.3, 0.2, 0.701},
                      .friction = 0.2,
                      .motion = {.velocity = {0, 0, -2}}}};
  const auto file = std::filesystem::temp_directory_path() /
                    ("phyxel_touching_" + std::to_string(getpid()) + ".obj");
  std::ofstream(file) << "v 0.2 0.4 0\nv 0.6 0.4 0\nv 0.4 0.8 0\nv 0.4 0.5 0.4\n"
                         "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
  scene.obstacles.push_back({.name = "spike",
                             .shape = "mesh",
                             .mesh = file,
                             .translation = {0, 0, 0.2005},
                             .friction = 0.2,
                             .motion = {.velocity = {0, 0, -1}}});
  Model model = build_model(scene);
  std::filesystem::remove(file);
  return model;
}

/// Two bodies that fly into each other, one of which is held at an end.
Model colliding(const ContactRequest& contact) {
  Scene scene;
  for (const char* shape : {"beam", "block"}) {
    const bool is_first = scene.bodies.empty();
    BodyRequest body;
    body.name = shape;
    body.where = "test";
    body.source.shape = {.name = shape, .size = {0.6, 0.4, 0.4}, .spacing = 0.05};
    body.translation = {is_first ? 0.0 : 0.9005, is_first ? 0.0 : 0.11, is_first ? 0.0 : 0.07};
    body.material = testing::rubber();
    body.velocity = {is_first ? 0.0 : -2.0, 0, 0};
    if (is_first) body.fixed.push_back({.select = {.region = "x-"}});
    scene.bodies.push_back(body);
  }
  scene.contact = contact;
  return build_model(scene);
}
Model colliding_hard() { return colliding({.friction = 0.4, .sweeps = 2}); }
Model colliding_softly() { return colliding({.friction = 0.4, .method = ContactMethod::penalty}); }

struct ShareCase {
  const char* name;
  Model (*make)();
};
const std::vector<ShareCase>& share_cases() {
  static const std::vector<ShareCase> cases{
      {"Cube", testing::cube},       {"Coil", testing::coil},     {"Thread", testing::thread},
      {"Apart", testing::apart},     {"Tiny", testing::tiny},     {"Everything", everything},
      {"Controlled", controlled},    {"Custom", custom},          {"Touching", touching},
      {"Colliding", colliding_hard}, {"Softly", colliding_softly}};
  return cases;
}

/// Built once for all tests.
const Model& whole_of(const ShareCase& c) {
  static std::map<std::string, Model> made;
  const auto found = made.find(c.name);
  return found != made.end() ? found->second : made.emplace(c.name, c.make()).first->second;
}

/// What steps a share, and how values travel.
enum class Way { cpu, gpu_direct, gpu_nccl, gpu_mpi, gpu_host };

class Shares : public ::testing::TestWithParam<std::tuple<ShareCase, Way>> {
 protected:
  bool on_gpus() const { return way_ >= Way::gpu_direct; }
  void SetUp() override {
    if (on_gpus() && world().smallest(std::int64_t{!cuda_devices().empty()}) == 0) {
      GTEST_SKIP() << "no CUDA device";
    }
    if (on_gpus() && whole_.parts[0].material.custom_law) GTEST_SKIP() << "no GPU knows its law";
    const bool own_gpu = static_cast<int>(cuda_devices().size()) >= world().host_size();
    if (way_ == Way::gpu_nccl && world().smallest(std::int64_t{own_gpu && cuda::has_nccl()}) == 0) {
      GTEST_SKIP() << "NCCL needs a GPU for each rank, and itself: " << cuda::nccl_version();
    }
    if (way_ == Way::gpu_mpi && !mpi_takes_device_memory()) GTEST_SKIP() << mpi_description();
    const int parts = world().size();
    const Graph graph = phyxel_graph(whole_);
    const Groups tiles = curve_groups(whole_, cuda::tile_size);
    // METIS asks the C library for random numbers: one rank's answer serves all.
    const auto partitioner = static_cast<Partitioner>((static_cast<int>(way_) + parts) % 3);
    part_of_ = world().broadcast(
        on_gpus()
            ? ungrouped(make_partition(grouped_graph(graph, tiles), parts, partitioner), tiles)
            : make_partition(graph, parts, partitioner));
    ModelShare share =
        share_of(whole_, make_part_halos(graph, part_of_, parts)[world().rank()], part_of_);
    if (way_ == Way::gpu_host) share.model = testing::without_lists(std::move(share.model));
    if (on_gpus()) share.share.place = values_of(share.share, cuda::make_tiling(whole_).place);
    connect(world(), share);
    model_ = phyxel::model_of(std::move(share));
  }
  std::unique_ptr<Backend> backend(const Model& model, Precision precision) const {
    if (!on_gpus()) return make_cpu_backend(model, precision, 1);
    const auto devices = static_cast<int>(cuda_devices().size());
    return make_cuda_backend(model, precision, world().host_rank() % devices, CudaPath::automatic,
                             transport());
  }
  Transport transport() const {
    switch (way_) {
      case Way::gpu_direct:
        return Transport::direct;
      case Way::gpu_nccl:
        return Transport::nccl;
      case Way::gpu_mpi:
        return Transport::mpi;
      default:
        return Transport::host;
    }
  }
  State start(const Model& model) const {
    State state;
    std::mt19937_64 engine(5);
    for (Index i = 0; i < whole_.size(); ++i) {
      state.displacement.push_back(testing::uniform_vector(engine, 0.002));
    }
    if (model.share) state.displacement = values_of(*model.share, state.displacement);
    state.velocity.resize(state.displacement.size());
    // A CPU has no lists to step by where the device finds them.
    state.dt = 0.3 * step_limit(way_ == Way::gpu_host ? whole_ : model, 1).largest_step;
    return state;
  }

  const Model& whole_ = whole_of(std::get<0>(GetParam()));
  const Way way_ = std::get<1>(GetParam());
  std::vector<int> part_of_;
  Model model_;
};

/// 10 m/s² on each phyxel of the whole, each time in another direction. @param step of the solver
std::vector<Vec3d> callers_forces(const Model& whole, int step) {
  std::mt19937_64 engine(static_cast<unsigned>(step));
  std::vector<Vec3d> force;
  for (const double mass : whole.mass) force.push_back(mass * testing::uniform_vector(engine, 10));
  return force;
}

/// A thousand steps of the first body, a few of the others.
TEST_P(Shares, MoveAsTheWholeToTheLastBit) {
  const State start_of_whole = start(whole_), start_of_share = start(model_);
  EXPECT_EQ(start_of_whole.dt, start_of_share.dt);
  const double dt = start_of_whole.dt;
  for (const Precision precision : {Precision::single, Precision::mixed, Precision::double_}) {
    // Sanitizers step fifty times slower.
    const bool many = std::get<0>(GetParam()).name == std::string("Cube") &&
                      precision == Precision::single && !PHYXEL_SANITIZED;
    const int steps = many ? 1000 : 30;
    const auto alone = backend(whole_, precision), here = backend(model_, precision);
    Solver whole(whole_, *alone, start_of_whole, Method::verlet),
        share(model_, *here, start_of_share, Method::verlet);
    for (int s = 0; s < steps; ++s) {
      if (whole_.parts[0].material.custom_law) {
        const std::vector<Vec3d> force = callers_forces(whole_, s);
        alone->set_external_forces(force);
        here->set_external_forces(model_.share ? values_of(*model_.share, force) : force);
      }
      whole.step();
      share.step();
    }
    const State a = whole.state(), b = share.state();
    // No assertion that ends one rank's test may stand before what all ranks do together.
    std::vector<Index> different;
    Index owned = 0;
    for (Index i = 0; i < model_.size(); ++i) {
      if (!model_.owns(i)) continue;
      const Index n = model_.global_id(i);
      if (!(a.displacement[n] == b.displacement[i] && a.velocity[n] == b.velocity[i])) {
        different.push_back(n);
      }
      EXPECT_EQ(part_of_[n], world().rank());
      ++owned;
    }
    EXPECT_THAT(different, ::testing::IsEmpty());
    EXPECT_EQ(world().sum(std::int64_t{owned}), whole_.size());

    const std::vector<ContactReading> touched = find_contacts(whole_, *alone, whole),
                                      here_too = find_contacts(model_, *here, share);
    for (std::size_t o = 0; o < touched.size(); ++o) {
      EXPECT_EQ(touched[o].force, here_too[o].force);
      EXPECT_EQ(touched[o].impulse, here_too[o].impulse);
      EXPECT_EQ(touched[o].angular_impulse, here_too[o].angular_impulse);
      EXPECT_EQ(touched[o].friction_heat, here_too[o].friction_heat);
      EXPECT_EQ(touched[o].depth, here_too[o].depth);
      EXPECT_GT(norm(touched[o].impulse), 0);
    }
    const Diagnostics at_all = diagnose(whole_, *alone, whole),
                      here_at_all = diagnose(model_, *here, share);
    EXPECT_EQ(at_all.total_energy(), here_at_all.total_energy());
    EXPECT_EQ(at_all.contact_energy, here_at_all.contact_energy);
    const Diagnostics d = diagnose(whole_, *alone, steps, dt),
                      e = diagnose(model_, *here, steps, dt);
    EXPECT_EQ(d.total_energy(), e.total_energy());
    EXPECT_EQ(d.momentum, e.momentum);
    EXPECT_EQ(d.internal_torque, e.internal_torque);
    EXPECT_EQ(d.force_scale, e.force_scale);
    EXPECT_EQ(d.fastest_phyxel, e.fastest_phyxel);
    EXPECT_EQ(d.largest_speed, e.largest_speed);
    EXPECT_GT(d.largest_speed, 0);

    SurfelState p, q;
    alone->advect_surfels(p);
    here->advect_surfels(q);
    different.clear();
    for (std::size_t s = 0; s < q.position.size(); ++s) {
      const Index k = model_.share->global_surfel_id.at(s);
      if (!(p.position[k] == q.position[s] && p.normal[k] == q.normal[s])) different.push_back(k);
    }
    EXPECT_THAT(different, ::testing::IsEmpty());
    EXPECT_EQ(world().sum(static_cast<std::int64_t>(q.position.size())),
              static_cast<std::int64_t>(p.position.size()));
    world().barrier();  // before memory that others store into goes
  }
}

/// A body of one of our laws, cut among the ranks, against the oracle, which is written from the
/// papers and knows of no ranks: forces, and a few of the papers' steps.
TEST(AgainstTheOracle, SharesFeelAndMoveAsThePapersSay) {
  Material material = testing::rubber();
  material.law = NeoHookean<double>::name;
  material.volume_stiffness = 3e4;
  Scene scene = testing::one_body(material);
  scene.gravity = {1, -2, -9.81};
  const Model whole = testing::model_of(scene, testing::lattice(6, 4, 4, 0.1, 0.25));
  oracle::Body body;
  static_cast<oracle::Material&>(body) = {material.young, material.poisson,
                                          material.volume_stiffness, material.law};
  for (Index i = 0; i < whole.size(); ++i) {
    body.x.push_back({whole.position[i].x, whole.position[i].y, whole.position[i].z});
    body.v.push_back(whole.volume[i]);
    body.h.push_back(whole.neighbourhood.support[i]);
  }
  oracle::find_neighbours(body);

  const int parts = world().size();
  const Graph graph = phyxel_graph(whole);
  const std::vector<int> part_of =
      world().broadcast(make_partition(graph, parts, Partitioner::curve));
  ModelShare cut = share_of(whole, make_part_halos(graph, part_of, parts)[world().rank()], part_of);
  connect(world(), cut);
  const Model here = phyxel::model_of(std::move(cut));

  const double dt = 0.4 * step_limit(whole, 1).largest_step;
  const std::vector<Vec3d> start = testing::random_deformation(whole, 0.005);
  const auto backend = make_cpu_backend(here, Precision::double_, 1);
  Solver solver(*backend, testing::state_of(values_of(*here.share, start), dt));
  // u⁻ = u: state_of starts with v(-dt/2) = 0.
  std::vector<oracle::V3> now, before;
  for (const Vec3d& u : start) now.push_back({u.x, u.y, u.z});
  before = now;
  double largest_difference = 0, largest_force = 0, off = 0, moved = 0;
  for (int step = 0; step < 3; ++step) {
    const std::vector<oracle::V3> expected = oracle::forces(body, now);
    std::vector<Vec3d> force;
    backend->internal_forces(force);
    for (Index i = 0; i < here.size(); ++i) {
      if (!here.owns(i)) continue;
      const oracle::V3& e = expected[here.global_id(i)];
      largest_difference = std::max(largest_difference, norm(force[i] - Vec3d{e[0], e[1], e[2]}));
      largest_force = std::max(largest_force, e.norm());
    }
    std::vector<oracle::V3> next;
    for (Index n = 0; n < whole.size(); ++n) {
      const oracle::V3 g{scene.gravity.x, scene.gravity.y, scene.gravity.z};
      next.push_back(2 * now[n] - before[n] + dt * dt * (expected[n] / whole.mass[n] + g));
    }
    before = now;
    now = next;
    solver.step();
  }
  const State end = solver.state();
  Index owned = 0;
  for (Index i = 0; i < here.size(); ++i) {
    if (!here.owns(i)) continue;
    const Index n = here.global_id(i);
    off = std::max(off, norm(end.displacement[i] - Vec3d{now[n][0], now[n][1], now[n][2]}));
    moved = std::max(moved, norm(end.displacement[i] - start[n]));
    ++owned;
  }
  // Sums of thirty terms in another order; the oracle inverts moments by singular values.
  EXPECT_LT(largest_difference, 1e-11 * largest_force);
  EXPECT_LT(off, 1e-13);
  EXPECT_GT(world().largest(moved), 1e-3);
  EXPECT_EQ(world().sum(std::int64_t{owned}), whole.size());
  world().barrier();
}

/// The stiffest phyxel of all ranks is that of one, a step is halved and doubled to the same bits,
/// and the limit of the deformed body is the same.
TEST_P(Shares, StiffenAndHalveTheirStepsAsTheWhole) {
  const State start_of_whole = start(whole_), start_of_share = start(model_);
  const auto alone = backend(whole_, Precision::double_),
             here = backend(model_, Precision::double_);
  Solver whole(whole_, *alone, start_of_whole, Method::verlet),
      share(model_, *here, start_of_share, Method::verlet);
  for (int s = 0; s < 11; ++s) {
    if (s == 5) {
      whole.halve_step();
      share.halve_step();
    }
    if (s == 9) {
      whole.double_step();
      share.double_step();
    }
    whole.step();
    share.step();
  }
  const Stiffening one = find_stiffening(whole_, *alone), all = find_stiffening(model_, *here);
  const std::string in_words = describe_phyxel(model_, all.phyxel);
  const StepLimit limit_of_one = present_step_limit(whole_, *alone),
                  limit_of_all = present_step_limit(model_, *here);
  EXPECT_EQ(limit_of_one.omega_max, limit_of_all.omega_max);
  EXPECT_GT(limit_of_one.omega_max, 0);
  for (int s = 0; s < 3; ++s) {  // looking for it has changed nothing
    whole.step();
    share.step();
  }
  const State a = whole.state(), b = share.state();
  std::vector<Index> different;
  for (Index i = 0; i < model_.size(); ++i) {
    const Index n = model_.global_id(i);
    if (model_.owns(i) &&
        !(a.displacement[n] == b.displacement[i] && a.velocity[n] == b.velocity[i])) {
      different.push_back(n);
    }
  }
  EXPECT_THAT(different, ::testing::IsEmpty());
  EXPECT_EQ(one.ratio, all.ratio);
  EXPECT_EQ(one.stretch, all.stretch);
  EXPECT_EQ(one.phyxel, all.phyxel);
  EXPECT_GE(one.phyxel, 0);
  EXPECT_EQ(in_words, describe_phyxel(whole_, one.phyxel));
  world().barrier();
}

/// Each step's surfels, and diagnostics between steps, change nothing: exchanges keep their order.
TEST_P(Shares, MayBeLookedAtAtAnyTime) {
  const State start_of_share = start(model_);
  const auto here = backend(model_, Precision::single),
             watched = backend(model_, Precision::single);
  Solver a(*here, start_of_share), b(*watched, start_of_share);
  for (int s = 0; s < 40; ++s) {
    a.step();
    b.step();
    if (s % 3 == 0) watched->update_surfels();
    if (s % 7 == 2) diagnose(model_, *watched, s, start_of_share.dt);
    if (s % 11 == 5) b.state();
  }
  const State x = a.state(), y = b.state();
  std::vector<Index> different;
  for (Index i = 0; i < model_.size(); ++i) {
    if (model_.owns(i) && !(x.displacement[i] == y.displacement[i])) different.push_back(i);
  }
  EXPECT_THAT(different, ::testing::IsEmpty());
  world().barrier();
}

TEST_P(Shares, AreAsStiffAsTheWholeToTheLastBit) {
  const auto alone = backend(whole_, Precision::double_),
             here = backend(model_, Precision::double_);
  const StepLimit one = step_limit(whole_, *alone), all = step_limit(model_, *here);
  world().barrier();
  EXPECT_EQ(one.omega_max, all.omega_max);
  EXPECT_EQ(one.iterations, all.iterations);
  EXPECT_EQ(one.sound_step, all.sound_step);
}

TEST_P(Shares, TellWhichPhyxelOfTheWholeIsBad) {
  const auto here = backend(model_, Precision::single);
  State state = start(model_);
  const Index broken = whole_.size() - 1;
  for (Index i = 0; i < model_.size(); ++i) {
    if (model_.global_id(i) == broken) state.displacement[i].x = std::nan("");
  }
  here->put(state);
  const Diagnostics d = diagnose(model_, *here, 0, state.dt);
  world().barrier();
  ASSERT_GE(d.bad_phyxel, 0);  // it, or a neighbour that its NaN has reached
  EXPECT_LE(norm(whole_.position[d.bad_phyxel] - whole_.position[broken]),
            2 * whole_.neighbourhood.support[broken]);
}

std::string name_of(const ::testing::TestParamInfo<std::tuple<ShareCase, Way>>& test) {
  const char* ways[] = {"Cpu", "GpuDirect", "GpuNccl", "GpuMpi", "GpuHost"};
  const auto& [body, way] = test.param;
  return std::string(body.name) + ways[static_cast<int>(way)];
}
INSTANTIATE_TEST_SUITE_P(Bodies, Shares,
                         ::testing::Combine(::testing::ValuesIn(share_cases()),
                                            ::testing::Values(Way::cpu, Way::gpu_direct,
                                                              Way::gpu_nccl, Way::gpu_mpi,
                                                              Way::gpu_host)),
                         name_of);

}  // namespace
}  // namespace phyxel
