/// What makes many bodies that touch cheap: copies share their distances, what moves together is
/// not looked at anew, and what is far away is left out. None of it changes a result.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "mesh/distance_field.hpp"
#include "model/assembly.hpp"
#include "model/contact.hpp"
#include "model/contact_groups.hpp"
#include "model/parts.hpp"
#include "solver/contact_search.hpp"
#include "solver/contact_watch.hpp"
#include "solver/step_contacts.hpp"
#include "support/contact_scene.hpp"

namespace phyxel {
namespace {

/// A body without symmetry: a block of unequal edges. @param degrees its rotation. @param place its
/// translation [m]
std::string brick(const std::string& name, Vec3d degrees, Vec3d place,
                  const std::string& more = "") {
  return fmt::format(
      "[[body]]\nname = '{}'\nshape = 'block'\nsize = [0.2, 0.15, 0.1]\nspacing = 0.05\n"
      "lattice = 'nodes'\nrotation = [{:.17g}, {:.17g}, {:.17g}]\n"
      "translation = [{:.17g}, {:.17g}, {:.17g}]\n{}"
      "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n",
      name, degrees.x, degrees.y, degrees.z, place.x, place.y, place.z, more);
}

const std::string touching = "[contact]\nfriction = 0.3\n";

std::string velocity(Vec3d v) {
  return fmt::format("velocity = [{:.17g}, {:.17g}, {:.17g}]\n", v.x, v.y, v.z);
}

TEST(Copies, OfABodyShareOneFieldOfDistances) {
  const Model model = build_model(parse_scene(
      end + touching + brick("a", {}, {}) + brick("moved", {}, {0.3, 0, 0}) +
          brick("turned", {10, 20, 30}, {0, 0.3, 0}) +
          "[[body]]\nname = 'other'\nshape = 'block'\nsize = [0.2, 0.15, 0.15]\nspacing = 0.05\n"
          "lattice = 'nodes'\ntranslation = [0, 0, 0.4]\n" +
          material,
      "scene.toml"));
  const std::vector<BodyDistances>& distances = model.body_contact.distances;
  EXPECT_EQ(distances[1].arrays, distances[0].arrays);
  EXPECT_EQ(distances[2].arrays, distances[0].arrays);
  EXPECT_NE(distances[3].arrays, distances[0].arrays);
  for (int e = 0; e < 9; ++e) EXPECT_EQ(distances[1].turn(e / 3, e % 3), e % 4 == 0 ? 1 : 0);
  // The deepest place is the middle of each; in a field it is one of its nodes.
  const double node = distances[0].arrays->shape.spacing;
  EXPECT_LE(norm(distances[1].deepest() - Vec3d{0.3, 0, 0}), 4 * node);
  const Vec3d up = rotation_by(std::numbers::pi / 180 * Vec3d{10, 20, 30}) * Vec3d{0, 0, 1};
  const Gap gap = distances[2].view().gap(Vec3d{0, 0.3, 0} + 0.06 * up);
  EXPECT_NEAR(gap.distance, 0.01, 1e-6);
  EXPECT_LE(norm(gap.normal - up), 1e-6);
}

/// The impulses on two bricks that collide, in a scene that is turned. If `late`, their fields are
/// those of bricks elsewhere, that are not turned.
std::vector<Vec3d> impulses(Vec3d degrees, bool late) {
  const Mat3d turn = rotation_by(std::numbers::pi / 180 * degrees);
  std::string text = end + touching;
  if (late) text += brick("elsewhere", {}, {5, 0, 0});
  Way way(
      text + brick("a", degrees, turn * Vec3d{}, velocity(turn * Vec3d{0.5, 0.2, 0})) +
          brick("b", degrees, turn * Vec3d{0.21, 0.03, 0.02}, velocity(turn * Vec3d{-0.5, 0, 0})),
      dt);
  way.solver.step(150);
  std::vector<Vec3d> found;
  for (const ContactReading& c : way.contacts()) found.push_back(transpose(turn) * c.impulse);
  if (late) found.erase(found.begin());
  return found;
}

TEST(Copies, OfAFineBodyHaveAFieldThatReachesToCoarsePoints) {
  // Points of the coarse block look distances up a quarter of their support away.
  const Model model = build_model(parse_scene(
      end + touching + brick("fine", {}, {}) +
          "[[body]]\nname = 'coarse'\nshape = 'block'\nsize = [1.4, 1.4, 1.4]\nspacing = 0.35\n"
          "lattice = 'nodes'\ntranslation = [0, 0, 1]\n" +
          material,
      "scene.toml"));
  double coarse = 0;
  for (const double support : model.neighbourhood.support) coarse = std::max(coarse, support);
  const DistanceField& field = model.body_contact.distances[0].arrays->shape;
  EXPECT_LE(field.low.x, field.box_low.x - 0.25 * coarse);
  EXPECT_LE(field.low.z, field.box_low.z - 0.25 * coarse);
}

TEST(Copies, ThatAreTurnedGiveTheSameForcesTurned) {
  const std::vector<Vec3d> expected = impulses({}, false);
  EXPECT_GT(norm(expected[0]), 1);
  const std::vector<Vec3d> found = impulses({31, -77, 160}, true);
  for (std::size_t b = 0; b < expected.size(); ++b) {
    // Distances are kept in float: 1e-8 of their size, which collisions enlarge.
    EXPECT_LE(norm(found[b] - expected[b]), 3e-4 * norm(expected[b]));
  }
}

TEST(Copies, ActAsBodiesWithFieldsOfTheirOwn) {
  const std::string text = end + touching + brick("a", {}, {}, velocity({0.5, 0.2, 0})) +
                           brick("b", {}, {0.21, 0.03, 0.02}, velocity({-0.5, 0, 0}));
  Way shared(text, dt);
  Model model = build_model(shared.scene);
  BodyDistances& own = model.body_contact.distances[1];
  ASSERT_EQ(own.arrays, model.body_contact.distances[0].arrays);
  DistanceArrays moved = *own.arrays;
  moved.shape.low += own.place;
  moved.shape.box_low += own.place;
  moved.shape.box_high += own.place;
  own = {std::make_shared<const DistanceArrays>(std::move(moved)), identity<double>(), {}};
  const auto backend = testing::make_test_backend(model, Precision::double_, 1);
  Solver solver(model, *backend, initial_state(model, shared.scene, dt), Method::verlet);
  solver.step(150);
  shared.solver.step(150);
  EXPECT_GT(norm(shared.contacts()[0].impulse), 1);
  const State a = solver.state(), b = shared.solver.state();
  for (Index i = 0; i < model.size(); ++i) {
    EXPECT_LE(norm(a.displacement[i] - b.displacement[i]), 1e-9);
  }
}

/// Where a watch is told that the phyxels of bodies are.
struct Watched {
  Model model;
  SurfaceLayer layer{model};
  LayerWatch watch{layer, 1};
  NearBoxes near;
  std::vector<Vec3d> way, velocity;  // of each body

  explicit Watched(const std::vector<Vec3d>& places) : model(model_of(places)) {
    way.resize(places.size());
    velocity.resize(places.size());
  }
  static Model model_of(const std::vector<Vec3d>& places) {
    std::string text = end + touching;
    for (std::size_t b = 0; b < places.size(); ++b) {
      text += brick(fmt::format("{}", b), {}, places[b]);
    }
    return build_model(parse_scene(text, "scene.toml"));
  }
  bool is_late() {
    const auto state_of = [&](Index i) {
      const Index body = part_of(model, i).body;
      return SurfaceState{way[body], velocity[body]};
    };
    if (!watch.is_late(dt, state_of)) return false;
    std::vector<Vec3d> position;
    for (const Index i : model.body_contact.layer.phyxels) {
      position.push_back(model.position[i] + state_of(i).displacement);
    }
    watch.found(position, layer.reach_at(position, watch.skins(), near));
    return true;
  }
};

TEST(LayerWatch, LooksAtBodiesThatMoveAgainstEachOtherAlone) {
  Watched bodies({{}, {0.25, 0, 0}, {3, 0, 0}});
  EXPECT_TRUE(bodies.is_late());
  EXPECT_FALSE(bodies.is_late());
  // All fall together.
  bodies.way = {{0, 0, -1}, {0, 0, -1}, {0, 0, -1}};
  bodies.velocity = {{0, 0, -50}, {0, 0, -50}, {0, 0, -50}};
  EXPECT_FALSE(bodies.is_late());
  // One that is far away moves.
  bodies.way[2].x = -1.5;
  EXPECT_FALSE(bodies.is_late());
  // It comes near.
  bodies.way[2].x = -2.5;
  EXPECT_TRUE(bodies.is_late());
  EXPECT_FALSE(bodies.is_late());
  // Two that are near each other move by less than a skin, and by more.
  bodies.way[0].y = 0.9 * bodies.watch.skins()[0];
  EXPECT_FALSE(bodies.is_late());
  bodies.way[1].z -= 0.9 * bodies.watch.skins()[0];
  EXPECT_TRUE(bodies.is_late());
  // One is so fast that it will.
  EXPECT_FALSE(bodies.is_late());
  bodies.velocity[0].y = 0.6 * bodies.watch.skins()[0] / dt;
  EXPECT_TRUE(bodies.is_late());
}

TEST(LayerWatch, LooksAsSoonAsBodiesMayHaveGoneFartherThanTheSkin) {
  const Watched bodies({{}, {0.25, 0, 0}});
  LayerWatch rare(bodies.layer, 1, 4);
  NearBoxes near;
  double step = 2 * dt;
  const auto next_look = [&](double speed) {
    const auto state_of = [&](Index i) {
      return SurfaceState{{}, {part_of(bodies.model, i).body == 0 ? speed : 0, 0, 0}};
    };
    step *= 0.5;  // a step of another size is looked at anew
    EXPECT_TRUE(rare.is_late(step, state_of));
    const std::vector<Vec3d> position(bodies.layer.sites().size());
    rare.found(bodies.layer.reach_at(position, rare.skins(), near));
    int steps = 1;
    while (!rare.is_due(step)) ++steps;
    return steps;
  };
  // Speeds may double; the widest skin that is worth its time lasts for some steps.
  const auto speed_over = [&](double steps) {
    return bodies.layer.most_skin() / (2 * steps * 0.5 * step);
  };
  EXPECT_EQ(next_look(speed_over(100)), 4);
  EXPECT_EQ(next_look(speed_over(2.5)), 2);
  EXPECT_EQ(next_look(speed_over(1.5)), 1);
  EXPECT_EQ(next_look(speed_over(0.5)), 1);  // with a wider skin
  EXPECT_GT(rare.skins()[0], 1.9 * bodies.layer.most_skin());
}

/// A device looks every few steps, at ways that it may have found a step ago. Lists must hold to
/// the end of each step, and are found anew no sooner than they have to be.
TEST(LayerWatch, KeepsListsAsLongAsTheyHold) {
  for (const int since : {0, 1}) {
    const Watched bodies({{}, {0.25, 0, 0}});
    LayerWatch rare(bodies.layer, 1, 4);
    NearBoxes near;
    const double most = bodies.layer.most_skin(), step_way = most / 24;
    int searches = 0;
    double found_at = 0, way = 0;
    for (int step = 0; step < 240; ++step, way += step_way) {
      if (rare.is_due(dt)) {
        const double seen = searches > 0 ? way - since * step_way - found_at : 0;
        std::vector<SurfaceWay> ways;
        for (const Index body : bodies.layer.bodies_of_groups()) {
          const Vec3d x{body == 0 ? std::max(seen, 0.0) : 0, 0, 0},
              v{body == 0 ? step_way / dt : 0, 0, 0};
          ways.push_back({{x, x}, {v, v}});
        }
        if (rare.is_late_by(ways, dt, since)) {
          ++searches;
          found_at = way;
          const std::vector<Vec3d> position(bodies.layer.sites().size());
          rare.found(bodies.layer.reach_at(position, rare.skins(), near));
        }
      }
      // Speeds may double in this step.
      EXPECT_LE(way + 2 * step_way - found_at, rare.skins()[0] * (1 + 1e-12)) << step;
    }
    // Lists hold for 24 steps; speeds may double in the last ones.
    EXPECT_LE(searches, since == 0 ? 11 : 12);
    EXPECT_GE(searches, 10);
  }
}

/// Two that fly towards each other have wide skins, others that rest side by side narrow ones.
TEST(LayerWatch, GivesFastBodiesWideSkins) {
  Watched bodies({{}, {0.25, 0, 0}, {3, 0, 0}, {3.25, 0, 0}});
  EXPECT_TRUE(bodies.is_late());
  bodies.velocity[0].x = 0.1 * bodies.layer.least_skin() / dt;
  bodies.way[0].x = -1.5 * bodies.layer.least_skin();
  EXPECT_TRUE(bodies.is_late());
  const std::vector<double>& skins = bodies.watch.skins();
  EXPECT_GT(skins[0], 1.9 * bodies.layer.least_skin());
  EXPECT_EQ(skins[0], skins[1]);
  EXPECT_DOUBLE_EQ(skins[2], bodies.layer.least_skin());
  EXPECT_DOUBLE_EQ(skins[3], bodies.layer.least_skin());
  EXPECT_DOUBLE_EQ(skin_of(skins.data(), 1, 2), bodies.layer.least_skin());
}

TEST(LayerWatch, LooksAnewWhereTheStepChanges) {
  Watched bodies({{}, {0.25, 0, 0}});
  EXPECT_TRUE(bodies.is_late());
  const auto at_rest = [](Index) { return SurfaceState{}; };
  EXPECT_FALSE(bodies.watch.is_late(dt, at_rest));
  EXPECT_TRUE(bodies.watch.is_late(dt / 2, at_rest));
}

/// Obstacles of all shapes, at random places, turned, some of them hollow or on their way.
std::string obstacles(int count, double extent) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> of(-1, 1);
  const std::string shapes[] = {"shape = 'sphere'\nradius = 0.06\n",
                                "shape = 'box'\nsize = [0.1, 0.2, 0.05]\n",
                                "shape = 'capsule'\nradius = 0.05\nlength = 0.1\n",
                                "shape = 'cylinder'\nradius = 0.07\nlength = 0.1\n",
                                "shape = 'plane'\n",
                                "shape = 'box'\nsize = [4, 4, 4]\nhollow = true\n"};
  std::string text;
  for (int k = 0; k < count; ++k) {
    const bool large = k % 6 > 3;
    const double x = of(random), y = of(random), z = of(random);
    text += obstacle(
        fmt::format("name = 'o{}'\n{}translation = [{}, {}, {}]\nrotation = [{}, {}, {}]\n", k,
                    shapes[k % 6], large ? 0 : extent * x, large ? 0 : extent * y,
                    large ? -1.9 : extent * z, 90 * y, 90 * z, 90 * x));
    if (k % 5 == 0) text += "[obstacle.motion]\nvelocity = [1, 0.5, -0.3]\n";
  }
  return text;
}

TEST(Culling, LeavesOutNothingThatMayTouch) {
  const std::vector<Obstacle> all =
      obstacles_of(parse_scene(end + obstacles(60, 1) + block(), "scene.toml"));
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> of(-1, 1);
  const auto point = [&](double size) {
    const double x = of(random), y = of(random);
    return size * Vec3d{x, y, of(random)};
  };
  int clear = 0, near = 0;
  for (const Obstacle& obstacle : all) {
    const ObstacleStep at = obstacle.step_from(0.1, dt);
    for (int k = 0; k < 300; ++k) {
      const Vec3d centre = point(1.5);
      Box box = no_box;
      for (int c = 0; c < 2; ++c) extend(box, centre + point(0.3));
      const bool is_clear = is_clear_of(obstacle, at, box, 0.01);
      clear += is_clear;
      bool touches = false;
      ObstacleShapes::with(obstacle.form, [&](const auto& shape) {
        for (int p = 0; p < 100; ++p) {
          const Vec3d part = 0.5 * (point(1) + Vec3d{1, 1, 1}), size = box.high - box.low;
          const Vec3d x = box.low + Vec3d{part.x * size.x, part.y * size.y, part.z * size.z};
          touches = touches || gap_to(shape, at, x).distance < 0.01;
        }
      });
      near += touches;
      EXPECT_FALSE(is_clear && touches) << obstacle.name;
    }
  }
  EXPECT_GT(clear, 3000);
  EXPECT_GT(near, 1000);
}

/// The states of the phyxels of a model after a step, and its sums, without any culling.
std::vector<Touched> kept_out_one_by_one(const Model& model, double time,
                                         const std::vector<Touched>& start, StepSums& sums) {
  std::vector<Touched> states = start;
  const std::vector<Vec3d> free = free_axes_of_layer(model);
  const std::vector<double> inertia = inertia_of_layer(model, dt);
  for (std::size_t o = 0; o < model.obstacles.size(); ++o) {
    const ObstacleStep step = model.obstacles[o].step_from(time, dt);
    ObstacleShapes::with(model.obstacles[o].form, [&](const auto& shape) {
      for (std::size_t k = 0; k < model.contact.phyxels.size(); ++k) {
        const Index i = model.contact.phyxels[k];
        TouchingPoint p{model.position[i] + states[i].displacement,
                        states[i].velocity,
                        start[i].velocity,
                        free[k],
                        model.contact.offset[k],
                        inertia[k]};
        ContactTerms terms;
        if (!touch(shape, step, p, terms)) continue;
        states[i] = {states[i].displacement + dt * (p.velocity - states[i].velocity), p.velocity};
        for (int t = 0; t < ContactTerms::count; ++t) {
          sums[o * ContactTerms::count + t].add(terms.value[t]);
        }
      }
    });
  }
  return states;
}

TEST(Culling, GivesTheSameBits) {
  Model model = build_model(
      parse_scene(end + obstacle("shape = 'plane'\n") + block("translation = [0, 0, 9]\n") +
                      "[[body]]\nname = 'ball'\nshape = 'sphere'\nradius = 0.2\nspacing = 0.03\n"
                      "translation = [0.3, 0, 8]\n" +
                      material,
                  "scene.toml"));
  model.obstacles = obstacles_of(parse_scene(end + obstacles(60, 0.6) + block(), "scene.toml"));
  for (const int threads : {1, 3}) {
    StepContacts contacts(model, threads);
    StepSums sums(model.obstacles.size() * ContactTerms::count);
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> of(-1, 1);
    int touched = 0;
    for (int step = 0; step < 60; ++step) {
      // Bodies go to and fro, in small steps and large ones.
      const double part = step % 20 < 10 ? 0.01 * step : 0.3 * of(random);
      std::vector<Touched> states(model.size());
      for (Index i = 0; i < model.size(); ++i) {
        const double x = of(random), y = of(random);
        states[i] = {{part, 0.2 * part, -8.5 + part}, {x, y, of(random)}};
      }
      const std::vector<Touched> expected = kept_out_one_by_one(model, step * dt, states, sums);
      contacts.begin_step(step * dt, dt, [&](Index i) { return states[i].velocity; });
      const std::vector<Touched> start = states;
      contacts.keep_out([](Index) { return true; }, [&](Index i) { return states[i]; },
                        [&](Index i, const Touched& to) { states[i] = to; });
      for (Index i = 0; i < model.size(); ++i) {
        ASSERT_EQ(states[i].displacement, expected[i].displacement) << step;
        ASSERT_EQ(states[i].velocity, expected[i].velocity) << step;
        touched += states[i].velocity != start[i].velocity;
      }
    }
    EXPECT_GT(touched, 1000);
    EXPECT_EQ(words_of(contacts.sums()), words_of(sums));
  }
}

}  // namespace
}  // namespace phyxel
