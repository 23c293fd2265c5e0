#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "mesh/mesh_formats.hpp"
#include "mesh/text_cursor.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

enum class Kind { int8, uint8, int16, uint16, int32, uint32, float32, float64 };

struct Property {
  std::string name;
  bool is_list = false;
  Kind count = Kind::uint8;  ///< Type of a list's length.
  Kind value = Kind::float32;
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

std::size_t bytes_of(Kind kind) {
  switch (kind) {
    case Kind::int8:
    case Kind::uint8:
      return 1;
    case Kind::int16:
    case Kind::uint16:
      return 2;
    case Kind::int32:
    case Kind::uint32:
    case Kind::float32:
      return 4;
    case Kind::float64:
      return 8;
  }
  return 0;
}

std::optional<Kind> kind_named(std::string_view name) {
  constexpr std::pair<std::string_view, Kind> kinds[] = {
      {"char", Kind::int8},      {"int8", Kind::int8},       {"uchar", Kind::uint8},
      {"uint8", Kind::uint8},    {"short", Kind::int16},     {"int16", Kind::int16},
      {"ushort", Kind::uint16},  {"uint16", Kind::uint16},   {"int", Kind::int32},
      {"int32", Kind::int32},    {"uint", Kind::uint32},     {"uint32", Kind::uint32},
      {"float", Kind::float32},  {"float32", Kind::float32}, {"double", Kind::float64},
      {"float64", Kind::float64}};
  for (const auto& [known, kind] : kinds) {
    if (known == name) return kind;
  }
  return std::nullopt;
}

class PlyReader {
 public:
  PlyReader(std::string_view content, const std::string& name)
      : content_(content), name_(name), cursor_(content) {}

  Surface read() {
    read_header();
    for (const Element& element : elements_) {
      check_room(element);
      if (element.name == "vertex") {
        read_vertices(element);
      } else if (element.name == "face") {
        read_faces(element);
      } else {
        skip(element);
      }
    }
    check_end();
    // Faces may come before the vertices, so polygons are triangulated at the end.
    append_polygons(corner_, face_start_, colours_, surface_);
    return std::move(surface_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    if (in_header_ || encoding_ == Encoding::ascii) {
      throw InputError(fmt::format("{}:{}: {}", name_, cursor_.line(), what));
    }
    throw InputError(fmt::format("{}: byte {}: {}", name_, at_, what));
  }

  void read_header() {
    if (cursor_.word() != "ply") fail("a PLY file starts with \"ply\"");
    std::string_view word = cursor_.word();
    for (; word != "end_header"; word = cursor_.word()) {
      if (word.empty()) fail("the header does not end (no \"end_header\")");
      if (word == "comment" || word == "obj_info") {
        cursor_.rest_of_line();
      } else if (word == "format") {
        read_format();
      } else if (word == "element") {
        Element element;
        element.name = cursor_.word();
        const std::string_view count = cursor_.word();
        const auto value = parse_integer(count);
        if (!value || *value < 0) fail("an element needs a name and a count");
        element.count = static_cast<std::size_t>(*value);
        elements_.push_back(std::move(element));
      } else if (word == "property") {
        read_property();
      } else {
        fail("the header knows format, element, property, comment, obj_info and end_header only");
      }
    }
    if (encoding_ == Encoding::none) fail("the header has no format line");
    cursor_.rest_of_line();
    at_ = cursor_.offset();
    for (const Element& element : elements_) {
      if (element.name != "vertex") continue;
      if (n_vertices_ != 0) fail("more than one \"vertex\" element");
      n_vertices_ = element.count;
    }
    if (n_vertices_ > 0x7fffffff) {
      fail(fmt::format("{} vertices; at most 2147483647 are allowed", n_vertices_));
    }
    in_header_ = false;
  }

  void read_format() {
    const std::string_view format = cursor_.word();
    if (format == "ascii") {
      encoding_ = Encoding::ascii;
    } else if (format == "binary_little_endian") {
      encoding_ = Encoding::little;
    } else if (format == "binary_big_endian") {
      encoding_ = Encoding::big;
    } else {
      fail("the format is neither ascii nor binary_little_endian nor binary_big_endian");
    }
    if (cursor_.word() != "1.0") fail("the format's version is not 1.0");
  }

  void read_property() {
    if (elements_.empty()) fail("a property before the first element");
    Property property;
    std::string_view type = cursor_.word();
    if (type == "list") {
      property.is_list = true;
      const auto count = kind_named(cursor_.word());
      if (!count || *count == Kind::float32 || *count == Kind::float64) {
        fail("a list's length needs an integer type");
      }
      property.count = *count;
      type = cursor_.word();
    }
    const auto value = kind_named(type);
    if (!value)
      fail(
          "a property of unknown type (char, uchar, short, ushort, int, uint, float, "
          "double)");
    property.value = *value;
    property.name = cursor_.word();
    elements_.back().properties.push_back(std::move(property));
  }

  /// Refuses a count that the rest of the file cannot hold, before memory is allocated for it.
  void check_room(const Element& element) const {
    std::size_t least = 0;  // bytes of one element whose lists are empty
    for (const Property& p : element.properties) {
      // A value in text takes at least a digit and a space.
      least += encoding_ == Encoding::ascii ? 2 : bytes_of(p.is_list ? p.count : p.value);
    }
    if (least == 0) return;
    const std::size_t left =
        encoding_ == Encoding::ascii ? cursor_.left() + 1 : content_.size() - at_;
    if (element.count > left / least) {
      fail(fmt::format("the header promises {} \"{}\" elements, but the file has room for {}",
                       element.count, printable(element.name), left / least));
    }
  }

  /// Refuses a file with content after its last element: the counts in its header are wrong.
  void check_end() {
    if (encoding_ != Encoding::ascii) cursor_ = TextCursor(content_.substr(at_));
    if (cursor_.word().empty()) return;
    fail("the file goes on after all elements that the header promises");
  }

  template <class T>
  T raw() {
    std::array<char, sizeof(T)> bytes;
    if (content_.size() - at_ < sizeof(T)) fail("the file ends too early");
    std::memcpy(bytes.data(), content_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    const bool swap = (encoding_ == Encoding::big) == (std::endian::native == std::endian::little);
    if (swap) std::reverse(bytes.begin(), bytes.end());
    return std::bit_cast<T>(bytes);
  }

  double scalar(Kind kind) {
    if (encoding_ == Encoding::ascii) {
      const std::string_view word = cursor_.word();
      if (word.empty()) fail("the file ends too early");
      const auto value = parse_number(word);
      if (!value) fail(fmt::format("\"{}\" is not a number", printable(word)));
      return *value;
    }
    switch (kind) {
      case Kind::int8:
        return raw<std::int8_t>();
      case Kind::uint8:
        return raw<std::uint8_t>();
      case Kind::int16:
        return raw<std::int16_t>();
      case Kind::uint16:
        return raw<std::uint16_t>();
      case Kind::int32:
        return raw<std::int32_t>();
      case Kind::uint32:
        return raw<std::uint32_t>();
      case Kind::float32:
        return static_cast<double>(raw<float>());
      case Kind::float64:
        return raw<double>();
    }
    return 0;
  }

  std::size_t list_length(const Property& property) {
    const double length = scalar(property.count);
    const std::size_t size = encoding_ == Encoding::ascii ? 2 : bytes_of(property.value);
    const std::size_t left =
        encoding_ == Encoding::ascii ? cursor_.left() + 1 : content_.size() - at_;
    if (!(length >= 0) || length != std::floor(length) ||
        length > static_cast<double>(left / size)) {
      fail(fmt::format("a list of length {}, but the file has room for {}", length, left / size));
    }
    return static_cast<std::size_t>(length);
  }

  void skip(const Property& property) {
    const std::size_t count = property.is_list ? list_length(property) : 1;
    for (std::size_t k = 0; k < count; ++k) scalar(property.value);
  }

  void skip(const Element& element) {
    if (element.properties.empty()) return;
    for (std::size_t e = 0; e < element.count; ++e) {
      for (const Property& property : element.properties) skip(property);
    }
  }

  void read_vertices(const Element& element) {
    std::array<std::size_t, 3> axis;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::string_view wanted = std::array{"x", "y", "z"}[a];
      axis[a] = element.properties.size();
      for (std::size_t p = 0; p < element.properties.size(); ++p) {
        if (element.properties[p].name == wanted && !element.properties[p].is_list) axis[a] = p;
      }
      if (axis[a] == element.properties.size()) {
        fail(fmt::format("the vertices have no property \"{}\"", wanted));
      }
    }
    for (std::size_t e = 0; e < element.count; ++e) {
      std::array<double, 3> value{};
      for (std::size_t p = 0; p < element.properties.size(); ++p) {
        if (p != axis[0] && p != axis[1] && p != axis[2]) {
          skip(element.properties[p]);
          continue;
        }
        const double v = scalar(element.properties[p].value);
        if (!(std::abs(v) <= largest_coordinate)) {
          fail(fmt::format("vertex {}: the coordinate {} is not a number within +-{:g}", e, v,
                           largest_coordinate));
        }
        for (std::size_t a = 0; a < 3; ++a) {
          if (axis[a] == p) value[a] = v;
        }
      }
      surface_.position.push_back({value[0], value[1], value[2]});
    }
  }

  void read_faces(const Element& element) {
    const Property* corners = nullptr;
    for (const Property& p : element.properties) {
      if (p.is_list && (p.name == "vertex_indices" || p.name == "vertex_index")) corners = &p;
    }
    if (!corners) fail("the faces have no list \"vertex_indices\"");
    for (std::size_t e = 0; e < element.count; ++e) {
      std::array<int, 3> colour{-1, -1, -1};
      for (const Property& property : element.properties) {
        if (const int channel = channel_of(property); channel >= 0) {
          colour[static_cast<std::size_t>(channel)] = static_cast<int>(scalar(property.value));
          continue;
        }
        if (&property != corners) {
          skip(property);
          continue;
        }
        const std::size_t count = list_length(property);
        if (count < 3 || count > largest_polygon) {
          fail(fmt::format("face {} has {} corners; 3 to {} are allowed", e, count,
                           largest_polygon));
        }
        for (std::size_t k = 0; k < count; ++k) {
          const double index = scalar(property.value);
          if (!(index >= 0 && index < static_cast<double>(n_vertices_)) ||
              index != std::floor(index)) {
            fail(fmt::format("face {} names vertex {}, but there are {} (they count from 0)", e,
                             index, n_vertices_));
          }
          corner_.push_back(static_cast<Index>(index));
        }
        face_start_.push_back(corner_.size());
      }
      if (*std::min_element(colour.begin(), colour.end()) < 0) continue;
      colours_.add(fmt::format("#{:02x}{:02x}{:02x}", colour[0], colour[1], colour[2]),
                   static_cast<Index>(e));
    }
  }

  /// The channel of a face's colour that a property is, 0 to 2; -1 if it is none.
  static int channel_of(const Property& property) {
    if (property.is_list || property.value != Kind::uint8) return -1;
    constexpr std::string_view channels[] = {"red", "green", "blue"};
    const auto* const found = std::find(std::begin(channels), std::end(channels), property.name);
    return found == std::end(channels) ? -1 : static_cast<int>(found - std::begin(channels));
  }

  enum class Encoding { none, ascii, little, big };

  std::string_view content_;
  const std::string& name_;
  TextCursor cursor_;   ///< Position in the header and in text data.
  std::size_t at_ = 0;  ///< Position in binary data [bytes].
  bool in_header_ = true;
  Encoding encoding_ = Encoding::none;
  std::vector<Element> elements_;
  std::size_t n_vertices_ = 0;
  Surface surface_;
  std::vector<Index> corner_;
  std::vector<std::size_t> face_start_{0};
  FaceGroups colours_;  ///< "#rrggbb"
};

}  // namespace

Surface parse_ply(std::string_view content, const std::string& name) {
  return PlyReader(content, name).read();
}

}  // namespace phyxel
