/// Files of glTF 2.0 (ISO/IEC 12113): arrays in one buffer, and JSON that refers to them.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel::app {

/// Containers of glTF: JSON with the buffer in Base64, and the binary one.
enum class GltfContainer : std::uint8_t { json, binary };

/// A glTF file in memory.
class GltfFile {
 public:
  using Json = nlohmann::ordered_json;

  GltfFile();

  /// Adds an array of an attribute of vertices, of a mesh or a morph target.
  /// @param bounds true to state the smallest and largest components, as positions need
  /// @returns the number of its accessor
  std::size_t add_attribute(std::span<const Vec3<float>> values, bool bounds);
  /// Adds the corners of triangles. @returns the number of the accessor
  std::size_t add_triangles(std::span<const std::array<std::uint32_t, 3>> triangles);
  /// Adds the times of keyframes [s], which state their bounds.
  /// @returns the number of the accessor
  std::size_t add_times(std::span<const float> times);
  /// Adds the values of keyframes. @param type of a value: SCALAR, VEC3 or VEC4
  /// @returns the number of the accessor
  std::size_t add_keyframes(std::span<const float> values, const char* type);

  /// Adds an object to a list of the file: nodes, meshes, materials, animations or scenes.
  /// @returns its number in the list
  std::size_t add(const char* list, Json object);
  /// The JSON of the file, to which members can be added.
  Json& json() { return json_; }

  /// The content of the file in a container.
  std::string content(GltfContainer container) const;

 private:
  std::size_t add_view(std::span<const std::byte> bytes, int target);
  std::size_t add_accessor(Json accessor);

  Json json_;
  std::vector<std::byte> buffer_;
};

/// The quaternion (x, y, z, w) of a rotation, with w >= 0.
std::array<double, 4> quaternion_of(const Mat3d& rotation);

}  // namespace phyxel::app
