/// Pieces of scene files, and what is said about them.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "phyxel/error.hpp"
#include "phyxel/scene.hpp"

namespace phyxel {

namespace fs = std::filesystem;

inline std::string text_of(const fs::path& file) {
  std::ifstream in(file);
  std::stringstream text;
  text << in.rdbuf();
  return text.str();
}

inline std::string message_of(const std::string& text, const fs::path& file = "scene.toml") {
  try {
    parse_scene(text, file);
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

/// A folder that is gone after the test.
class SceneFiles : public ::testing::Test {
 protected:
  SceneFiles() {
    folder_ = fs::temp_directory_path() /
              ("phyxel_scene_" + std::to_string(getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~SceneFiles() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  fs::path write(const std::string& name, const std::string& text = "") const {
    fs::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  fs::path folder_;
};

inline const std::string time_section = "[time]\nend = 1\n";  // 2 lines
inline const std::string beam =
    "[[body]]\nshape = 'beam'\nsize = [1, 1, 1]\nspacing = 0.1\n";  // 4 lines
inline const std::string material = "[body.material]\nyoung = 1e5\npoisson = 0.3\ndensity = 1000\n";
inline const std::string dino = "[[body]]\nshape = 'dino'\n" + material;  // 6 lines

}  // namespace phyxel
