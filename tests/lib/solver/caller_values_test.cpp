/// States, forces and displacements of a caller are checked before a backend uses them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/refusal.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

const double nan_value = std::nan("");

class CallerValues : public ::testing::Test {
 protected:
  Model model_ = model_of(one_body(), lattice(3, 3, 3, 0.1));
  std::unique_ptr<Backend> backend_ = make_test_backend(model_, Precision::double_);
  State rest_ = state_of(std::vector<Vec3d>(27));
};

TEST_F(CallerValues, StatesHaveAFiniteValueForEachPhyxel) {
  const auto with = [&](auto&& change) {
    State state = rest_;
    change(state);
    const std::string words = refusal_of([&] { backend_->upload(state); });
    EXPECT_EQ(refusal_of([&] { Solver(*backend_, state); }), words);
    return words;
  };
  EXPECT_EQ(with([](State&) {}), "accepted");
  EXPECT_EQ(with([](State& s) { s.displacement[4].y = nan_value; }),
            "displacement [m] of phyxel 4 is (0, nan, 0); allowed: finite numbers");
  EXPECT_EQ(with([](State& s) { s.velocity[26].z = INFINITY; }),
            "velocity [m/s] of phyxel 26 is (0, 0, inf); allowed: finite numbers");
  EXPECT_THAT(with([](State& s) { s.velocity.pop_back(); }),
              HasSubstr("27 displacements and 26 velocities for a model of 27 phyxels: allowed"));
  EXPECT_THAT(with([](State& s) { s.displacement.resize(28); }), HasSubstr("28 displacements"));
  EXPECT_THAT(with([](State& s) {
                s.history = {{"strain", std::vector<double>(27)}};
              }),
              HasSubstr("column \"strain\" found"));
  for (const double bad : {nan_value, -1.0}) {
    EXPECT_THAT(with([&](State& s) { s.history_interval = bad; }),
                HasSubstr("s of a state; allowed: >= 0, finite"));
  }
}

TEST_F(CallerValues, SolversStepForward) {
  const auto with = [&](auto&& change) {
    State state = rest_;
    change(state);
    return refusal_of([&] { Solver(*backend_, state); });
  };
  for (const double bad : {0.0, -1.0, nan_value, double(INFINITY)}) {
    EXPECT_THAT(with([&](State& s) { s.dt = bad; }), HasSubstr("s of a state; allowed: dt > 0"));
  }
  EXPECT_EQ(with([](State& s) { s.step = -1; }), "step = -1 of a state; allowed: >= 0");
}

TEST_F(CallerValues, DisplacementsAreAsManyAsPhyxels) {
  backend_->upload(rest_);
  EXPECT_EQ(refusal_of([&] { backend_->put_displacements(std::vector<Vec3d>(26)); }),
            "26 displacements for 27 phyxels: allowed are 27");
  EXPECT_EQ(refusal_of([&] { backend_->put_displacements(std::vector<Vec3d>(27)); }), "accepted");
}

TEST_F(CallerValues, ExternalForcesAreFinite) {
  std::vector<Vec3d> force(27);
  force[9].x = nan_value;
  EXPECT_EQ(refusal_of([&] { backend_->set_external_forces(force); }),
            "external force [N] of phyxel 9 is (nan, 0, 0); allowed: finite numbers");
  EXPECT_TRUE(backend_->external_forces().empty());  // nothing was taken
}

TEST_F(CallerValues, SearchesStartFromAFiniteState) {
  Scene scene = one_body();
  scene.bodies[0].fixed.push_back({.select = {.indices = std::vector<Index>{0, 1, 3, 9}}});
  const Model held = model_of(scene, lattice(3, 3, 3, 0.1));
  const auto backend = make_test_backend(held, Precision::double_);
  std::vector<Vec3d> start(26);
  const auto refusal = [&] {
    return refusal_of([&] { find_equilibrium(held, *backend, {.start = &start}); });
  };
  EXPECT_THAT(refusal(), HasSubstr("26 displacements"));
  start.resize(27);
  EXPECT_EQ(refusal(), "accepted");
  start[20].z = nan_value;
  EXPECT_THAT(refusal(), HasSubstr("displacement [m] of phyxel 20 is (0, 0, nan)"));
}

TEST_F(CallerValues, BackendsAreThoseOfTheirModel) {
  const Model other = model_of(one_body(), lattice(2, 3, 3, 0.1));
  backend_->upload(rest_);
  std::vector<double> stress;
  const std::string words =
      "a model of 18 phyxels and a backend of 27: allowed is the backend that was made of the "
      "model";
  EXPECT_EQ(refusal_of([&] { diagnose(other, *backend_, 0, 1e-3); }), words);
  EXPECT_EQ(refusal_of([&] { stress_fields(other, *backend_, &stress, nullptr); }), words);
  EXPECT_EQ(refusal_of([&] { find_stiffening(other, *backend_); }), words);
  EXPECT_EQ(refusal_of([&] { step_limit(other, *backend_); }), words);
  EXPECT_EQ(refusal_of([&] { find_equilibrium(other, *backend_); }), words);
  EXPECT_EQ(refusal_of([&] { Solver(other, *backend_, rest_, Method::verlet); }), words);
  EXPECT_EQ(refusal_of([&] { initial_state(model_, Scene{}, 1e-3); }),
            "a model of 1 bodies and a scene of 0: allowed is the scene that the model was built "
            "from");
}

}  // namespace
}  // namespace phyxel
