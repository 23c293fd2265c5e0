#include <fmt/format.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <numeric>
#include <unordered_map>

#include "mesh/mesh_formats.hpp"
#include "mesh/text_cursor.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

/// Map from coordinates to vertices: STL has no indices, so corners with equal coordinates become
/// one vertex.
class CornerMerger {
 public:
  explicit CornerMerger(std::vector<Vec3d>& position) : position_(position) {}

  Index vertex(Vec3d p) {
    p = p + Vec3d{};  // -0 becomes +0
    const auto [found, is_new] =
        known_.try_emplace({std::bit_cast<std::uint64_t>(p.x), std::bit_cast<std::uint64_t>(p.y),
                            std::bit_cast<std::uint64_t>(p.z)},
                           static_cast<Index>(position_.size()));
    if (is_new) position_.push_back(p);
    return found->second;
  }

 private:
  using Key = std::array<std::uint64_t, 3>;
  struct Hash {
    std::size_t operator()(const Key& key) const {
      std::uint64_t h = 0;
      for (const std::uint64_t k : key) {
        h = (h ^ k) * 0x9e3779b97f4a7c15u;
        h ^= h >> 29;
      }
      return h;
    }
  };
  std::vector<Vec3d>& position_;
  std::unordered_map<Key, Index, Hash> known_;
};

bool acceptable(Vec3d p) {
  return std::abs(p.x) <= largest_coordinate && std::abs(p.y) <= largest_coordinate &&
         std::abs(p.z) <= largest_coordinate;
}

constexpr std::size_t header_bytes = 84;  ///< Title (80) and triangle count (4).
constexpr std::size_t facet_bytes = 50;   ///< Normal (12), corners (36), attribute (2).

std::uint32_t little_endian(const char* bytes) {
  std::uint32_t value = 0;
  for (int k = 3; k >= 0; --k) value = value << 8 | static_cast<unsigned char>(bytes[k]);
  return value;
}

/// Groups of triangles, each of which is a face of its own.
std::map<std::string, std::vector<Index>> one_by_one(const FaceGroups& groups, std::size_t faces) {
  std::vector<std::size_t> first(faces + 1);
  std::iota(first.begin(), first.end(), std::size_t{0});
  return groups.of_triangles(first);
}

Surface parse_binary(std::string_view content, const std::string& name) {
  const std::size_t facets = (content.size() - header_bytes) / facet_bytes;
  Surface surface;
  surface.triangle.reserve(facets);
  CornerMerger merger(surface.position);
  FaceGroups groups;
  for (std::size_t f = 0; f < facets; ++f) {
    const std::size_t at = header_bytes + f * facet_bytes;
    Triangle triangle;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const char* bytes = content.data() + at + 12 + 12 * corner;
      const auto coordinate = [&](int axis) {
        return static_cast<double>(std::bit_cast<float>(little_endian(bytes + 4 * axis)));
      };
      const Vec3d p{coordinate(0), coordinate(1), coordinate(2)};
      if (!acceptable(p)) {
        throw InputError(fmt::format(
            "{}: byte {}: facet {}: the corner ({}, {}, {}) is not made of numbers within +-{:g}",
            name, at, f, p.x, p.y, p.z, largest_coordinate));
      }
      triangle[corner] = merger.vertex(p);
    }
    surface.triangle.push_back(triangle);
    // Programs that colour triangles put a colour there, each in a way of its own.
    const auto* attribute =
        reinterpret_cast<const unsigned char*>(content.data()) + at + facet_bytes - 2;
    const int value = attribute[0] | attribute[1] << 8;
    if (value != 0) groups.add(fmt::format("attribute {}", value), static_cast<Index>(f));
  }
  surface.groups = one_by_one(groups, facets);
  return surface;
}

class AsciiStl {
 public:
  AsciiStl(std::string_view content, const std::string& name) : words_(content), name_(name) {}

  Surface read() {
    CornerMerger merger(surface_.position);
    expect("solid");
    solid_ = named(words_.rest_of_line());
    bool open = true;  // between "solid" and "endsolid"
    for (std::string_view word = words_.word(); !word.empty(); word = words_.word()) {
      if (same(word, "endsolid")) {
        words_.rest_of_line();
        open = false;
      } else if (same(word, "solid")) {
        solid_ = named(words_.rest_of_line());
        open = true;
      } else if (same(word, "facet") && open) {
        read_facet(merger);
      } else {
        fail(open ? "\"facet\" or \"endsolid\" expected" : "\"solid\" expected");
      }
    }
    if (open) fail("the file ends before \"endsolid\": is it truncated?");
    surface_.groups = one_by_one(solids_, surface_.triangle.size());
    return std::move(surface_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}:{}: {}", name_, words_.line(), what));
  }

  /// The name on the rest of a line, without white space around it.
  static std::string named(std::string_view line) {
    const auto first = line.find_first_not_of(" \t\r\n");
    if (first == std::string_view::npos) return {};
    return std::string(line.substr(first, line.find_last_not_of(" \t\r\n") - first + 1));
  }

  static bool same(std::string_view word, std::string_view wanted) {
    if (word.size() != wanted.size()) return false;
    for (std::size_t k = 0; k < word.size(); ++k) {
      const char lower =
          word[k] >= 'A' && word[k] <= 'Z' ? static_cast<char>(word[k] + 32) : word[k];
      if (lower != wanted[k]) return false;
    }
    return true;
  }

  void expect(std::string_view wanted) {
    if (!same(words_.word(), wanted)) fail(fmt::format("\"{}\" expected", wanted));
  }

  void read_facet(CornerMerger& merger) {
    expect("normal");
    for (int k = 0; k < 3; ++k) words_.word();  // the normal is not used
    expect("outer");
    expect("loop");
    Triangle triangle;
    for (Index& corner : triangle) {
      expect("vertex");
      std::array<double, 3> value{};
      for (double& v : value) {
        v = parse_number(words_.word()).value_or(HUGE_VAL);
        if (!(std::abs(v) <= largest_coordinate)) {
          fail(fmt::format("a coordinate is not a number within +-{:g}", largest_coordinate));
        }
      }
      corner = merger.vertex({value[0], value[1], value[2]});
    }
    solids_.add(solid_, static_cast<Index>(surface_.triangle.size()));
    surface_.triangle.push_back(triangle);
    expect("endloop");
    expect("endfacet");
  }

  TextCursor words_;
  const std::string& name_;
  Surface surface_;
  std::string solid_;  // name of the present one
  FaceGroups solids_;
};

}  // namespace

Surface parse_stl(std::string_view content, const std::string& name) {
  // A binary file may start with "solid", too: the file size decides.
  std::size_t promised = 0;
  if (content.size() >= header_bytes) {
    promised = little_endian(content.data() + 80);
    if (content.size() == header_bytes + promised * facet_bytes) return parse_binary(content, name);
  }
  TextCursor words(content);
  std::string first(words.word());
  for (char& c : first) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
  if (first == "solid") return AsciiStl(content, name).read();
  if (content.size() < header_bytes) {
    throw InputError(fmt::format(
        "{}: neither text (which starts with \"solid\") nor binary STL ({} bytes; the header alone "
        "takes {})",
        name, content.size(), header_bytes));
  }
  throw InputError(
      fmt::format("{}: the header promises {} facets, which take {} bytes, but the file has {}",
                  name, promised, header_bytes + promised * facet_bytes, content.size()));
}

}  // namespace phyxel
