/// Named groups of triangles: read from files, regions of clouds, and loaded by tractions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "mesh/mesh_formats.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/error.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/model.hpp"
#include "support/clouds.hpp"
#include "support/folder.hpp"
#include "support/mesh_content.hpp"
#include "support/refusal.hpp"

namespace phyxel {
namespace {

using namespace phyxel::testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::UnorderedElementsAre;

Surface obj(const std::string& text) { return parse_mesh(text, MeshFormat::obj, "cube.obj"); }

/// A cube whose faces x = 0 and x = 1 are "left" and "right", both of the material "metal", and
/// the others "side" of the object "hull".
const std::string grouped_cube = test::cube_vertices +
                                 "o hull\ng side\nf 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\n"
                                 "o\nusemtl metal\ng left end\nf 1 5 7 3\ng right end\nf 2 4 8 6\n";

TEST(Groups, OfObjFilesAreGroupsObjectsAndMaterials) {
  const Surface cube = obj(grouped_cube);
  ASSERT_EQ(cube.triangle.size(), 12u);
  EXPECT_THAT(cube.groups, UnorderedElementsAre(Pair("hull", ElementsAre(0, 1, 2, 3, 4, 5, 6, 7)),
                                                Pair("side", ElementsAre(0, 1, 2, 3, 4, 5, 6, 7)),
                                                Pair("left", ElementsAre(8, 9)),
                                                Pair("right", ElementsAre(10, 11)),
                                                Pair("end", ElementsAre(8, 9, 10, 11)),
                                                Pair("metal", ElementsAre(8, 9, 10, 11))));
  EXPECT_THAT(obj(test::cube_vertices + test::cube_faces).groups, IsEmpty());
  // Names are those of data sets of body files.
  EXPECT_THAT(
      obj(test::cube_vertices + "g a/b .\n" + test::cube_faces).groups,
      UnorderedElementsAre(Pair("a_b", ::testing::SizeIs(12)), Pair("_.", ::testing::SizeIs(12))));
}

TEST(Groups, OfPlyFilesAreColoursOfFaces) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\n"
      "property float z\nelement face 3\nproperty list uchar int vertex_indices\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
  const Surface found = parse_mesh(header + test::ply_cube_vertices +
                                       "4 0 2 3 1 255 0 0\n4 4 5 7 6 0 16 255\n4 0 1 5 4 255 0 0\n",
                                   MeshFormat::ply, "cube.ply");
  EXPECT_THAT(found.groups, UnorderedElementsAre(Pair("#ff0000", ElementsAre(0, 1, 4, 5)),
                                                 Pair("#0010ff", ElementsAre(2, 3))));
}

TEST(Groups, OfStlFilesAreSolidsAndAttributes) {
  const Surface cube = test::unit_cube();
  Surface one = cube, other = cube;
  one.triangle.resize(4);
  other.triangle.erase(other.triangle.begin(), other.triangle.begin() + 4);
  const Surface read =
      parse_mesh(test::ascii_stl(one) + "solid \t lid  \n" +
                     test::ascii_stl(other).substr(std::string("solid a cube\n").size()),
                 MeshFormat::stl, "cube.stl");
  EXPECT_THAT(read.groups,
              UnorderedElementsAre(Pair("a cube", ElementsAre(0, 1, 2, 3)),
                                   Pair("lid", ElementsAre(4, 5, 6, 7, 8, 9, 10, 11))));
  std::string binary = test::binary_stl(cube);
  binary[84 + 50 * 3 - 2] = 31;  // of the third triangle
  EXPECT_THAT(parse_mesh(binary, MeshFormat::stl, "cube.stl").groups,
              ElementsAre(Pair("attribute 31", ElementsAre(2))));
}

/// Shades of a colour are no groups.
TEST(Groups, MoreThanAThousandAreNone) {
  FaceGroups groups;
  std::vector<std::size_t> first{0};
  for (Index f = 0; f < 1500; ++f) {
    groups.add(fmt::format("#{:06x}", f), f);
    first.push_back(first.back() + 1);
  }
  EXPECT_THAT(groups.of_triangles(first), IsEmpty());
}

/// The phyxels of a region are those on its triangles, edges included; inside a body without
/// phyxels on its surface, those within a spacing.
TEST(Groups, AreRegionsOfClouds) {
  const Surface cube = obj(grouped_cube);
  const Cloud cloud = sample_surface(cube, {.phyxels = 1000});
  Index on_left = 0, on_sides = 0;
  for (const Vec3d p : cloud.position) {
    on_left += std::abs(p.x) < 1e-6;
    on_sides += std::min({p.y, 1 - p.y, p.z, 1 - p.z}) < 1e-6;
  }
  EXPECT_GT(on_left, 60);
  EXPECT_EQ(std::ssize(cloud.regions.at("left")), on_left);
  EXPECT_EQ(std::ssize(cloud.regions.at("hull")), on_sides);
  for (const Index i : cloud.regions.at("left")) EXPECT_NEAR(cloud.position[i].x, 0, 1e-6);
  const Cloud inside = sample_surface(cube, {.phyxels = 1000, .on_surface = false});
  for (const Vec3d p : inside.position) on_left -= p.x <= 0.1;
  EXPECT_EQ(std::ssize(inside.regions.at("left")) + on_left, std::ssize(cloud.regions.at("left")));
}

/// A traction on a group is that on the faces that have its direction, and total and torque are
/// those of the face.
TEST(Groups, CarryTractions) {
  const Cloud cloud = sample_surface(obj(grouped_cube), {.phyxels = 1000});
  Scene scene = one_body();
  Selection right, everywhere;
  right.region = "right";
  everywhere.all = true;
  scene.bodies[0].tractions = {{.select = right, .traction = {1, 2, 3}},
                               {.select = everywhere, .traction = {1, 2, 3}, .normal = {1, 0, 0}}};
  const Model model = build_model(scene, std::span(&cloud, 1));
  EXPECT_EQ(model.loads[0].phyxels, model.loads[1].phyxels);
  EXPECT_EQ(model.loads[0].force, model.loads[1].force);
  EXPECT_LT(norm(model.loads[0].total - Vec3d{1, 2, 3}), 1e-12);
  scene.bodies[0].tractions[0].select.region = "rigth";
  EXPECT_THAT(refusal_of([&] { build_model(scene, std::span(&cloud, 1)); }),
              HasSubstr("the surface of body \"body\" has no group \"rigth\" (did you mean "
                        "\"right\"?); it has: end, hull, left, metal, right, side"));
}

class GroupsInFiles : public test::Folder {};

TEST_F(GroupsInFiles, AreKept) {
  const Cloud cloud = sample_surface(obj(grouped_cube), {.phyxels = 300});
  write_body(folder_ / "cube.h5", cloud, false);
  const Cloud read = read_body(folder_ / "cube.h5");
  EXPECT_EQ(read.surface.groups, cloud.surface.groups);
  EXPECT_EQ(read.regions, cloud.regions);
  Cloud wrong = cloud;
  wrong.surface.groups["left"] = {12};
  EXPECT_THAT(refusal_of([&] { write_body(folder_ / "wrong.h5", wrong, false); }),
              HasSubstr("has triangle 12 in group \"left\"; allowed: 0 to 11"));
}

}  // namespace
}  // namespace phyxel
