/// Files of glTF, taken apart by the rules of their specification.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <nlohmann/json.hpp>

#include "support/page.hpp"

namespace phyxel::test {

/// A glTF file whose arrays can be read.
struct Gltf {
  nlohmann::json json;
  std::string bytes;  ///< Of its buffer.

  /// The components of an accessor's elements, one after the other.
  template <class T>
  std::vector<T> values(const nlohmann::json& accessor) const {
    const auto& found = json["accessors"][accessor.get<std::size_t>()];
    const auto& view = json["bufferViews"][found["bufferView"].get<std::size_t>()];
    const std::map<std::string, std::size_t> widths = {{"SCALAR", 1}, {"VEC3", 3}, {"VEC4", 4}};
    const std::size_t count =
        found["count"].get<std::size_t>() * widths.at(found["type"].get<std::string>());
    EXPECT_EQ(found["componentType"], (std::is_same_v<T, float> ? 5126 : 5125));
    EXPECT_EQ(view["byteLength"], count * sizeof(T));
    const auto begin = view["byteOffset"].get<std::size_t>();
    EXPECT_EQ(begin % 4, 0u);
    std::vector<T> numbers(count);
    if (begin + count * sizeof(T) > bytes.size()) {
      ADD_FAILURE() << "an accessor ends outside the buffer";
      return numbers;
    }
    std::memcpy(numbers.data(), bytes.data() + begin, count * sizeof(T));
    return numbers;
  }
  /// The numbers of a node whose name is given.
  std::size_t node(const std::string& name) const {
    for (std::size_t k = 0; k < json["nodes"].size(); ++k) {
      if (json["nodes"][k]["name"] == name) return k;
    }
    ADD_FAILURE() << "no node " << name;
    return 0;
  }
  /// The values of the keyframes of a node; empty if the node is not animated.
  std::vector<float> keyframes(std::size_t node, const std::string& path) const {
    if (!json.contains("animations")) return {};
    const auto& animation = json["animations"][0];
    for (const auto& channel : animation["channels"]) {
      if (channel["target"]["node"] != node || channel["target"]["path"] != path) continue;
      const auto& sampler = animation["samplers"][channel["sampler"].get<std::size_t>()];
      EXPECT_EQ(sampler["interpolation"], path == "scale" ? "STEP" : "LINEAR");
      return values<float>(sampler["output"]);
    }
    return {};
  }
  /// The times of the keyframes of the animation [s].
  std::vector<float> times() const {
    return values<float>(json["animations"][0]["samplers"][0]["input"]);
  }
  /// The primitive of a node's mesh.
  const nlohmann::json& primitive(std::size_t node) const {
    const auto mesh = json["nodes"][node]["mesh"].get<std::size_t>();
    EXPECT_EQ(json["meshes"][mesh]["primitives"].size(), 1u);
    return json["meshes"][mesh]["primitives"][0];
  }
  /// An attribute of a body in a frame: that of its mesh plus that of the frame's morph target.
  std::vector<float> morphed(std::size_t node, const std::string& attribute,
                             std::size_t frame) const {
    const auto& part = primitive(node);
    auto numbers = values<float>(part["attributes"][attribute]);
    if (frame == 0) return numbers;
    const auto change = values<float>(part["targets"][frame - 1][attribute]);
    EXPECT_EQ(change.size(), numbers.size());
    for (std::size_t k = 0; k < numbers.size(); ++k) numbers[k] += change[k];
    return numbers;
  }
};

/// Reads a binary glTF file.
inline Gltf read_glb(const std::filesystem::path& file) {
  const std::string content = text_of(file);
  const auto word = [&](std::size_t at) {
    std::uint32_t number = 0;
    if (at + 4 <= content.size()) std::memcpy(&number, content.data() + at, 4);
    return number;
  };
  EXPECT_EQ(content.substr(0, 4), "glTF");
  EXPECT_EQ(word(4), 2u);
  EXPECT_EQ(word(8), content.size());
  EXPECT_EQ(content.substr(16, 4), "JSON");
  EXPECT_EQ(word(12) % 4, 0u);
  Gltf gltf;
  gltf.json = nlohmann::json::parse(content.substr(20, word(12)));
  const std::size_t binary = 20 + word(12);
  EXPECT_EQ(content.substr(binary + 4, 4), std::string("BIN\0", 4));
  gltf.bytes = content.substr(binary + 8);
  EXPECT_EQ(word(binary), gltf.bytes.size());
  EXPECT_EQ(gltf.json["buffers"][0]["byteLength"], gltf.bytes.size());
  EXPECT_EQ(gltf.json["asset"]["version"], "2.0");
  return gltf;
}

}  // namespace phyxel::test
