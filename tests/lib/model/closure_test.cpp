/// Closed gradients: what they are found from, and what they are for.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "phyxel/backend.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"
#include "phyxel/shapes.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

/// A block with a phyxel on each node, inner ones moved by up to 0.3 spacings, as are those on
/// faces within them.
ShapeRequest block() {
  return {.name = "block",
          .size = {0.8, 0.6, 1.0},
          .spacing = 0.1,
          .jitter = 0.3,
          .placement = ShapeRequest::Placement::nodes};
}
Scene scene_of(double closure, Material material = rubber()) {
  Scene scene = one_body(material);
  scene.bodies[0].closure = closure;
  return scene;
}
Model model_of_cloud(const Cloud& cloud, double closure, Material material = rubber()) {
  const Scene scene = scene_of(closure, material);
  return build_model(scene, std::span(&cloud, 1));
}

/// Forces under ∇u = g everywhere, by Cauchy's strain, and the stress.
struct Uniform {
  std::vector<Vec3d> force;
  Mat3d stress;
};
Uniform under(const Model& model, const Mat3d& g) {
  std::vector<Vec3d> u;
  for (const Vec3d& x : model.position) u.push_back(g * x);
  const auto backend = make_test_backend(model, Precision::double_);
  backend->upload(state_of(u));
  Uniform found;
  backend->internal_forces(found.force);
  const Material& m = model.parts[0].material;
  const double trace = g(0, 0) + g(1, 1) + g(2, 2);
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      found.stress(a, b) =
          m.lame_mu() * (g(a, b) + g(b, a)) + (a == b ? m.lame_lambda() * trace : 0);
    }
  }
  return found;
}
Mat3d some_gradient() {
  Mat3d g;
  std::mt19937_64 engine(2);
  for (int e = 0; e < 9; ++e) g(e / 3, e % 3) = uniform(engine, -1e-3, 1e-3);
  return g;
}
Material linear_rubber() {
  Material material = rubber();
  material.law = "small-strain";
  return material;
}

/// Inside an irregular body a uniform stress leaves no force, and on each face as much as is needed
/// to hold it: -P n times its area.
TEST(Closure, AUniformStressIsAtRestUnderItsTractions) {
  const Cloud cloud = make_shape(block());
  const Material material = linear_rubber();
  const Mat3d g = some_gradient();
  double largest_inside[2] = {};
  for (const double closure : {0.0, 1e-11}) {
    const Model model = model_of_cloud(cloud, closure, material);
    EXPECT_TRUE(model.warnings.empty());
    const Uniform found = under(model, g);
    const double face = norm(found.stress * Vec3d{1, 0, 0}) * 0.1 * 0.1;  // of a phyxel
    for (Index i = 0; i < model.size(); ++i) {
      const Vec3d x = model.position[i];
      const bool inside = std::abs(x.x) < 0.39 && std::abs(x.y) < 0.29 && std::abs(x.z) < 0.49;
      double& largest = largest_inside[closure > 0];
      if (inside) largest = std::max(largest, norm(found.force[i]) / face);
    }
    if (closure == 0) continue;
    // Phyxels of edges are on two faces: a stress that pulls at one of them.
    Mat3d along{};
    along(2, 2) = 1e-3;
    along(0, 0) = along(1, 1) = -1e-3 * material.poisson;
    const Uniform pulled = under(model, along);
    EXPECT_NEAR(pulled.stress(2, 2), material.young * 1e-3, 1e-9 * material.young);
    Vec3d top;
    for (const Index i : cloud.regions.at("z+")) top += pulled.force[i];
    const double expected = -pulled.stress(2, 2) * 0.8 * 0.6;
    EXPECT_NEAR(top.z, expected, 1e-9 * std::abs(expected));
    EXPECT_LT(std::hypot(top.x, top.y), 1e-9 * std::abs(expected));
  }
  EXPECT_GT(largest_inside[0], 0.05);  // so much for a cloud of this irregularity
  EXPECT_LT(largest_inside[1], 1e-8);  // the closure, over the share of one phyxel
}

/// A lattice whose phyxels at one end have been moved: where it is regular no gradient is changed,
/// unless sums are to close further than they can without those.
TEST(Closure, LeavesARegularLatticeAlone) {
  ShapeRequest request = block();
  request.size = {1.2, 1.2, 2.4};
  request.jitter = 0;
  Cloud cloud = make_shape(request);
  std::mt19937_64 engine(3);
  for (Vec3d& p : cloud.position) {
    const bool inside = std::abs(p.x) < 0.59 && std::abs(p.y) < 0.59 && p.z < 1.19;
    if (!inside || p.z < 0.6) continue;
    for (double* x : {&p.x, &p.y, &p.z}) *x += uniform(engine, -0.03, 0.03);
  }
  for (const double closure : {1e-2, 1e-4, 1e-9}) {
    const Model model = model_of_cloud(cloud, closure, linear_rubber());
    EXPECT_TRUE(model.warnings.empty()) << model.warnings.at(0);
    const Uniform found = under(model, some_gradient());
    const double face = norm(found.stress * Vec3d{1, 0, 0}) * 0.1 * 0.1;  // of a phyxel
    Index changed = 0, deep = 0;
    double sum = 0;
    for (Index i = 0; i < model.size(); ++i) {
      changed += norm(model.closing[i]) > 0;
      const Vec3d x = model.position[i];
      if (std::abs(x.x) > 0.59 || std::abs(x.y) > 0.59 || std::abs(x.z) > 1.19) continue;
      ++deep;
      sum += dot(found.force[i], found.force[i]) / (face * face);
    }
    // The mean over all phyxels is asked for; those inside are a part, with faces of their own.
    EXPECT_LT(std::sqrt(sum / deep), 2 * closure) << closure;
    if (closure == 1e-2) {
      EXPECT_LT(changed, 0.7 * model.size());
      EXPECT_GT(changed, 0.1 * model.size());
    }
  }
}

/// A search that is slow without the regular phyxels goes on with them, even where it is due for
/// its next check at once, after 500 iterations.
TEST(Closure, GoesOnWithAllPhyxelsWhereTheIrregularOnesAreSlow) {
  const Cloud cube = sample_surface(test::unit_cube(), {.phyxels = 6000});
  const Model model = model_of_cloud(cube, 1e-4);
  EXPECT_TRUE(model.warnings.empty()) << model.warnings.at(0);
}

/// On any cloud with a surface: phyxels on cells lie inside the surface, and share its area.
TEST(Closure, HoldsForPhyxelsBelowTheSurface) {
  ShapeRequest request = block();
  request.placement = ShapeRequest::Placement::cells;
  request.size = {1, 0.9, 1.2};
  const ShapeRequest ball{.name = "sphere", .radius = 0.6, .spacing = 0.1, .jitter = 0.2};
  for (const ShapeRequest& shape : {request, ball}) {
    const Cloud cloud = make_shape(shape);
    const Model model = model_of_cloud(cloud, 1e-10, linear_rubber());
    EXPECT_TRUE(model.warnings.empty()) << shape.name << ": " << model.warnings.at(0);
    const Uniform found = under(model, some_gradient());
    const double h = model.neighbourhood.support[0];
    double largest = 0;
    Index inside = 0;
    for (Index i = 0; i < model.size(); ++i) {
      double nearest = 1;
      for (const Vec3d& s : cloud.surface.position) {
        nearest = std::min(nearest, norm(s - model.position[i]));
      }
      if (nearest < 1.3 * h) continue;  // facets are smaller than 0.3 h
      ++inside;
      largest = std::max(largest, norm(found.force[i]));
    }
    EXPECT_GT(inside, 50);
    EXPECT_LT(largest, 1e-8 * model.parts[0].material.young * 1e-3 * 0.1 * 0.1) << shape.name;
  }
}

/// In a graded cloud, too, where phyxels differ in size: what is left is small against the face of
/// each phyxel, the smallest as well as the largest.
TEST(Closure, ClosesGradedCloudsEverywhere) {
  ShapeRequest request = block();
  request.placement = ShapeRequest::Placement::cells;
  request.size = {1, 1, 1};
  request.jitter = 0.2;
  Cloud cube = make_shape(request);
  for (std::vector<Vec3d>* points : {&cube.position, &cube.surface.position}) {
    for (Vec3d& p : *points) p += Vec3d{0.5, 0.5, 0.5};
  }
  const Cloud cloud = inverted(cube, 1, 0.1);
  double worst[2] = {};
  for (const double closure : {0.0, 1e-8}) {
    const Model model = model_of_cloud(cloud, closure, linear_rubber());
    EXPECT_TRUE(model.warnings.empty()) << model.warnings.at(0);
    EXPECT_GT(model.parts[0].pair_length, 0);
    EXPECT_TRUE(model.neighbourhood.symmetric);
    const auto [least, most] = std::ranges::minmax(model.neighbourhood.support);
    EXPECT_GT(most, 6 * least);
    const Uniform found = under(model, some_gradient());
    Index inside = 0;
    for (Index i = 0; i < model.size(); ++i) {
      double nearest = HUGE_VAL;
      for (const Vec3d& s : cloud.surface.position) {
        nearest = std::min(nearest, norm(s - model.position[i]));
      }
      if (nearest < 1.3 * model.neighbourhood.support[i]) continue;
      ++inside;
      const double face = std::pow(cloud.spacing[i], 2) * 1e-3 * model.parts[0].material.young;
      worst[closure > 0] = std::max(worst[closure > 0], norm(found.force[i]) / face);
    }
    EXPECT_GT(inside, 50);
  }
  EXPECT_GT(worst[0], 0.02);
  EXPECT_LT(worst[1], 1e-6);
}

/// Twelve triangles around a thousand phyxels: however large they are, all phyxels near get their
/// share.
TEST(Closure, TrianglesMayBeLarge) {
  Cloud cloud = make_shape({.name = "block",
                            .size = {1, 1, 1},
                            .spacing = 0.1,
                            .jitter = 0.2,
                            .placement = ShapeRequest::Placement::nodes});
  cloud.surface = test::box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5});
  const Material material = linear_rubber();
  const Model model = model_of_cloud(cloud, 1e-10, material);
  EXPECT_TRUE(model.warnings.empty());
  Mat3d along{};
  along(2, 2) = 1e-3;
  along(0, 0) = along(1, 1) = -1e-3 * material.poisson;
  const Uniform pulled = under(model, along);
  double largest = 0, least = 1;
  for (const Index i : cloud.regions.at("z+")) {
    const Vec3d x = model.position[i];
    if (std::max(std::abs(x.x), std::abs(x.y)) > 0.39) continue;
    const double share = -pulled.force[i].z / (pulled.stress(2, 2) * 0.1 * 0.1);
    largest = std::max(largest, share);
    least = std::min(least, share);
  }
  EXPECT_LT(largest, 1.5);  // jitter 0.2: areas of Voronoi's cells are between 0.6 and 1.4
  EXPECT_GT(least, 0.5);
}

/// Tractions of a uniform stress balance it on each phyxel: those on the six faces of a box, which
/// edges and corners share, and a pressure around a ball.
TEST(Closure, TractionsOfAUniformStressBalanceIt) {
  const auto largest_rest = [](const Surface& mesh, const Mat3d& g, auto&& tractions_for) {
    const Cloud cloud = sample_surface(mesh, {.phyxels = 700});
    Scene scene = scene_of(1e-10, linear_rubber());
    const Mat3d stress = under(build_model(scene, std::span(&cloud, 1)), g).stress;
    scene.bodies[0].tractions = tractions_for(stress);
    const Model model = build_model(scene, std::span(&cloud, 1));
    EXPECT_TRUE(model.warnings.empty()) << model.warnings.at(0);
    std::vector<Vec3d> rest = under(model, g).force;
    double acting = 0, largest = 0;
    for (const Load& load : model.loads) {
      for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
        rest[load.phyxels[k]] += load.force[k];
        acting = std::max(acting, norm(load.force[k]));
      }
    }
    for (const Vec3d& f : rest) largest = std::max(largest, norm(f));
    return largest / acting;
  };
  Selection everywhere;
  everywhere.all = true;
  const auto on_faces = [&](const Mat3d& stress) {
    std::vector<TractionRequest> tractions;
    for (const Vec3d n : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
      for (const double side : {-1.0, 1.0}) {
        tractions.push_back(
            {.select = everywhere, .traction = stress * (side * n), .normal = side * n});
      }
    }
    return tractions;
  };
  // The areas of edges change once, for all faces; each traction keeps its total. Seen: 2e-3; 0.08
  // if tractions do not follow.
  EXPECT_LT(largest_rest(test::box({0, 0, 0}, {1, 0.4, 0.5}), some_gradient(), on_faces), 4e-3);
  Mat3d smaller{};
  for (int e = 0; e < 9; e += 4) smaller(e / 3, e % 3) = -1e-3;
  EXPECT_LT(largest_rest(test::sphere({0, 0, 0}, 0.5, 3), smaller,
                         [&](const Mat3d& stress) {
                           return std::vector<TractionRequest>{
                               {.select = everywhere, .pressure = -stress(0, 0)}};
                         }),
            1e-8);
}

/// Loads by volume and the body's volume are those of the volumes that forces come from.
TEST(Closure, LoadsByVolumeFollow) {
  const Cloud cloud = make_shape(block());
  Scene scene = scene_of(1e-3);
  scene.bodies[0].volume_rule = VolumeRule::kernel;
  scene.bodies[0].loads.push_back({.select = {.all = true}, .force_density = {0, 0, -100}});
  const Model model = build_model(scene, std::span(&cloud, 1));
  double volume = 0, force = 0;
  for (const double v : model.volume) volume += v;
  for (const Vec3d& f : model.loads.at(0).force) force += f.z;
  EXPECT_NEAR(volume, 0.48, 1e-12);
  EXPECT_NEAR(model.parts[0].volume, 0.48, 1e-12);
  EXPECT_NEAR(force, -48, 1e-10);
}

/// A checkpoint of one is not taken for the other.
TEST(Closure, DigestsTellSurfacesApart) {
  Cloud cloud = make_shape(block());
  Scene scene = scene_of(1e-3);
  scene.bodies[0].volume_rule = VolumeRule::kernel;  // which the digest leaves out
  const auto digest = [&] { return model_digest(build_model(scene, std::span(&cloud, 1))); };
  const std::uint64_t one = digest();
  EXPECT_EQ(digest(), one);
  scene.bodies[0].closure = 2e-3;
  EXPECT_NE(digest(), one);
  scene.bodies[0].closure = 1e-3;
  for (Vec3d& x : cloud.surface.position) x.z *= 1.01;
  EXPECT_NE(digest(), one);
}

/// Whatever the cloud, masses are the bodies'; and both momenta are kept in large motions.
TEST(Closure, KeepsMassAndMomenta) {
  const Cloud cloud = make_shape(block());
  const Model plain = model_of_cloud(cloud, 0), closed = model_of_cloud(cloud, 1e-3);
  EXPECT_EQ(plain.mass, closed.mass);
  EXPECT_TRUE(plain.closing.empty());
  ASSERT_EQ(closed.closing.size(), closed.position.size());
  const auto backend = make_test_backend(closed, Precision::double_);
  backend->upload(state_of(random_deformation(closed, 0.02)));
  const Diagnostics d = diagnose(closed, *backend, 0, 1e-3);
  EXPECT_GT(d.strain_energy, 1);
  EXPECT_LT(norm(d.internal_force), 1e-14 * d.force_scale);
  EXPECT_LT(norm(d.internal_torque), 1e-13 * d.torque_scale);
}

/// Another body in front changes nothing.
TEST(Closure, IsTheSameForEachBody) {
  // Of several sizes; one is as closed at once as is asked, others take long.
  const std::vector<double> closures{1e-3, 0, 0.9, 1e-5, 1e-2};
  Scene scene;
  std::vector<Cloud> clouds;
  for (const double closure : closures) {
    ShapeRequest request = block();
    request.size.z += 0.2 * static_cast<double>(clouds.size());
    request.seed = clouds.size() + 1;
    clouds.push_back(make_shape(request));
    scene.bodies.push_back(scene_of(closure).bodies[0]);
  }
  const Model all = build_model(scene, clouds);
  for (std::size_t b = 0; b < closures.size(); ++b) {
    const Part& part = all.parts[b];
    const Model one = model_of_cloud(clouds[b], closures[b]);
    ASSERT_EQ(part.size, one.size());
    EXPECT_EQ(part.volume, one.parts[0].volume);
    for (Index i = 0; i < one.size(); ++i) {
      EXPECT_EQ(all.closing[part.begin + i], closures[b] > 0 ? one.closing[i] : Vec3d{});
      EXPECT_EQ(all.volume[part.begin + i], one.volume[i]);
    }
  }
}

/// Loads by volume are those of the volume inside the surface.
TEST(Closure, LeavesLoadsTheirDensity) {
  Scene scene = scene_of(1e-3);
  scene.bodies[0].loads.push_back({.select = {.all = true}, .force_density = {0, 0, 2}});
  const Cloud cloud = make_shape(block());
  const Model model = build_model(scene, std::span(&cloud, 1));
  double force = 0;
  for (const Vec3d& f : model.loads[0].force) force += f.z;
  EXPECT_NEAR(force, 2 * 0.8 * 0.6 * 1.0, 1e-12);
}

std::string refusal(const Cloud& cloud, const NeighbourhoodRule& rule = {}) {
  Scene scene = one_body(rubber(), rule);
  scene.bodies[0].closure = 1e-3;
  try {
    build_model(scene, std::span(&cloud, 1));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Closure, NeedsAClosedSurfaceAndOneSupport) {
  const Cloud whole = make_shape(block());
  EXPECT_EQ(refusal(whole), "");
  Cloud bare = whole;
  bare.surface = {};
  EXPECT_THAT(refusal(bare),
              HasSubstr("has closed gradients (closure = 0.001), which need its whole "
                        "surface, but it has no triangles"));
  Cloud open = whole;
  open.surface.groups.clear();  // they name the triangles that are left out here
  open.surface.triangle.pop_back();
  EXPECT_THAT(refusal(open), HasSubstr("but its triangles do not enclose a volume"));
  // A tube without its ends: areas add up to nothing, all the same.
  Cloud tube = whole;
  tube.surface.groups.clear();
  std::erase_if(tube.surface.triangle, [&](const Triangle& t) {
    const auto& x = tube.surface.position;
    const auto on = [&](double z) {
      return std::abs(x[t[0]].z - z) + std::abs(x[t[1]].z - z) + std::abs(x[t[2]].z - z) < 1e-9;
    };
    return on(0.5) || on(-0.5);
  });
  EXPECT_LT(tube.surface.triangle.size(), whole.surface.triangle.size());
  EXPECT_THAT(refusal(tube), HasSubstr("do not enclose a volume"));
  Cloud larger = whole;
  for (Vec3d& x : larger.surface.position) x = 1.2 * x;
  EXPECT_THAT(refusal(larger), HasSubstr("that encloses 0.8294 m^3, and its phyxels have 0.48"));
  Cloud inside_out = whole;
  for (Triangle& t : inside_out.surface.triangle) std::swap(t[0], t[1]);
  EXPECT_THAT(refusal(inside_out), HasSubstr("face inward"));
  NeighbourhoodRule adaptive;
  adaptive.support = NeighbourhoodRule::Support::adaptive;
  EXPECT_THAT(refusal(whole, adaptive), HasSubstr("has closed gradients (0.001), which needs "
                                                  "symmetric lists"));
}

/// A sheet of one layer has no moments across it, nor area to hold there.
TEST(Closure, ClosesASheetOfOneLayer) {
  ShapeRequest sheet = block();
  sheet.placement = ShapeRequest::Placement::cells;
  sheet.size = {1, 1, 0.1};
  sheet.jitter = 0;  // in one plane
  const Model model = model_of_cloud(make_shape(sheet), 1e-6);
  ASSERT_EQ(model.degenerate.coplanar.size(), static_cast<std::size_t>(model.size()));
  // Sums close in the plane of the sheet, which is all that it has moments in.
  double largest = 0;
  for (Index i = 0; i < model.size(); ++i) largest = std::max(largest, norm(model.closing[i]));
  EXPECT_GT(largest, 0);  // something was closed
  for (const Vec3d& closing : model.closing) {
    EXPECT_TRUE(std::isfinite(norm(closing)));
    // Nothing to hold across the sheet; the search ends with a rounding error below its 1e-6.
    EXPECT_LT(std::abs(closing.z), 1e-7 * largest);
  }
  for (const std::string& warning : model.warnings) {
    EXPECT_THAT(warning, ::testing::Not(HasSubstr("are closed to")));  // so far as was asked
  }
}

/// Less than rounding cannot be: said, not hidden.
TEST(Closure, SaysWhereSumsStayOpen) {
  ShapeRequest small = block();
  small.size = {0.2, 0.2, 0.3};
  const Model model = model_of_cloud(make_shape(small), 1e-18);
  ASSERT_FALSE(model.warnings.empty());
  EXPECT_THAT(model.warnings, ::testing::Contains(HasSubstr("are closed to")));
}

}  // namespace
}  // namespace phyxel
