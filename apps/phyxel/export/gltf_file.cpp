#include "export/gltf_file.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base64.hpp"
#include "outside_text.hpp"
#include "version.hpp"

namespace phyxel::app {
namespace {

using Json = GltfFile::Json;

// Constants of OpenGL that the format uses.
constexpr int unsigned_int = 5125, real = 5126, vertex_array = 34962, index_array = 34963;
constexpr int no_target = 0;

static_assert(std::endian::native == std::endian::little, "glTF has little-endian arrays");

/// The smallest or largest components of vectors.
template <class Choose>
Json extreme(std::span<const Vec3<float>> values, Choose choose) {
  Vec3<float> found = values.front();
  for (const Vec3<float>& v : values) {
    found = {choose(found.x, v.x), choose(found.y, v.y), choose(found.z, v.z)};
  }
  return Json::array({found.x, found.y, found.z});
}

void append(std::string& text, std::uint32_t number) {
  text.append(reinterpret_cast<const char*>(&number), sizeof number);
}

}  // namespace

GltfFile::GltfFile() {
  json_["asset"] = {{"version", "2.0"}, {"generator", program_version()}};
  json_["scene"] = 0;
}

std::size_t GltfFile::add(const char* list, Json object) {
  json_[list].push_back(std::move(object));
  return json_[list].size() - 1;
}

std::size_t GltfFile::add_view(std::span<const std::byte> bytes, int target) {
  // All arrays consist of words of four bytes, so that each begins where the format allows it.
  Json view{{"buffer", 0}, {"byteOffset", buffer_.size()}, {"byteLength", bytes.size()}};
  if (target != no_target) view["target"] = target;
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  return add("bufferViews", std::move(view));
}

std::size_t GltfFile::add_accessor(Json accessor) { return add("accessors", std::move(accessor)); }

std::size_t GltfFile::add_attribute(std::span<const Vec3<float>> values, bool bounds) {
  Json accessor{{"bufferView", add_view(std::as_bytes(values), vertex_array)},
                {"componentType", real},
                {"count", values.size()},
                {"type", "VEC3"}};
  if (bounds) {
    accessor["min"] = extreme(values, [](float a, float b) { return std::min(a, b); });
    accessor["max"] = extreme(values, [](float a, float b) { return std::max(a, b); });
  }
  return add_accessor(std::move(accessor));
}

std::size_t GltfFile::add_triangles(std::span<const std::array<std::uint32_t, 3>> triangles) {
  return add_accessor({{"bufferView", add_view(std::as_bytes(triangles), index_array)},
                       {"componentType", unsigned_int},
                       {"count", 3 * triangles.size()},
                       {"type", "SCALAR"}});
}

std::size_t GltfFile::add_times(std::span<const float> times) {
  return add_accessor({{"bufferView", add_view(std::as_bytes(times), no_target)},
                       {"componentType", real},
                       {"count", times.size()},
                       {"type", "SCALAR"},
                       {"min", Json::array({times.front()})},
                       {"max", Json::array({times.back()})}});
}

std::size_t GltfFile::add_keyframes(std::span<const float> values, const char* type) {
  const std::string name = type;
  const std::size_t each = name == "VEC4" ? 4 : name == "VEC3" ? 3 : 1;
  return add_accessor({{"bufferView", add_view(std::as_bytes(values), no_target)},
                       {"componentType", real},
                       {"count", values.size() / each},
                       {"type", name}});
}

std::string GltfFile::content(GltfContainer container) const {
  Json json = json_;
  Json& buffer = json["buffers"][0];
  buffer["byteLength"] = buffer_.size();
  if (container == GltfContainer::json) {
    buffer["uri"] = "data:application/octet-stream;base64," + base64(buffer_);
    return json_text(json) + "\n";
  }
  std::string text = json_text(json, -1);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  constexpr std::uint32_t header = 12, chunk = 8;
  std::string file = "glTF";
  file.reserve(header + 2 * chunk + text.size() + buffer_.size());
  append(file, 2);
  append(file, static_cast<std::uint32_t>(header + 2 * chunk + text.size() + buffer_.size()));
  append(file, static_cast<std::uint32_t>(text.size()));
  file += "JSON" + text;
  append(file, static_cast<std::uint32_t>(buffer_.size()));
  file.append("BIN\0", 4);
  file.append(reinterpret_cast<const char*>(buffer_.data()), buffer_.size());
  return file;
}

std::array<double, 4> quaternion_of(const Mat3d& r) {
  // The largest of the four squares is found first, so that no division is by a small number.
  const double squares[] = {1 + r(0, 0) - r(1, 1) - r(2, 2), 1 - r(0, 0) + r(1, 1) - r(2, 2),
                            1 - r(0, 0) - r(1, 1) + r(2, 2), 1 + r(0, 0) + r(1, 1) + r(2, 2)};
  const auto k = std::max_element(std::begin(squares), std::end(squares)) - squares;
  std::array<double, 4> q{};
  if (k == 3) {
    q = {r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1), squares[3]};
  } else {
    const int a = static_cast<int>(k), b = (a + 1) % 3, c = (a + 2) % 3;
    q[static_cast<std::size_t>(a)] = squares[a];
    q[static_cast<std::size_t>(b)] = r(a, b) + r(b, a);
    q[static_cast<std::size_t>(c)] = r(a, c) + r(c, a);
    q[3] = r(c, b) - r(b, c);
  }
  double length = 0;
  for (const double part : q) length += part * part;
  length = std::copysign(std::sqrt(length), q[3]);
  for (double& part : q) part /= length;
  return q;
}

}  // namespace phyxel::app
