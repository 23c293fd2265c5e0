/// Clouds, surfaces, points and surveys of a caller are checked before they are used.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"
#include "support/clouds.hpp"
#include "support/refusal.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::HasSubstr;

const double nan_value = std::nan("");

/// 27 phyxels with a surface and a region.
Cloud whole_cloud() {
  Cloud cloud = lattice(3, 3, 3, 0.1);
  cloud.surface.position = {{0, 0, 0}, {0.3, 0, 0}, {0, 0.3, 0}, {0, 0, 0.3}};
  cloud.surface.normal.assign(4, {0, 0, 1});
  cloud.surface.triangle = {{0, 2, 1}, {0, 1, 3}};
  cloud.regions["end"] = {3, 5};
  return cloud;
}

TEST(CloudCheck, RefusesSurfacesAndRegionsThatDoNotFit) {
  // Inclusions sort the phyxels: they must not do so before the cloud is checked.
  for (const bool included : {false, true}) {
    const auto with = [&](auto&& change) {
      Scene scene = one_body();
      if (included) {
        scene.bodies[0].inclusions = {{.select = {.region = "end"}, .material = rubber()}};
      }
      Cloud cloud = whole_cloud();
      change(cloud);
      return refusal_of([&] { model_of(scene, cloud); });
    };
    EXPECT_EQ(with([](Cloud&) {}), "accepted");
    EXPECT_EQ(with([](Cloud& c) { c.surface.normal.pop_back(); }),
              "test.toml:1:1: the cloud of body \"body\" has 3 normals for 4 surfels; allowed: one "
              "for each");
    EXPECT_EQ(with([](Cloud& c) { c.surface.position[1].z = nan_value; }),
              "test.toml:1:1: surfel 1 of body \"body\" lies at [0.3, 0, nan] m; allowed: "
              "coordinates from -1e+12 to 1e+12 m");
    EXPECT_THAT(with([](Cloud& c) { c.surface.position[2].x = 1e13; }),
                HasSubstr("surfel 2 of body \"body\" lies at [1e+13, 0.3, 0] m"));
    EXPECT_THAT(with([](Cloud& c) { c.surface.normal[3].y = INFINITY; }),
                HasSubstr("surfel 3 of body \"body\" has the normal [0, inf, 1]; allowed: finite"));
    EXPECT_EQ(with([](Cloud& c) { c.surface.triangle[1][2] = 4; }),
              "test.toml:1:1: triangle 1 of body \"body\" names surfel 4; allowed: 0 to 3");
    EXPECT_THAT(with([](Cloud& c) { c.surface.triangle[0][0] = -1; }),
                HasSubstr("triangle 0 of body \"body\" names surfel -1"));
    EXPECT_THAT(with([](Cloud& c) {
                  c.surface.position.clear();
                  c.surface.normal.clear();
                }),
                HasSubstr("allowed: no triangle, as there are none"));
    EXPECT_EQ(with([](Cloud& c) { c.regions["end"].back() = 27; }),
              "test.toml:1:1: the cloud of body \"body\" has phyxel 27 in region \"end\"; allowed: "
              "0 to 26");
    EXPECT_THAT(with([](Cloud& c) { c.regions["end"].front() = -1; }), HasSubstr("phyxel -1"));
    EXPECT_THAT(with([](Cloud& c) {
                  c.regions["end"] = {5, 3};
                }),
                HasSubstr("phyxel 3 after phyxel 5 in region \"end\"; allowed: ascending"));
    EXPECT_THAT(with([](Cloud& c) { c.regions["end"] = {5, 5}; }), HasSubstr("each once"));
    EXPECT_THAT(with([](Cloud& c) { c.volume.resize(3); }), HasSubstr("3 volumes for 27"));
    EXPECT_THAT(with([](Cloud& c) { c.spacing.assign(2, 0.1); }), HasSubstr("2 spacings for 27"));
    EXPECT_THAT(with([](Cloud& c) {
                  c.spacing.assign(27, 0.1);
                  c.spacing[4] = 0;
                }),
                HasSubstr("phyxel 4 of body \"body\" has a spacing of 0 m; allowed: > 0"));
    EXPECT_THAT(with([](Cloud& c) { c.position.clear(); }), HasSubstr("has no phyxel"));
  }
}

TEST(CloudCheck, RefusesOrdersThatAreNoPermutation) {
  const auto with = [](auto&& change) {
    Cloud cloud = whole_cloud();
    std::vector<Index> order;
    for (Index i = 26; i >= 0; --i) order.push_back(i);
    change(cloud, order);
    return refusal_of([&] { reorder(cloud, order); });
  };
  using Order = std::vector<Index>;
  EXPECT_EQ(with([](Cloud&, Order&) {}), "accepted");
  EXPECT_EQ(with([](Cloud&, Order& o) { o.pop_back(); }),
            "the cloud has 27 phyxels for an order of 26; allowed: as many");
  EXPECT_EQ(with([](Cloud&, Order& o) { o[3] = 27; }),
            "the cloud has phyxel 27 at place 3 of an order; allowed: 0 to 26, each once");
  EXPECT_THAT(with([](Cloud&, Order& o) { o[3] = -1; }), HasSubstr("phyxel -1 at place 3"));
  EXPECT_THAT(with([](Cloud&, Order& o) { o[3] = o[2]; }), HasSubstr("phyxel 24 at place 3"));
  EXPECT_THAT(with([](Cloud& c, Order&) { c.volume.pop_back(); }), HasSubstr("26 volumes"));
  EXPECT_THAT(with([](Cloud& c, Order&) { c.regions["end"] = {30}; }), HasSubstr("phyxel 30"));
}

TEST(CloudCheck, RefusesTrianglesOfNoVertex) {
  Surface surface = whole_cloud().surface;
  surface.triangle[1][0] = 9;
  const std::string words = "triangle 1 of the surface names vertex 9; allowed: 0 to 3";
  EXPECT_EQ(refusal_of([&] { vertex_normals(surface.position, surface.triangle); }), words);
  EXPECT_EQ(refusal_of([&] { enclosed_volume(surface); }), words);
  EXPECT_EQ(refusal_of([&] { inspect_surface(surface); }), words);
  EXPECT_EQ(refusal_of([&] { sample_surface(surface, {.phyxels = 10}); }), words);
  surface = whole_cloud().surface;
  surface.position[2].y = nan_value;
  EXPECT_EQ(refusal_of([&] { inspect_surface(surface); }),
            "vertex 2 of the surface is at [0, nan, 0]; allowed: finite numbers");
}

TEST(CloudCheck, RefusesPointsAndLengthsThatDoNotFit) {
  std::vector<Vec3d> points = lattice(3, 3, 3, 0.1).position;
  std::vector<double> lengths(27, 0.2);
  const auto refusals = [&] {
    return std::vector<std::string>{refusal_of([&] { mean_spacing(points, 10); }),
                                    refusal_of([&] { find_neighbours(points, lengths, {}); }),
                                    refusal_of([&] { phyxels_near(points, points, lengths); })};
  };
  using Words = std::vector<std::string>;
  EXPECT_EQ(refusals(), (Words{"accepted", "accepted", "accepted"}));
  EXPECT_EQ(refusal_of([&] { mean_spacing(points, 0); }), "nearest = 0; allowed: >= 1");
  lengths[4] = nan_value;
  EXPECT_EQ(refusals(), (Words{"accepted", "spacing of phyxel 4 is nan m; allowed: >= 0, finite",
                               "support of phyxel 4 is nan m; allowed: >= 0, finite"}));
  lengths.pop_back();
  EXPECT_EQ(refusals()[1], "spacing: 26 values for 27 phyxels; allowed: one for each");
  EXPECT_EQ(refusals()[2], "support: 26 values for 27 phyxels; allowed: one for each");
  points[6].x = INFINITY;
  for (const std::string& words : refusals()) {
    EXPECT_THAT(words, HasSubstr(" 6 is at [inf, 0.25, 0.05] m; allowed: finite numbers"));
  }
  EXPECT_EQ(refusal_of([] {
              transpose(Csr{{0, 1, 2}, {0, 2}}, 2);
            }),
            "index 1 of a pattern is 2; allowed: 0 to 1");
  EXPECT_EQ(refusal_of([] { transpose(Csr{{0, 1, 2}, {0, 2}}, 3); }), "accepted");
}

TEST(CloudCheck, RefusesSurveysThatDoNotFit) {
  const Cloud cloud = whole_cloud();
  const auto with = [&](VolumeRule rule, auto&& change) {
    Scene scene = one_body();
    scene.bodies[0].volume_rule = rule;
    scene.bodies[0].closure = 0;
    return refusal_of([&] {
      build_model(scene, std::span(&cloud, 1),
                  [&](std::span<const Vec3d> position, const NeighbourhoodRule&, bool) {
                    Survey survey;
                    survey.support.assign(position.size(), 0.2);
                    survey.spacing.assign(position.size(), 0.1);
                    survey.kernel_sum.assign(position.size(), 1);
                    change(survey);
                    return survey;
                  });
    });
  };
  const auto geometry = [&](auto&& change) { return with(VolumeRule::geometry, change); };
  const auto kernel = [&](auto&& change) { return with(VolumeRule::kernel, change); };
  EXPECT_EQ(geometry([](Survey& s) { s.spacing.clear(); }), "accepted");  // it is not asked for
  EXPECT_EQ(kernel([](Survey&) {}), "accepted");
  EXPECT_EQ(geometry([](Survey& s) { s.support.pop_back(); }),
            "test.toml:1:1: body \"body\": survey of a device: support has 26 values for 27 "
            "phyxels; allowed: one for each");
  EXPECT_THAT(geometry([](Survey& s) { s.support[3] = nan_value; }),
              HasSubstr("support of phyxel 3 is nan; allowed: >= 0, finite"));
  EXPECT_THAT(kernel([](Survey& s) { s.spacing.clear(); }), HasSubstr("spacing has 0 values"));
  EXPECT_THAT(kernel([](Survey& s) { s.kernel_sum[26] = -1; }),
              HasSubstr("kernel_sum of phyxel 26 is -1"));
  EXPECT_THAT(geometry([](Survey& s) { s.degenerate.coplanar = {27}; }),
              HasSubstr("phyxel 27 is degenerate; allowed: 0 to 26"));
}

}  // namespace
}  // namespace phyxel
