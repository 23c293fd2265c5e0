/// The paper's three bodies: counts, surfaces, and the quality of their phyxels.
#include "shapes/paper_bodies.hpp"

#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "mesh/winding_number.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/neighbourhood.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/weight.hpp"
#include "phyxel/shapes.hpp"
#include "support/surface_checks.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;

double sum(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0);
}

struct Expected {
  std::string name, region;
  std::size_t phyxels, surfels;
};

class PaperBodies : public ::testing::TestWithParam<Expected> {
 protected:
  /// Each body is made once for all tests.
  static const Cloud& body(const std::string& name) {
    static std::map<std::string, Cloud> made;
    if (!made.contains(name)) made[name] = make_shape({.name = name});
    return made[name];
  }
  const Cloud& cloud_ = body(GetParam().name);
  double spacing_ = std::cbrt(sum(cloud_.volume) / static_cast<double>(cloud_.volume.size()));
};

TEST_P(PaperBodies, HaveThePapersCounts) {
  EXPECT_TRUE(is_paper_shape(GetParam().name));
  EXPECT_EQ(cloud_.position.size(), GetParam().phyxels);
  EXPECT_EQ(cloud_.volume.size(), GetParam().phyxels);
  EXPECT_EQ(cloud_.surface.position.size(), GetParam().surfels);
}

TEST_P(PaperBodies, HaveAClosedSmoothSurfaceOfOnePart) {
  expect_closed_ball(cloud_.surface);
  EXPECT_GT(worst_triangle(cloud_.surface), 0.02);
  for (const Triangle& t : cloud_.surface.triangle) {
    const Surface& s = cloud_.surface;
    const Vec3d area =
        cross(s.position[t[1]] - s.position[t[0]], s.position[t[2]] - s.position[t[0]]);
    // No triangle is turned over against its surroundings.
    EXPECT_GT(dot(area, s.normal[t[0]] + s.normal[t[1]] + s.normal[t[2]]), 0);
  }
}

TEST_P(PaperBodies, AreAMetreTallAboutTheOrigin) {
  double low = 0, high = 0;
  for (const Vec3d& p : cloud_.surface.position) {
    low = std::min(low, p.z);
    high = std::max(high, p.z);
  }
  EXPECT_NEAR(low, -0.5, 0.05);
  EXPECT_NEAR(high, 0.5, 0.05);
}

TEST_P(PaperBodies, AreTheSameOnBothSides) {
  Vec3d moment;
  for (std::size_t i = 0; i < cloud_.position.size(); ++i) {
    moment += cloud_.volume[i] * cloud_.position[i];
  }
  // The form is mirrored in y = 0; its phyxels are not, but share out the same volume.
  EXPECT_NEAR(moment.y / sum(cloud_.volume), 0, 0.1 * spacing_);
}

TEST_P(PaperBodies, ShareTheEnclosedVolume) {
  const double volume = enclosed_volume(cloud_.surface);
  EXPECT_NEAR(sum(cloud_.volume), volume, 1e-9 * volume);  // rounding of 1e5 triangles
  for (const double v : cloud_.volume) {
    EXPECT_GT(v, 0.4 * std::pow(spacing_, 3));
    EXPECT_LT(v, 2.5 * std::pow(spacing_, 3));
  }
}

TEST_P(PaperBodies, HoldTheirPhyxelsInside) {
  const Surface& s = cloud_.surface;
  for (const Vec3d& p : cloud_.position) {
    EXPECT_NEAR(direct_winding_number(s.position, s.triangle, p), 1, 1e-9);
  }
}

TEST_P(PaperBodies, KeepTheirPhyxelsApart) {
  double gap = 1;
  for (std::size_t i = 0; i < cloud_.position.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      gap = std::min(gap, norm(cloud_.position[i] - cloud_.position[j]));
    }
  }
  EXPECT_GT(gap, 0.5 * spacing_);
}

TEST_P(PaperBodies, HaveNoDegenerateNeighbourhood) {
  NeighbourhoodRule short_reach, usual, adaptive;
  short_reach.radius = 1.8 * spacing_;
  adaptive.support = NeighbourhoodRule::Support::adaptive;
  for (const NeighbourhoodRule& rule : {short_reach, usual, adaptive}) {
    const Neighbourhood hood =
        find_neighbours(cloud_.position, mean_spacing(cloud_.position, rule.nearest), rule);
    for (Index i = 0; i < static_cast<Index>(cloud_.position.size()); ++i) {
      const double h = hood.support[i];
      Sym3d moment;
      for (const Index j : hood.neighbours.row(i)) {
        const Vec3d x = cloud_.position[j] - cloud_.position[i];
        moment += moment_term(x, weight_shape(dot(x, x), 1 / (h * h)));
      }
      // A hundredth of the largest eigenvalue in each direction: far from a sheet or a thread.
      EXPECT_EQ(pseudo_inverse(moment, 0.01).rank, 3) << i;
    }
  }
}

TEST_P(PaperBodies, NameARegionToHangThemBy) {
  ASSERT_EQ(cloud_.regions.size(), 1u);
  ASSERT_TRUE(cloud_.regions.contains(GetParam().region));
  const std::vector<Index>& region = cloud_.regions.at(GetParam().region);
  EXPECT_GE(region.size(), 5u);
  EXPECT_LE(region.size(), 20u);
  EXPECT_TRUE(std::is_sorted(region.begin(), region.end()));
  Vec3d low{1, 1, 1}, high{-1, -1, -1};
  for (const Index i : region) {
    const Vec3d p = cloud_.position[i];
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  if (GetParam().region == "mouth") {  // front of the head
    EXPECT_GT(low.x, 0.5);
    EXPECT_GT(low.z, 0.25);
  } else if (GetParam().region == "neck") {  // below the skull
    EXPECT_LT(high.z, -0.3);
  } else {  // the end of the left front leg
    EXPECT_LT(high.z, -0.25);
    EXPECT_GT(low.x, 0.3);
    EXPECT_GT(low.y, 0.3);
  }
}

TEST_P(PaperBodies, AreTheSameEveryTimeOnAnyNumberOfThreads) {
  const int threads = omp_get_max_threads();
  omp_set_num_threads(threads == 1 ? 2 : 1);
  ShapeRequest request{.name = GetParam().name};
  request.seed = 99;  // of the jitter, which they have none of
  const Cloud again = make_shape(request);
  omp_set_num_threads(threads);
  EXPECT_TRUE(again.position == cloud_.position);
  EXPECT_EQ(again.volume, cloud_.volume);
  EXPECT_TRUE(again.surface.position == cloud_.surface.position);
  EXPECT_EQ(again.surface.triangle, cloud_.surface.triangle);
}

/// The x coordinate at which a ray along -x from in front of the face meets the body [m].
double face_at(const ImplicitBody& form, double y, double z) {
  double x = 1;
  while (x > -1 && form.value({x, y, z}) > 0) x -= 1e-4;
  return x;
}

/// Half the largest width of the body at a height [m].
double half_width_at(const ImplicitBody& form, double z, double from_x) {
  double widest = 0;
  for (double x = from_x; x < 0.5; x += 0.01) {
    for (double y = 0; y < 0.5; y += 0.005) {
      if (form.value({x, y, z}) < 0) widest = std::max(widest, y);
    }
  }
  return widest;
}

/// The features of the head, seen from the front.
TEST(AlienHead, HasALargeCraniumASmallChinAndBulgingEyesThatSlant) {
  const ImplicitBody& form = find_paper_body("alien_head")->form;
  const double cranium = half_width_at(form, 0.2, -0.5), chin = half_width_at(form, -0.25, 0.1);
  EXPECT_GT(cranium, 0.3);
  EXPECT_GT(chin, 0.04);
  EXPECT_GT(cranium, 3 * chin);
  for (const double side : {-1, 1}) {
    // From the bridge of the nose outwards: down into a crease, up onto the eye, which stands out
    // by 1 cm or more of the 15 cm that it is wide. On a face without eyes x falls all the way.
    double crease = 1, eye = -1, height_of_eye = 0;
    for (double y = 0.03; y < 0.15; y += 0.005) {
      const double x = face_at(form, side * y, 0);
      if (x < crease) crease = x, eye = x;
      if (x > eye) eye = x, height_of_eye = x - crease;
    }
    EXPECT_LT(crease, face_at(form, 0, 0));
    EXPECT_GT(height_of_eye, 0.01);
    // The upper rim rises outwards: above the inner corner there is forehead, above the outer one
    // still eye, whose socket ends in a crease higher up.
    const auto rim = [&](double y) {
      double lowest = 1, height = 0;
      for (double z = 0; z < 0.2; z += 0.005) {
        // The crease is where the face lies deepest under the line from cheek to forehead.
        const double chord =
            std::lerp(face_at(form, side * y, 0), face_at(form, side * y, 0.2), z / 0.2);
        const double depth = face_at(form, side * y, z) - chord;
        if (depth < lowest) lowest = depth, height = z;
      }
      return height;
    };
    EXPECT_GT(rim(0.21), rim(0.09) + 0.02);
  }
}

INSTANTIATE_TEST_SUITE_P(Paper, PaperBodies,
                         ::testing::Values(Expected{"alien_head", "neck", 238, 16000},
                                           Expected{"horn_bug", "leg", 666, 1460},
                                           Expected{"dino", "mouth", 575, 53504}),
                         [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace phyxel
