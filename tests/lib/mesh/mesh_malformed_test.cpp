/// Malformed mesh files and their messages.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "mesh/mesh_formats.hpp"
#include "phyxel/error.hpp"
#include "support/mesh_content.hpp"

namespace phyxel {
namespace {

using namespace test;
using ::testing::HasSubstr;

struct Bad {
  const char* what;
  MeshFormat format;
  std::string content;
  const char* message;  ///< Part of the message, which starts with the file's name.
};

std::vector<Bad> bad_files() {
  using enum MeshFormat;
  const std::string cube = cube_vertices + cube_faces;
  const std::string ply_ascii = ply_header("ascii", 8, "6") + ply_cube_vertices + ply_cube_faces;
  const std::string ply_little = ply_header("binary_little_endian", 3, "1");
  std::string corners;
  for (const float v : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f}) corners += bytes(v);
  const std::string face = bytes(std::uint8_t{3}) + bytes(0) + bytes(1) + bytes(2);
  const std::string stl_cube = binary_stl(test::unit_cube()),
                    stl_text = ascii_stl(test::unit_cube());
  const auto with = [](std::string text, const std::string& old, const std::string& now) {
    return text.replace(text.find(old), old.size(), now);
  };
  const auto patched = [](std::string text, std::size_t at, const std::string& now) {
    return text.replace(at, now.size(), now);
  };
  std::string long_face = "f";
  for (int k = 0; k < 2001; ++k) long_face += fmt::format(" {}", k % 8 + 1);
  const float nan = std::nanf(""), inf = HUGE_VALF;
  return {
      {"empty", obj, "", "m.obj: the file is empty"},
      {"no faces", obj, cube_vertices, "m.obj: no faces (8 vertices)"},
      {"only blanks", obj, "\n \n\t\n", "no faces (0 vertices)"},
      {"another format", obj, stl_text, "m.obj:1: \"solid\" is not a keyword"},
      {"binary", obj, stl_cube, "m.obj:1: \"a"},
      {"zero bytes", obj, std::string(100, '\0'), "m.obj:1: \"????"},
      {"two coordinates", obj, "v 1 2\n", "m.obj:1: a vertex needs three coordinates, here are 2"},
      {"a word for a number", obj, "v 0 0 0\nv 1 x 0\n", "m.obj:2: the coordinate \"x\""},
      {"a number and more", obj, "v 0 0 1.5m\n", "the coordinate \"1.5m\" is not a number"},
      {"a decimal comma", obj, "v 0 0 1,5\n", "the coordinate \"1,5\""},
      {"NaN", obj, "\nv 0 nan 0\n", "m.obj:2: the coordinate \"nan\""},
      {"infinity", obj, "v 0 0 -inf\n", "m.obj:1: the coordinate \"-inf\""},
      {"beyond double", obj, "v 0 0 1e999\n", "the coordinate \"1e999\""},
      {"far too large", obj, "v 0 0 1e31\n", "is not a number within +-1e+30"},
      {"corner zero", obj, cube_vertices + "f 0 1 2\n", "m.obj:9: the corner \"0\" does not name"},
      {"corner too high", obj, cube + "f 1 2 9\n",
       "m.obj:15: a corner names vertex 9, but there are 8"},
      {"corner absurd", obj, cube + "f 1 2 99999999999\n", "names vertex 99999999999"},
      {"corner beyond 64 bits", obj, cube + "f 1 2 99999999999999999999\n",
       "does not name a vertex"},
      {"corner too far back", obj, cube_vertices + "f -1 -2 -9\n",
       "m.obj:9: the corner \"-9\" counts back"},
      {"corner not a number", obj, cube_vertices + "f a b c\n", "the corner \"a\" does not name"},
      {"corner without vertex", obj, cube_vertices + "f /1 /2 /3\n",
       "the corner \"/1\" does not name"},
      {"two corners", obj, cube_vertices + "f 1 2\n",
       "m.obj:9: a face needs three corners, here are 2"},
      {"truncated in a face", obj, cube.substr(0, cube.size() - 5), "a face needs three corners"},
      {"truncated in the vertices", obj, cube_vertices.substr(0, 40) + cube_faces,
       "m.obj:7: a corner names vertex 8, but there are 5"},
      {"huge polygon", obj, cube_vertices + long_face,
       "m.obj:9: a face with 2001 corners; at most 2000"},

      {"empty", ply, "", "m.ply: the file is empty"},
      {"wrong magic", ply, with(ply_ascii, "ply", "plx"),
       "m.ply:1: a PLY file starts with \"ply\""},
      {"magic only", ply, "ply\n", "the header does not end"},
      {"header without end", ply, ply_ascii.substr(0, 60), "m.ply:"},
      {"no format", ply, with(ply_ascii, "format ascii 1.0\n", ""),
       "the header has no format line"},
      {"unknown format", ply, with(ply_ascii, "ascii", "utf-8"), "m.ply:2: the format is neither"},
      {"unknown version", ply, with(ply_ascii, "1.0", "2.0"),
       "m.ply:2: the format's version is not 1.0"},
      {"unknown keyword", ply, with(ply_ascii, "element face", "elements face"),
       "m.ply:7: the header knows"},
      {"count not a number", ply, with(ply_ascii, "face 6", "face six"),
       "m.ply:7: an element needs"},
      {"negative count", ply, with(ply_ascii, "face 6", "face -6"),
       "an element needs a name and a count"},
      {"unknown type", ply, with(ply_ascii, "float y", "real y"),
       "m.ply:5: a property of unknown type"},
      {"length not whole", ply, with(ply_ascii, "list uchar", "list float"),
       "a list's length needs an integer"},
      {"property too early", ply, "ply\nformat ascii 1.0\nproperty int a\n",
       "a property before the first element"},
      {"two vertex elements", ply,
       with(ply_ascii, "element face", "element vertex 8\nelement face"),
       "more than one \"vertex\""},
      {"no y", ply, with(ply_ascii, "float y", "float w"), "the vertices have no property \"y\""},
      {"no corners", ply, with(ply_ascii, "vertex_indices", "colours"), "the faces have no list"},
      {"no faces", ply, ply_header("ascii", 8, "0") + ply_cube_vertices,
       "m.ply: no faces (8 vertices)"},
      {"absurd vertex count", ply, with(ply_ascii, "vertex 8", "vertex 4000000000"),
       "at most 2147483647"},
      {"count without room", ply, with(ply_ascii, "face 6", "face 60000"),
       "promises 60000 \"face\" elements"},
      {"count beyond 64 bits", ply, with(ply_ascii, "face 6", "face 99999999999999999999"),
       "a name and a count"},
      {"one vertex too few", ply, with(ply_ascii, "vertex 8", "vertex 7"),
       "m.ply:17: face 0 has 1 corners"},
      {"one face too many", ply, with(ply_ascii, "face 6", "face 7"), "the file ends too early"},
      {"one face too few", ply, with(ply_ascii, "face 6", "face 5"),
       "m.ply:23: the file goes on after"},
      {"truncated", ply, ply_ascii.substr(0, ply_ascii.size() - 4),
       "m.ply:23: a list of length 4, but the file has room for 3"},
      {"a word for a number", ply, with(ply_ascii, "0 1 1\n1", "0 one 1\n1"),
       "m.ply:16: \"one\" is not a number"},
      {"NaN", ply, with(ply_ascii, "0 1 1\n1", "0 nan 1\n1"),
       "m.ply:16: vertex 6: the coordinate nan"},
      {"corner too high", ply, with(ply_ascii, "4 1 3 7 5", "4 1 3 8 5"),
       "m.ply:23: face 5 names vertex 8, but there are 8"},
      {"corner negative", ply, with(ply_ascii, "4 1 3 7 5", "4 1 3 -1 5"),
       "face 5 names vertex -1"},
      {"corner not whole", ply, with(ply_ascii, "4 1 3 7 5", "4 1 3 1.5 5"),
       "face 5 names vertex 1.5"},
      {"two corners", ply, with(ply_ascii, "4 1 3 7 5", "2 1 3"),
       "face 5 has 2 corners; 3 to 2000"},
      {"long polygon", ply, with(ply_ascii, "4 1 3 7 5", "4000 1 3 7 5"), "a list of length 4000"},
      {"negative length", ply, with(ply_ascii, "4 1 3 7 5", "-4 1 3 7 5"), "a list of length -4"},
      {"binary without data", ply, ply_little,
       "promises 3 \"vertex\" elements, but the file has room for 0"},
      {"binary truncated", ply, ply_little + corners + face.substr(0, 8), "m.ply: byte "},
      {"binary NaN", ply, ply_little + patched(corners, 12, bytes(nan)) + face,
       "vertex 1: the coordinate nan"},
      {"binary infinity", ply, ply_little + patched(corners, 32, bytes(inf)) + face,
       "vertex 2: the coordinate inf"},
      {"binary corner too high", ply, ply_little + corners + patched(face, 9, bytes(3)),
       "face 0 names vertex 3"},
      {"binary corner negative", ply, ply_little + corners + patched(face, 1, bytes(-1)),
       "face 0 names vertex -1"},
      {"binary list too long", ply, ply_little + corners + patched(face, 0, "\xff"),
       "a list of length 255"},
      {"binary trailing", ply, ply_little + corners + face + face, "goes on after all elements"},
      {"binary in wrong order", ply, ply_header("binary_big_endian", 3, "1") + corners + face,
       "m.ply: byte "},

      {"empty", stl, "", "m.stl: the file is empty"},
      {"too short", stl, "a few bytes",
       "neither text (which starts with \"solid\") nor binary STL (11 bytes"},
      {"header only", stl, stl_cube.substr(0, 83), "(83 bytes"},
      {"no facets", stl, patched(stl_cube.substr(0, 84), 80, bytes(0)),
       "m.stl: no faces (0 vertices)"},
      {"truncated", stl, stl_cube.substr(0, 400),
       "promises 12 facets, which take 684 bytes, but the file has 400"},
      {"trailing", stl, stl_cube + "x",
       "promises 12 facets, which take 684 bytes, but the file has 685"},
      {"count too high", stl, patched(stl_cube, 80, bytes(0xffffffffu)),
       "promises 4294967295 facets"},
      {"count too low", stl, patched(stl_cube, 80, bytes(11)), "promises 11 facets"},
      {"NaN", stl, patched(stl_cube, 84 + 50 * 5 + 12, bytes(nan)),
       "byte 334: facet 5: the corner (nan,"},
      {"infinity", stl, patched(stl_cube, 84 + 44, bytes(inf)), "byte 84: facet 0: the corner"},
      {"far too large", stl, patched(stl_cube, 84 + 44, bytes(1e38f)), "within +-1e+30"},
      {"text without facets", stl, "solid nothing\nendsolid nothing\n", "m.stl: no faces"},
      {"text truncated", stl, stl_text.substr(0, stl_text.size() - 17),
       "m.stl:85: the file ends before \"endsolid\""},
      {"text truncated in a facet", stl, stl_text.substr(0, 200), "m.stl:"},
      {"text NaN", stl, with(stl_text, "vertex 0", "vertex nan"),
       "m.stl:4: a coordinate is not a number"},
      {"text two corners", stl, with(stl_text, "   vertex 0 0 0.000000e+00\n", ""),
       "\"vertex\" expected"},
      {"text four corners", stl, with(stl_text, "  endloop", "   vertex 0 0 0\n  endloop"),
       "m.stl:7: \"endloop\" expected"},
      {"text with a stray word", stl, with(stl_text, " facet", " face"),
       "m.stl:2: \"facet\" or \"endsolid\" expected"},
      {"text after the end", stl, stl_text + "facet normal", "m.stl:87: \"solid\" expected"},
      {"another format", stl, cube + cube, "facets, which take"},
  };
}

TEST(Mesh, EveryMalformedFileIsRefusedWithItsPlace) {
  const std::vector<Bad> table = bad_files();
  EXPECT_GE(table.size(), 40u);
  const char* names[] = {"m.obj", "m.ply", "m.stl"};
  for (const Bad& bad : table) {
    const std::string name = names[static_cast<int>(bad.format)];
    SCOPED_TRACE(name + ", " + bad.what);
    try {
      parse_mesh(bad.content, bad.format, name);
      ADD_FAILURE() << "was read without complaint";
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(bad.message));
      EXPECT_EQ(std::string(error.what()).rfind(name, 0), 0u) << error.what();
    }
  }
}

TEST(Mesh, EveryTruncationIsRefusedOrStillAMesh) {
  const std::string contents[] = {cube_vertices + cube_faces,
                                  ply_header("ascii", 8, "6") + ply_cube_vertices + ply_cube_faces,
                                  binary_stl(test::unit_cube()), ascii_stl(test::unit_cube())};
  const MeshFormat formats[] = {MeshFormat::obj, MeshFormat::ply, MeshFormat::stl, MeshFormat::stl};
  for (int f = 0; f < 4; ++f) {
    for (std::size_t size = 0; size < contents[f].size(); ++size) {
      try {
        const Surface s = parse_mesh(contents[f].substr(0, size), formats[f], "m");
        // Text formats can lose a last line, or the last blank, unseen; counted ones cannot.
        EXPECT_TRUE(f == 0 || size + 10 >= contents[f].size()) << f << ", " << size << " bytes";
        for (const Triangle& t : s.triangle) {
          for (const Index corner : t) EXPECT_LT(corner, static_cast<Index>(s.position.size()));
        }
      } catch (const InputError&) {
      }
    }
  }
}

}  // namespace
}  // namespace phyxel
