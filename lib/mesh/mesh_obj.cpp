#define TINYOBJLOADER_USE_DOUBLE
#include <fmt/format.h>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "mesh/mesh_formats.hpp"
#include "mesh/text_cursor.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

/// Keywords of the OBJ format. A line that starts with another word is an error.
constexpr std::string_view keywords[] = {
    "v",      "vt",     "vn",       "vp",       "vw",         "f",         "fo",
    "l",      "p",      "o",        "g",        "s",          "t",         "mg",
    "usemtl", "mtllib", "usemap",   "maplib",   "cstype",     "deg",       "bmat",
    "step",   "curv",   "curv2",    "surf",     "parm",       "trim",      "hole",
    "scrv",   "sp",     "end",      "con",      "bevel",      "lod",       "ctech",
    "stech",  "call",   "c_interp", "d_interp", "shadow_obj", "trace_obj", "csh"};

/// Validated input for tinyobjloader, which accepts malformed numbers and indices and returns no
/// line numbers. Each line is checked first, and only vertices and faces with absolute indices are
/// passed on. Coordinates are kept as parsed here: tinyobjloader rounds the last digit wrongly.
struct CheckedText {
  std::string text;
  std::vector<Vec3d> position;
  FaceGroups groups;  ///< Of `g`, `o` and `usemtl`.
};

class LineCheck {
 public:
  LineCheck(std::string_view content, const std::string& name) : content_(content), name_(name) {}

  CheckedText run() {
    std::size_t line = 0;
    for (std::size_t at = 0; at < content_.size();) {
      line_ = ++line;
      std::string joined;
      std::string_view text = next_line(at);
      while (!text.empty() && text.back() == '\\' && at < content_.size()) {  // continued
        if (joined.empty()) joined = text;
        joined.back() = ' ';
        joined += next_line(at);
        text = joined;
        ++line;
      }
      check(text);
    }
    // A face may name a vertex of a later line, so the largest index is checked at the end.
    if (greatest_ > checked_.position.size()) {
      line_ = greatest_line_;
      fail(fmt::format("a corner names vertex {}, but there are {}", greatest_,
                       checked_.position.size()));
    }
    return std::move(checked_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw InputError(fmt::format("{}:{}: {}", name_, line_, what));
  }

  std::string_view next_line(std::size_t& at) const {
    const std::size_t end = std::min(content_.find('\n', at), content_.size());
    std::string_view text = content_.substr(at, end - at);
    at = end + 1;
    if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
    return text;
  }

  void check(std::string_view text) {
    TextCursor words(text);
    const std::string_view keyword = words.word();
    if (keyword.empty() || keyword.front() == '#') return;
    if (keyword == "v") return check_vertex(words);
    if (keyword == "f") return check_face(words);
    if (keyword == "g") return read_names(words, groups_);
    if (keyword == "o") return read_names(words, object_);
    if (keyword == "usemtl") return read_names(words, material_);
    if (std::ranges::find(keywords, keyword) == std::end(keywords)) {
      fail(fmt::format("\"{}\" is not a keyword of the OBJ format", printable(keyword)));
    }
  }

  static void read_names(TextCursor& words, std::vector<std::string>& names) {
    names.clear();
    for (std::string_view word = words.word(); !word.empty(); word = words.word()) {
      names.emplace_back(word);
    }
  }

  void check_vertex(TextCursor& words) {
    double place[3];
    for (int axis = 0; axis < 3; ++axis) {
      const std::string_view word = words.word();
      if (word.empty()) fail(fmt::format("a vertex needs three coordinates, here are {}", axis));
      const auto value = parse_number(word);
      if (!value || !(std::abs(*value) <= largest_coordinate)) {
        fail(fmt::format("the coordinate \"{}\" is not a number within +-{:g}", printable(word),
                         largest_coordinate));
      }
      place[axis] = *value;
    }
    checked_.text += "v 0 0 0\n";
    checked_.position.push_back({place[0], place[1], place[2]});
  }

  void check_face(TextCursor& words) {
    checked_.text += 'f';
    std::size_t corners = 0;
    for (std::string_view word = words.word(); !word.empty(); word = words.word()) {
      if (word.front() == '#') break;
      const std::string_view vertex = word.substr(0, word.find('/'));
      const auto index = parse_integer(vertex);
      const auto before = static_cast<long long>(checked_.position.size());
      if (!index || *index == 0) {
        fail(fmt::format("the corner \"{}\" does not name a vertex (they count from 1)",
                         printable(word)));
      }
      if (*index < -before) {
        fail(fmt::format("the corner \"{}\" counts back beyond the {} vertices so far",
                         printable(word), before));
      }
      const auto absolute = static_cast<std::size_t>(*index > 0 ? *index : before + *index + 1);
      if (absolute > greatest_) {
        greatest_ = absolute;
        greatest_line_ = line_;
      }
      // The checked text has absolute indices only: 1 for the first vertex.
      checked_.text += fmt::format(" {}", absolute);
      ++corners;
    }
    if (corners < 3) fail(fmt::format("a face needs three corners, here are {}", corners));
    if (corners > largest_polygon) {
      fail(fmt::format("a face with {} corners; at most {} are allowed", corners, largest_polygon));
    }
    checked_.text += '\n';
    for (const auto* names : {&groups_, &object_, &material_}) {
      for (const std::string& name : *names) checked_.groups.add(name, faces_);
    }
    ++faces_;
  }

  std::string_view content_;
  const std::string& name_;
  std::size_t line_ = 1, greatest_ = 0, greatest_line_ = 0;
  Index faces_ = 0;
  std::vector<std::string> groups_, object_, material_;  // names that the next face has
  CheckedText checked_;
};

struct Polygons {
  std::vector<Index> corner;
  std::vector<std::size_t> face_start{0};
};

}  // namespace

Surface parse_obj(std::string_view content, const std::string& name) {
  CheckedText checked = LineCheck(content, name).run();
  std::istringstream stream(std::move(checked.text));
  Polygons polygons;
  tinyobj::callback_t callback;
  callback.index_cb = [](void* user, tinyobj::index_t* indices, int count) {
    auto& into = *static_cast<Polygons*>(user);
    for (int k = 0; k < count; ++k) into.corner.push_back(indices[k].vertex_index - 1);
    into.face_start.push_back(into.corner.size());
  };
  std::string warning, error;
  if (!tinyobj::LoadObjWithCallback(stream, callback, &polygons, nullptr, &warning, &error)) {
    throw InputError(fmt::format("{}: {}", name, error));
  }

  Surface surface;
  surface.position = std::move(checked.position);
  append_polygons(polygons.corner, polygons.face_start, checked.groups, surface);
  return surface;
}

}  // namespace phyxel
