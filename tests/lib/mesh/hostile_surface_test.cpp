/// Surfaces with a large box and a small volume: the search for their inside ends after limited
/// work.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "mesh/inside_filling.hpp"
#include "mesh/surface_topology.hpp"
#include "model/assembly.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "support/surfaces.hpp"

namespace phyxel {
namespace {

using ::testing::HasSubstr;

/// A small ball with a spike on each triangle.
Surface star(double core, int levels) {
  Surface s = test::sphere({0, 0, 0}, core, levels);
  std::vector<Triangle> spikes;
  for (const Triangle& t : s.triangle) {
    const auto tip = static_cast<Index>(s.position.size());
    s.position.push_back(normalised(s.position[t[0]] + s.position[t[1]] + s.position[t[2]]));
    for (int k = 0; k < 3; ++k) spikes.push_back({t[k], t[(k + 1) % 3], tip});
  }
  s.triangle = std::move(spikes);
  test::add_normals(s);
  return s;
}

/// Two wavy sheets of n x n squares a distance apart, with a rim.
Surface wavy_sheet(Index n, double thickness) {
  Surface s;
  const auto vertex = [&](Index side, Index i, Index j) {
    return side * (n + 1) * (n + 1) + i * (n + 1) + j;
  };
  for (Index side = 0; side < 2; ++side) {
    for (Index i = 0; i <= n; ++i) {
      for (Index j = 0; j <= n; ++j) {
        const double x = double(i) / n, y = double(j) / n;
        s.position.push_back(
            {x, y, 0.05 * std::sin(9 * x) * std::cos(7 * y) + double(side) * thickness});
      }
    }
  }
  const auto square = [&](Index a, Index b, Index c, Index d) {
    s.triangle.push_back({a, b, c});
    s.triangle.push_back({a, c, d});
  };
  for (Index i = 0; i < n; ++i) {
    for (Index j = 0; j < n; ++j) {
      square(vertex(0, i, j), vertex(0, i, j + 1), vertex(0, i + 1, j + 1), vertex(0, i + 1, j));
      square(vertex(1, i, j), vertex(1, i + 1, j), vertex(1, i + 1, j + 1), vertex(1, i, j + 1));
    }
    square(vertex(0, i, 0), vertex(0, i + 1, 0), vertex(1, i + 1, 0), vertex(1, i, 0));
    square(vertex(0, n, i), vertex(0, n, i + 1), vertex(1, n, i + 1), vertex(1, n, i));
    square(vertex(0, i + 1, n), vertex(0, i, n), vertex(1, i, n), vertex(1, i + 1, n));
    square(vertex(0, 0, i + 1), vertex(0, 0, i), vertex(1, 0, i), vertex(1, 0, i + 1));
  }
  test::add_normals(s);
  return s;
}

/// The surface rotated so that no edge of a box is parallel to an axis.
Surface askew(Surface s) {
  const Mat3d turn = rotation_by({0.7, 0.4, 1.1});
  for (Vec3d& p : s.position) p = turn * p;
  test::add_normals(s);
  return s;
}

Surface plate(double thickness) { return test::box({0, 0, 0}, {1, 1, thickness}); }
Surface needle(double width) { return test::box({0, 0, 0}, {1, width, width}); }
Surface far_apart(double radius) {
  return test::together(test::sphere({0, 0, 0}, radius, 3), test::sphere({1, 1, 1}, radius, 3));
}
/// Two thin tetrahedra that share one pointed corner, one of them inside out.
Surface inside_out_in_part() {
  Surface s;
  s.position = {{0, 0, 0},    {1, 0.2, 0},   {1, -0.2, 0}, {1, 0, 0.3},
                {-1, 0.2, 0}, {-1, -0.2, 0}, {-1, 0, 0.3}};
  s.triangle = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3},
                {0, 5, 4}, {0, 4, 6}, {0, 6, 5}, {4, 5, 6}};
  return s;
}

struct Found {
  InsideFilling filling;
  Offset most = 0;
  std::string refusal;
};

/// The result of a search for 5,000 phyxels with 4 samples each.
Found fill(const Surface& surface) {
  FillingRequest request{.phyxels = 5000, .samples = 20'000, .triangles = surface.triangle.size()};
  const bool closed = connect(surface).closed;
  if (closed) request.volume = enclosed_volume(surface);
  request.defects = inspect_surface(surface).describe();
  Found found;
  found.most = most_filling_work(request);
  try {
    fill_inside(InsideSampler(surface, closed), request, found.filling);
  } catch (const InputError& error) {
    found.refusal = error.what();
  }
  return found;
}

// The volume shows before the first sweep that the surface would need too many samples; a hundredth
// of the limit is then tried, in case parts of the volume cancel. A sweep ends at the limit, except
// for the first few hundred cells, each of which may visit all triangles.
TEST(HostileSurface, WithTooLittleInsideIsRefusedAfterLittleWork) {
  const struct {
    const char* name;
    Surface surface;
    const char* figure;
  } cases[] = {
      {"star of 2,048 spikes", star(0.006, 4), " m^3: 2.2"},
      {"plate", plate(1e-9), "1e-09 m^3: 2 m^2 in a box of 1 m"},
      {"plate askew", askew(plate(1e-9)), "1e-09 m^3: 2 m^2 in a box of"},
      {"thicker plate askew", askew(plate(1e-5)), "1e-05 m^3: 2 m^2 in a box of"},
      {"needle", needle(1e-7), "1e-14 m^3: 4e-07 m^2 in a box of 1 m"},
      {"needle askew", askew(needle(1e-7)), "1e-14 m^3: 4e-07 m^2 in a box of"},
      {"far-apart balls", far_apart(1e-6), "8.2e-18 m^3: 2.48e-11 m^2 in a box of 1 m; no sample"},
      {"wavy sheet", wavy_sheet(30, 1e-6), "1e-06 m^3: 2."},
      {"flat plate", plate(0), "no volume: 2 m^2 in a box of 1 m"},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.name);
    const Found found = fill(c.surface);
    EXPECT_THAT(found.refusal, HasSubstr(c.figure));
    EXPECT_THAT(found.refusal,
                HasSubstr("allowed: a closed surface thick enough for 5000 phyxels"));
    const auto triangles = static_cast<Offset>(c.surface.triangle.size());
    EXPECT_LT(found.filling.work, found.most / 100 + 3200 * triangles);
    EXPECT_LE(found.filling.sweeps, 16);
  }
}

// Without the test of edges (`may_touch`), an oblique needle takes a hundred times the work.
TEST(HostileSurface, WithRoomInsideIsFilledWithinTheLimit) {
  const struct {
    const char* name;
    Surface surface;
    double share;  // of the limit, twice to ten times what was seen
  } cases[] = {
      {"needle askew", askew(needle(1e-4)), 0.04},
      {"star of 128 spikes", star(0.03, 2), 0.1},  // with a bend, else 20 times as much
      {"star of 128 spikes askew", askew(star(0.03, 2)), 0.1},
      {"far-apart balls", far_apart(1e-5), 0.01},
      {"plate askew", askew(plate(1e-3)), 0.04},
      {"cube", test::unit_cube(), 0.01},
      {"ball of 8,192 triangles", test::sphere({0, 0, 0}, 1, 5), 0.1},
      {"thin parts, one inside out", inside_out_in_part(), 0.02},
  };
  for (const auto& c : cases) {
    SCOPED_TRACE(c.name);
    const Found found = fill(c.surface);
    EXPECT_EQ(found.refusal, "");
    EXPECT_GE(found.filling.tally.samples, 10'000);  // what the search takes in the end
    EXPECT_LE(found.filling.tally.samples, 26'000);
    EXPECT_LT(double(found.filling.work), c.share * double(found.most));
  }
}

TEST(HostileSurface, IsNamedByItsFigureInTheUsersUnits) {
  Surface large = plate(1e-9);
  for (Vec3d& p : large.position) p = 1000.0 * p;
  try {
    sample_surface(large, {.phyxels = 5000});
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("1 m^3: 2e+06 m^2 in a box of 1e+03 m"));
  }
}

/// A sweep of a closed surface walks from cell to cell and skips cells without triangles; a sweep
/// of an open surface evaluates the winding number nearly everywhere. On a closed surface both find
/// the same points, unless a triangle was wrongly found to miss a cell.
TEST(HostileSurface, HasTheSameInsideByEitherWay) {
  for (const Surface& surface : {askew(needle(0.02)), askew(plate(0.01)), star(0.4, 1),
                                 askew(star(0.3, 2)), askew(wavy_sheet(6, 0.05))}) {
    const double voxel = InsideSampler(surface, true).extent() / 50;
    std::vector<SampleBlock> blocks;
    const auto points = [&](bool closed) {
      InsideSampler(surface, closed).collect({.voxel = voxel, .seed = 5}, blocks);
      std::vector<Vec3d> all;
      for (const SampleBlock& block : blocks) {
        for (std::size_t k = 0; k < block.offset.size(); ++k) all.push_back(block.position(k));
      }
      return all;
    };
    const std::vector<Vec3d> walked = points(true);
    EXPECT_GT(walked.size(), 20u);
    EXPECT_TRUE(walked == points(false));
  }
}

}  // namespace
}  // namespace phyxel
