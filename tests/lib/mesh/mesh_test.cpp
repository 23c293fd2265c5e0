/// Readers of surface meshes.
#include "phyxel/mesh.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "mesh/mesh_formats.hpp"
#include "phyxel/error.hpp"
#include "support/folder.hpp"
#include "support/mesh_content.hpp"

namespace phyxel {
namespace {

using namespace test;
using ::testing::HasSubstr;
namespace fs = std::filesystem;

Surface obj(const std::string& text) { return parse_mesh(text, MeshFormat::obj, "m.obj"); }
Surface ply(const std::string& text) { return parse_mesh(text, MeshFormat::ply, "m.ply"); }
Surface stl(const std::string& text) { return parse_mesh(text, MeshFormat::stl, "m.stl"); }

void expect_unit_cube(const Surface& s) {
  EXPECT_EQ(s.position.size(), 8u);
  EXPECT_EQ(s.triangle.size(), 12u);
  ASSERT_EQ(s.normal.size(), s.position.size());
  EXPECT_DOUBLE_EQ(enclosed_volume(s), 1.0);
  const SurfaceDefects defects = inspect_surface(s);
  EXPECT_TRUE(defects.clean()) << defects.describe();
  EXPECT_EQ(defects.parts, 1);
  for (std::size_t v = 0; v < s.position.size(); ++v) {
    EXPECT_NEAR(norm(s.normal[v]), 1.0, 1e-15);  // rounding
    EXPECT_GT(dot(s.normal[v], s.position[v] - Vec3d{0.5, 0.5, 0.5}), 0.0);
  }
}

TEST(Mesh, BinaryStlCornersAreMerged) { expect_unit_cube(stl(binary_stl(test::unit_cube()))); }

TEST(Mesh, BinaryStlMayStartWithSolid) {
  expect_unit_cube(stl(binary_stl(test::unit_cube(), "solid facet normal")));
}

TEST(Mesh, AsciiStlCornersAreMerged) { expect_unit_cube(stl(ascii_stl(test::unit_cube()))); }

TEST(Mesh, AsciiStlMayHoldSeveralSolidsInAnyCase) {
  std::string text = ascii_stl(test::unit_cube()) + ascii_stl(test::box({2, 0, 0}, {4, 1, 1}));
  for (char& c : text) c = static_cast<char>(std::toupper(c));
  const Surface s = stl(text);
  EXPECT_EQ(inspect_surface(s).parts, 2);
  EXPECT_DOUBLE_EQ(enclosed_volume(s), 3.0);
}

TEST(Mesh, StlZerosOfBothSignsAreOnePlace) {
  Surface cube = test::unit_cube();
  cube.position.push_back({-0.0, 0.0, -0.0});
  cube.triangle[0][0] = 8;
  expect_unit_cube(stl(binary_stl(cube)));
}

TEST(Mesh, ObjPolygonsBecomeTriangles) { expect_unit_cube(obj(cube_vertices + cube_faces)); }

TEST(Mesh, ObjIndicesMayCountBackAndCarryTexturesAndNormals) {
  expect_unit_cube(obj("# a comment\nmtllib a.mtl\no cube\ng one two\n" + cube_vertices +
                       "vt 0 0\nvn 0 0 1\nusemtl red\ns off\n"
                       "f -8/1/1 -6/1/1 -5/1/1 -7/1/1\nf 5//1 6//1 8//1 7//1\nf 1/1 2/1 6/1 5/1\n"
                       "g other\nf 3 7 8 4\nf 1 5 7 3 # trailing\nf 2 4 8 6\n"));
}

TEST(Mesh, ObjTakesCarriageReturnsContinuedLinesColoursAndFacesFirst) {
  std::string text =
      "f 1 3 \\\n4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
      "v 0 0 0 1 0.5 0.5 0.5\n" +
      cube_vertices.substr(8);
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2) {
    text.replace(at, 1, "\r\n");
  }
  expect_unit_cube(obj(text));
}

/// Coordinates are exact, since a box in a scene may end at the mesh's face.
TEST(Mesh, ObjCoordinatesAreReadExactly) {
  const Surface s = obj("v 0.3 -0.7 0.1\nv 1.1 2.2e-3 -4.7e5\nv 0.88 1e-7 3.3\nf 1 2 3\n");
  EXPECT_EQ(s.position,
            (std::vector<Vec3d>{{0.3, -0.7, 0.1}, {1.1, 2.2e-3, -4.7e5}, {0.88, 1e-7, 3.3}}));
}

TEST(Mesh, ObjVerticesAreTheSurfelsEvenWhereTheyCoincide) {
  // Files repeat a vertex where its texture changes; the count must not change, the hole must
  // close.
  const Surface s = obj(cube_vertices + "v 0 0 0\nf 9 3 4 2\n" + cube_faces.substr(10));
  EXPECT_EQ(s.position.size(), 9u);
  EXPECT_TRUE(inspect_surface(s).clean()) << inspect_surface(s).describe();
}

TEST(Mesh, NonConvexPolygonsAreCutInside) {
  // An L-shaped prism, whose ends are hexagons with a notch: area 3, height 2.
  std::string text;
  for (const int z : {0, 2}) {
    for (const auto* p : {"0 0", "2 0", "2 1", "1 1", "1 2", "0 2"})
      text += fmt::format("v {} {}\n", p, z);
  }
  text += "f 6 5 4 3 2 1\nf 7 8 9 10 11 12\n";
  for (int k = 1; k <= 6; ++k)
    text += fmt::format("f {} {} {} {}\n", k, k % 6 + 1, k % 6 + 7, k + 6);
  const Surface s = obj(text);
  EXPECT_TRUE(inspect_surface(s).clean()) << inspect_surface(s).describe();
  EXPECT_DOUBLE_EQ(enclosed_volume(s), 6.0);
  double area = 0;
  for (const Triangle& t : s.triangle) {
    area +=
        0.5 * norm(cross(s.position[t[1]] - s.position[t[0]], s.position[t[2]] - s.position[t[0]]));
  }
  EXPECT_DOUBLE_EQ(area, 2 * 3 + 8 * 2);  // triangles outside the notch would add to it
}

/// A polygon with a notch keeps its outline and its orientation in each direction of its normal.
TEST(Mesh, PolygonsThatFaceAnyWayKeepTheirSide) {
  // The L of area 3, in the plane of the two axes after `axis`, counter-clockwise seen against it.
  const double corners[][2] = {{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}};
  for (int axis = 0; axis < 3; ++axis) {
    for (const bool back : {false, true}) {
      std::string text, face = "f";
      for (const auto& corner : corners) {
        double p[3] = {};
        p[(axis + 1) % 3] = corner[0];
        p[(axis + 2) % 3] = corner[1];
        text += fmt::format("v {} {} {}\n", p[0], p[1], p[2]);
      }
      for (int k = 0; k < 6; ++k) face += fmt::format(" {}", back ? 6 - k : k + 1);
      const Surface s = obj(text + face + "\n");
      ASSERT_EQ(s.triangle.size(), 4u);
      Vec3d sum;
      double area = 0;
      for (const Triangle& t : s.triangle) {
        const Vec3d a =
            0.5 * cross(s.position[t[1]] - s.position[t[0]], s.position[t[2]] - s.position[t[0]]);
        sum += a;
        area += norm(a);
      }
      const double along = axis == 0 ? sum.x : axis == 1 ? sum.y : sum.z;
      // Small whole numbers and halves: exact. Triangles across the notch would add to the area.
      EXPECT_EQ(along, back ? -3 : 3) << "axis " << axis;
      EXPECT_EQ(area, 3) << "axis " << axis << (back ? ", back" : "");
    }
  }
}

TEST(Mesh, LargePolygonIsCutCompletely) {
  // The base of a cone with a star of 1000 corners.
  std::string text = "v 0 0 1\n", base = "f";
  double area = 0;
  const int n = 1000;
  const auto radius = [](int k) { return k % 2 ? 1.0 : 2.0; };
  for (int k = 0; k < n; ++k) {
    const double angle = 2 * M_PI * k / n;
    text += fmt::format("v {} {} 0\n", radius(k) * std::cos(angle), radius(k) * std::sin(angle));
    base += fmt::format(" {}", n + 1 - k);
    area += 0.5 * radius(k) * radius(k + 1) * std::sin(2 * M_PI / n);
  }
  for (int k = 0; k < n; ++k) text += fmt::format("f 1 {} {}\n", k + 2, (k + 1) % n + 2);
  const Surface s = obj(text + base + "\n");
  EXPECT_EQ(s.triangle.size(), static_cast<std::size_t>(n + n - 2));
  EXPECT_EQ(inspect_surface(s).open_edges, 0);
  EXPECT_NEAR(enclosed_volume(s), area / 3, 1e-10 * area);  // rounding of a thousand terms
}

TEST(Mesh, AsciiPlyPolygonsBecomeTriangles) {
  expect_unit_cube(ply(ply_header("ascii", 8, "6") + ply_cube_vertices + ply_cube_faces));
}

TEST(Mesh, AsciiPlySkipsWhatItDoesNotNeed) {
  std::string text =
      "ply\r\nformat ascii 1.0\r\ncomment element vertex 99\r\nobj_info by hand\r\n"
      "element material 1\r\nproperty list uchar float shine\r\nproperty int kind\r\n"
      "element face 6\r\nproperty uchar red\r\nproperty list int uint vertex_index\r\n"
      "property list uchar float texcoord\r\n"
      "element vertex 8\r\nproperty double z\r\nproperty list uchar int more\r\n"
      "property double y\r\nproperty float nx\r\nproperty double x\r\n"
      "element edge 1\r\nproperty int a\r\nproperty int b\r\nend_header\r\n2 0.5 0.25 7\r\n";
  for (const char* face : {"0 2 3 1", "4 5 7 6", "0 1 5 4", "2 6 7 3", "0 4 6 2", "1 3 7 5"}) {
    text += fmt::format("255 4 {} 2 0.5 0.5\r\n", face);
  }
  for (int k = 0; k < 8; ++k)
    text += fmt::format("{} 1 5 {} 0 {}\r\n", k >> 2 & 1, k >> 1 & 1, k & 1);
  expect_unit_cube(ply(text + "0 1\r\n"));
}

TEST(Mesh, BinaryPlyIsReadInBothByteOrders) {
  for (const bool big : {false, true}) {
    std::string text = fmt::format(
        "ply\nformat binary_{}_endian 1.0\nelement vertex 8\nproperty uchar red\nproperty double "
        "x\n"
        "property float y\nproperty float z\nproperty list ushort short extra\nelement face 6\n"
        "property list uchar uint vertex_indices\nproperty int8 flag\nend_header\n",
        big ? "big" : "little");
    for (int k = 0; k < 8; ++k) {
      text += bytes(std::uint8_t{9}) + bytes(double(k & 1), big) + bytes(float(k >> 1 & 1), big) +
              bytes(float(k >> 2), big) + bytes(std::uint16_t{2}, big) +
              bytes(std::int16_t{-1}, big) + bytes(std::int16_t{300}, big);
    }
    for (const std::array<std::uint32_t, 4> face : {std::array{0u, 2u, 3u, 1u},
                                                    {4u, 5u, 7u, 6u},
                                                    {0u, 1u, 5u, 4u},
                                                    {2u, 6u, 7u, 3u},
                                                    {0u, 4u, 6u, 2u},
                                                    {1u, 3u, 7u, 5u}}) {
      text += bytes(std::uint8_t{4});
      for (const std::uint32_t corner : face) text += bytes(corner, big);
      text += bytes(std::int8_t{-3});
    }
    SCOPED_TRACE(big ? "big endian" : "little endian");
    expect_unit_cube(ply(text));
  }
}

TEST(Mesh, DecimalsAreRead) {
  const Surface s = obj("v 1.5 -2.25e1 +3\nv 0 1 0\nv 0 0 .5\nf 1 2 3\n");
  EXPECT_EQ(s.position[0], (Vec3d{1.5, -22.5, 3}));
  EXPECT_EQ(s.position[2], (Vec3d{0, 0, 0.5}));
}

class MeshFile : public test::Folder {
 protected:
  static std::string message(const fs::path& file) {
    try {
      read_mesh(file);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }
};

TEST_F(MeshFile, ExtensionChoosesTheReaderInAnyCase) {
  expect_unit_cube(read_mesh(write("a.OBJ", cube_vertices + cube_faces)));
  expect_unit_cube(read_mesh(write("a.stl", binary_stl(test::unit_cube()))));
  expect_unit_cube(read_mesh(
      write("a.b.Ply", ply_header("ascii", 8, "6") + ply_cube_vertices + ply_cube_faces)));
}

TEST_F(MeshFile, WhatCannotBeReadIsNamed) {
  EXPECT_EQ(message(folder_ / "none.obj"), (folder_ / "none.obj").string() + ": no such file");
  fs::create_directories(folder_ / "folder.ply");
  EXPECT_THAT(message(folder_ / "folder.ply"), HasSubstr("folder.ply: is a folder"));
  EXPECT_THAT(message(write("a.gltf", "x")), HasSubstr("\".gltf\" is not one of .obj, .ply, .stl"));
  EXPECT_THAT(message(write("obj", "x")), HasSubstr("\"\" is not one of .obj, .ply, .stl"));
  EXPECT_THAT(message(write("empty.stl", "")), HasSubstr("empty.stl: the file is empty"));
  EXPECT_THAT(message("/dev/null/a.obj"), HasSubstr("no such file"));
  fs::create_symlink("/dev/zero", folder_ / "endless.obj");
  EXPECT_THAT(message(folder_ / "endless.obj"), HasSubstr("is a character device"));
  write("huge.stl", "solid");
  fs::resize_file(folder_ / "huge.stl", largest_file + 1);  // a hole in the file, on no disk
  EXPECT_THAT(message(folder_ / "huge.stl"), HasSubstr("2147483649 bytes; at most 2147483648"));
}

TEST_F(MeshFile, AnObjLineMayGoOnOverManyLines) {
  std::string face = "f";
  for (const char* corner : {"1", "3", "2"}) {
    face += " ";
    for (int k = 0; k < 200; ++k) face += "\\\n";  // joined text must not grow by more than a line
    face += corner;
  }
  const std::string text =
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + face + "\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
  const Surface surface = read_mesh(write("chain.obj", text));
  ASSERT_EQ(surface.triangle.size(), 4u);
  EXPECT_NEAR(enclosed_volume(surface), 1.0 / 6, 1e-15);  // rounding of a handful of products
}

TEST_F(MeshFile, AnObjCoordinateIsTheNumberThatWasChecked) {
  // tinyobjloader's own arithmetic makes 0 x infinity of this zero.
  const std::string text =
      "v 0000E0888 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
  EXPECT_EQ(read_mesh(write("zero.obj", text)).position[0].x, 0.0);
}

}  // namespace
}  // namespace phyxel
