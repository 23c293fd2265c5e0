/// The public face of ranks: a model shared by them is the whole one, in parts.
#include "phyxel/shared_model.hpp"

#include <gmock/gmock.h>

#include <optional>

#include "phyxel/phyxel.hpp"
#include "ranks.hpp"
#include "support/clouds.hpp"
#include "support/folder.hpp"

namespace phyxel {
namespace {

using test::all_ranks;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

Scene spinning_beam() {
  Scene scene;
  BodyRequest& body = scene.bodies.emplace_back();
  body.name = "beam";
  body.where = "test";
  body.source.shape = {.name = "beam", .size = {2, 0.5, 0.5}, .spacing = 0.1};
  body.material = testing::rubber();
  body.spin = {0, 0, 3};
  scene.gravity = {0, 0, -9.81};
  scene.solver.precision = Precision::double_;
  return scene;
}

const ChosenDevice cpu = choose_device("cpu");

/// After some steps, of this rank.
State stepped(const SharedModel& shared, const Scene& scene, int steps) {
  const auto backend = shared.make_backend(Precision::double_, 1);
  const double dt = 0.5 * step_limit(shared.here(), *backend).largest_step;
  Solver solver(*backend, initial_state(shared.here(), scene, dt));
  solver.step(steps - solver.steps());
  return solver.state();
}

class ASharedModel : public test::Folder {
 protected:
  /// Of all ranks the first one's, which alone may hold files.
  const bool leads_ = all_ranks().leads();
};

TEST_F(ASharedModel, IsTheWholeOneInParts) {
  const Scene scene = spinning_beam();
  const Model whole = build_model(scene);
  const SharedModel shared(all_ranks(), scene, cpu);
  EXPECT_EQ(shared.digest(), model_digest(whole));
  EXPECT_EQ(shared.here().global_count(), whole.size());
  const int count = all_ranks().size();
  EXPECT_LE(shared.shares().fewest, whole.size() / count);
  EXPECT_GE(shared.shares().most, whole.size() / count);
  EXPECT_EQ(shared.shares().most_ghosts > 0, count > 1);
  EXPECT_EQ(shared.partitioner().empty(), count == 1);
  std::int64_t own = 0;
  for (Index i = 0; i < shared.here().size(); ++i) own += shared.here().owns(i);
  EXPECT_EQ(all_ranks().sum(own), whole.size());
}

TEST_F(ASharedModel, FromCloudsIsTheSame) {
  const Scene scene = spinning_beam();
  const std::vector<Cloud> clouds{make_cloud(scene.bodies[0])};
  const SharedModel shared(all_ranks(), scene, clouds, cpu, {"curve"});
  EXPECT_EQ(shared.digest(), model_digest(build_model(scene)));
  EXPECT_EQ(shared.partitioner(), all_ranks().size() > 1 ? "curve" : "");
}

TEST_F(ASharedModel, RefusesToGatherWhatItDoesNotHave) {
  const SharedModel shared(all_ranks(), spinning_beam(), cpu);
  const auto here = static_cast<std::size_t>(shared.here().size());
  const Index all = shared.here().global_count();
  const std::vector<double> values(3 * here, 1.0);
  const auto refusal = [&](Quantity quantity, std::size_t count, Index begin, Index end) {
    try {
      shared.gathered(quantity, std::span(values).first(count), begin, end);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const auto range = HasSubstr("allowed: a range within 0 to " + std::to_string(all));
  EXPECT_THAT(refusal(Quantity::displacement, 3 * here, -1, 5), range);
  EXPECT_THAT(refusal(Quantity::displacement, 3 * here, 5, all + 1), range);
  EXPECT_THAT(refusal(Quantity::displacement, 3 * here, 5, 4), range);
  // One rank alone has too few.
  const std::size_t lacking = all_ranks().leads() ? 1 : 0;
  EXPECT_THAT(refusal(Quantity::mass, here - lacking, 0, all), HasSubstr("allowed: 1 of each"));
  EXPECT_EQ(refusal(Quantity::mass, here, 0, all), "accepted");
}

TEST_F(ASharedModel, StepsAsOneRankWould) {
  const Scene scene = spinning_beam();
  const SharedModel shared(all_ranks(), scene, cpu);
  const State here = stepped(shared, scene, 20);
  const Ranks one;
  const SharedModel alone(one, scene, cpu);
  const State whole = stepped(alone, scene, 20);
  std::vector<double> values;
  for (const Vec3d u : here.displacement) values.insert(values.end(), {u.x, u.y, u.z});
  const Index begin = 17, end = shared.here().global_count() - 5;
  const std::vector<double> some = shared.gathered(Quantity::displacement, values, begin, end);
  if (!leads_) {
    EXPECT_THAT(some, IsEmpty());
    return;
  }
  ASSERT_EQ(some.size(), 3 * static_cast<std::size_t>(end - begin));
  for (Index i = begin; i < end; ++i) {
    const double* const u = &some[3 * static_cast<std::size_t>(i - begin)];
    EXPECT_EQ((Vec3d{u[0], u[1], u[2]}), whole.displacement[i]) << i;
  }
  EXPECT_GT(norm(whole.displacement[end]), 1e-3);
}

/// A bar of two materials with closed gradients, which falls and spins.
Scene closed_bar(Precision precision) {
  Scene scene = spinning_beam();
  BodyRequest& bar = scene.bodies[0];
  bar.source.shape.jitter = 0.2;
  bar.closure = 1e-3;
  Material stiff = bar.material;
  stiff.young *= 5;
  stiff.density *= 2;
  bar.inclusions.push_back(
      {.select = {.box = Selection::Box{{0.7, -1, -1}, {1.2, 1, 0.1}}}, .material = stiff});
  bar.fixed.push_back({.select = {.region = "x-"}});
  scene.solver.precision = precision;
  return scene;
}

/// Each rank adds phyxels of both materials, and sums of all phyxels are exact.
TEST_F(ASharedModel, OfTwoMaterialsWithClosedGradientsStepsAsOneRankWould) {
  for (const Precision precision : {Precision::single, Precision::double_}) {
    const Scene scene = closed_bar(precision);
    const SharedModel shared(all_ranks(), scene, cpu);
    const Ranks one;
    const SharedModel alone(one, scene, cpu);
    EXPECT_EQ(shared.digest(), alone.digest());
    ASSERT_EQ(shared.here().parts.size(), 2u);
    ASSERT_FALSE(shared.here().closing.empty());
    const auto whole_backend = alone.make_backend(precision, 1),
               backend = shared.make_backend(precision, 1);
    const double dt = 0.5 * step_limit(alone.here(), *whole_backend).largest_step;
    EXPECT_EQ(0.5 * step_limit(shared.here(), *backend).largest_step, dt);
    Solver whole(*whole_backend, initial_state(alone.here(), scene, dt)),
        solver(*backend, initial_state(shared.here(), scene, dt));
    whole.step(40);
    solver.step(40);
    const State expected = whole.state(), state = solver.state();
    Index different = 0;
    double moved = 0;
    for (Index i = 0; i < shared.here().size(); ++i) {
      if (!shared.here().owns(i)) continue;
      const Index n = shared.here().global_id(i);
      different += !(state.displacement[i] == expected.displacement[n] &&
                     state.velocity[i] == expected.velocity[n]);
      moved = std::max(moved, norm(state.displacement[i]));
    }
    EXPECT_EQ(different, 0);
    EXPECT_GT(all_ranks().largest(moved), 1e-3);
    const Diagnostics d = diagnose(alone.here(), *whole_backend, 40, dt),
                      e = diagnose(shared.here(), *backend, 40, dt);
    EXPECT_EQ(d.kinetic_energy, e.kinetic_energy);
    EXPECT_EQ(d.total_energy(), e.total_energy());
    EXPECT_EQ(d.momentum, e.momentum);
  }
}

TEST_F(ASharedModel, GoesOnFromACheckpoint) {
  const Scene scene = spinning_beam();
  const SharedModel shared(all_ranks(), scene, cpu);
  const Ranks one;
  std::optional<CheckpointReader> reader;
  if (leads_) {
    const SharedModel alone(one, scene, cpu);
    CheckpointInfo info;
    info.precision = Precision::double_;
    info.model_digest = alone.digest();
    reader.emplace(write_checkpoint(folder_, stepped(alone, scene, 20), info));
  }
  const State read = shared.state_of(reader ? &*reader : nullptr, 37);
  const State here = stepped(shared, scene, 20);
  EXPECT_EQ(read.step, 20);
  EXPECT_EQ(read.time, here.time);
  EXPECT_EQ(read.dt, here.dt);
  ASSERT_EQ(read.displacement.size(), here.displacement.size());
  for (Index i = 0; i < shared.here().size(); ++i) {
    if (!shared.here().owns(i)) continue;
    EXPECT_EQ(read.displacement[i], here.displacement[i]) << i;
    EXPECT_EQ(read.velocity[i], here.velocity[i]) << i;
  }

  Scene other = scene;
  other.bodies[0].material.young *= 2;
  const SharedModel stiffer(all_ranks(), other, cpu);
  try {
    stiffer.state_of(reader ? &*reader : nullptr);
    ADD_FAILURE() << "a checkpoint of another model was taken";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("another model"));
  }
}

TEST_F(ASharedModel, RefusesOnEveryRankWhatItDoesNotKnow) {
  const auto said = [](auto&& make) -> std::string {
    try {
      make();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::bad_input);
      return error.what();
    }
    return "nothing";
  };
  const Scene scene = spinning_beam();
  EXPECT_THAT(said([&] { SharedModel(all_ranks(), scene, cpu, {"knife"}); }), HasSubstr("knife"));
  EXPECT_THAT(said([&] { choose_device(all_ranks(), "gpu"); }), HasSubstr("device gpu: unknown"));
  const SharedModel shared(all_ranks(), scene, cpu);
  EXPECT_THAT(said([&] { shared.make_backend(Precision::single, 1, "pigeon"); }),
              HasSubstr("transport pigeon: unknown"));
}

TEST(Ranks, SumExactly) {
  // One of each is lost if terms are added as doubles, in most orders.
  const std::vector<double> terms{1e300, 1, -1e300, 1e-20};
  const int count = all_ranks().size();
  EXPECT_EQ(all_ranks().exact_sum(terms), count);
  const double own = all_ranks().leads() ? 1e17 : all_ranks().rank() == 1 ? -1e17 : 0.25;
  const double sum = all_ranks().exact_sum(std::vector{own, 0.5});
  EXPECT_EQ(sum, count == 1 ? 1e17 : count == 2 ? 1.0 : 1.75);
}

}  // namespace
}  // namespace phyxel
