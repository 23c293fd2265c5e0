/// The examples that are embedded in the program, and their descriptions.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "embedded_files.hpp"

namespace phyxel::app {

/// An example. Its description is the first comment of its main file: scene.toml, main.cpp, or the
/// script itself.
struct Example {
  enum class Kind { scene, program, script };  ///< A scene, a C++ program or a Python script.

  std::string name;
  Kind kind;
  std::string sentence;                    ///< The first sentence of the description.
  std::vector<const EmbeddedFile*> files;  ///< The main file comes first.

  /// The name of a file in a copy of the example.
  static std::filesystem::path name_in_copy(const EmbeddedFile& file);
  /// The command that runs a copy of the example, or builds it if it is a program.
  /// @param folder folder of the copy
  std::string command(const std::filesystem::path& folder) const;
};

/// The kind as JSON and tables have it: "scene", "c++" or "python".
const char* kind_name(Example::Kind kind);

/// All examples: scenes, programs and scripts, each sorted by name.
const std::vector<Example>& examples();

/// The names of all examples, in the same order.
std::vector<std::string> example_names();

}  // namespace phyxel::app
