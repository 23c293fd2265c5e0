/// Surfaces that cracks open: surfels follow the phyxels on their side, and triangles that a crack
/// crosses are left out.
#include "phyxel/open_surface.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "phyxel/output_fields.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"

namespace phyxel {
namespace {

/// A block with a notch in the plane x = 0.01 that reaches down to z = `depth`, between columns of
/// phyxels.
struct NotchedBlock {
  NotchedBlock(double depth, Precision precision) {
    scene = parse_scene(
        "[time]\nend = 1\n[output]\nfields = ['volume_ratio', 'fragment']\n"
        "[[body]]\nshape = 'block'\nsize = [1, 0.4, 0.4]\nspacing = 0.05\nlattice = 'cells'\n"
        "[body.material]\nyoung = 1e6\npoisson = 0.25\ndensity = 1000\n"
        "[[body.notch]]\ncentre = [0.001, 0, " +
            std::to_string(depth + 50) +
            "]\n"
            "normal = [1, 0, 0]\nradius = 50\n",
        "scene.toml");
    model = build_model(scene);
    backend = testing::make_test_backend(model, precision);
    state = initial_state(model, scene, 1e-4);
    backend->upload(state);
  }
  static bool is_right(Vec3d rest) { return rest.x > 0; }
  /// Displaces each phyxel to where it is put.
  template <class Place>
  void put(Place&& place) {
    for (Index i = 0; i < model.size(); ++i) {
      state.displacement[i] = place(model.position[i]) - model.position[i];
    }
    backend->upload(state);
  }
  SurfelState surface() {
    SurfelState surfels;
    backend->advect_surfels(surfels);
    return surfels;
  }
  std::vector<Triangle> uncut() const {
    return uncut_triangles(model, model.surfels.triangle, state.broken)
        .value_or(model.surfels.triangle);
  }

  Scene scene;
  Model model;
  std::unique_ptr<Backend> backend;
  State state;
};

/// One half stays, the other is turned away, as rigid bodies: so are their surfels and normals, and
/// what is left of the surface keeps its area.
TEST(OpenSurface, SurfelsFollowTheirSideOfACrack) {
  const double turn = std::numbers::pi / 6;
  const auto turned = [&](Vec3d v) {
    return Vec3d{std::cos(turn) * v.x - std::sin(turn) * v.y,
                 std::sin(turn) * v.x + std::cos(turn) * v.y, v.z};
  };
  for (const Precision precision : {Precision::single, Precision::double_}) {
    NotchedBlock block(-1, precision);
    const auto place = [&](Vec3d x) {
      return NotchedBlock::is_right(x) ? turned(x) + Vec3d{0.2, 0.1, 0} : x;
    };
    block.put(place);
    const Surfels& rest = block.model.surfels;
    const SurfelState now = block.surface();
    const double rounding = precision == Precision::single ? 2e-6 : 1e-13;
    for (std::size_t s = 0; s < rest.position.size(); ++s) {
      if (std::abs(rest.position[s].x) < 1e-9) continue;  // equally near to both sides
      const bool right = NotchedBlock::is_right(rest.position[s]);
      EXPECT_LE(norm(now.position[s] - place(rest.position[s])), rounding) << s;
      const Vec3d normal = right ? turned(rest.normal[s]) : rest.normal[s];
      EXPECT_LE(norm(now.normal[s] - normal), 10 * rounding) << s;
    }
    const std::vector<Triangle> uncut = block.uncut();
    EXPECT_LT(uncut.size(), rest.triangle.size());
    EXPECT_GT(uncut.size(), rest.triangle.size() * 4 / 5);
    for (const Triangle& t : uncut) {
      const auto area = [&](const std::vector<Vec3d>& at) {
        return norm(cross(at[t[1]] - at[t[0]], at[t[2]] - at[t[0]])) / 2;
      };
      EXPECT_NEAR(area(now.position), area(rest.position), 2 * rounding);
    }
  }
}

/// Triangles that lack are those across the notch, down to its depth; ahead of its tip the surface
/// is whole.
TEST(OpenSurface, IsWholeAheadOfATip) {
  const NotchedBlock block(0, Precision::double_);
  const std::vector<Triangle> uncut = block.uncut();
  std::size_t lacking = 0;
  for (const Triangle& t : block.model.surfels.triangle) {
    if (std::find(uncut.begin(), uncut.end(), t) != uncut.end()) continue;
    ++lacking;
    double least = 1, most = -1;
    for (const Index s : t) {
      const Vec3d x = block.model.surfels.position[s];
      EXPECT_GT(x.z, -0.05);
      least = std::min(least, x.x);
      most = std::max(most, x.x);
    }
    EXPECT_LE(least, 0.001);
    EXPECT_GE(most, -0.001);
  }
  EXPECT_GT(lacking, 10u);
  EXPECT_FALSE(uncut_triangles(block.model, block.model.surfels.triangle, {}));
}

/// A state without broken pairs, put in after one with a crack, gives the surface of a whole body.
TEST(OpenSurface, ClosesAgainWithAStateThatIsWhole) {
  NotchedBlock block(-1, Precision::double_);
  const auto bent = [](Vec3d x) { return x + Vec3d{0.1 * x.x * x.x, 0.2 * x.x * x.y, 0}; };
  const std::vector<PhyxelPair> broken = std::exchange(block.state.broken, {});
  block.put(bent);
  const SurfelState whole = block.surface();
  block.state.broken = broken;
  block.put(bent);
  EXPECT_NE(block.surface().position, whole.position);
  block.state.broken.clear();
  block.put(bent);
  EXPECT_EQ(block.surface().position, whole.position);
  EXPECT_EQ(block.surface().normal, whole.normal);
}

/// One half is stretched, the other is at rest: fields of surfels are not mixed across the crack.
TEST(OpenSurface, SurfelsHaveTheFieldsOfTheirSide) {
  NotchedBlock block(-1, Precision::double_);
  block.put([](Vec3d x) { return NotchedBlock::is_right(x) ? Vec3d{1 + 1.1 * x.x, x.y, x.z} : x; });
  const OutputFields fields(block.model, block.scene.output);
  const SurfelState now = block.surface();
  const FieldValues found = fields.find(*block.backend, block.state, &now, nullptr);
  const std::vector<double>& ratio = found.at(on_surface(Quantity::volume_ratio));
  const std::vector<double>& fragment = found.at(on_surface(Quantity::fragment));
  double of_right = 0;
  for (Index i = 0; i < block.model.size(); ++i) {
    if (NotchedBlock::is_right(block.model.position[i])) of_right = found.at(Quantity::fragment)[i];
  }
  for (std::size_t s = 0; s < ratio.size(); ++s) {
    const Vec3d x = block.model.surfels.position[s];
    if (std::abs(x.x) < 1e-9) continue;
    EXPECT_NEAR(ratio[s], NotchedBlock::is_right(x) ? 1.1 : 1, 1e-9) << s;
    EXPECT_EQ(fragment[s] == of_right, NotchedBlock::is_right(x)) << s;
  }
}

}  // namespace
}  // namespace phyxel
