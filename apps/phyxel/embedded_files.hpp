/// Text files of the source tree, embedded in the program (cmake/PhyxelEmbed.cmake).
#pragma once

#include <span>
#include <string_view>

namespace phyxel::app {

struct EmbeddedFile {
  std::string_view name;  ///< Path from the folder that is embedded.
  std::string_view content;
};

/// The files of report/page, of which `phyxel report` makes its page.
std::span<const EmbeddedFile> page_files();
/// The scripts of export/, of which `phyxel export` makes those of a run.
std::span<const EmbeddedFile> export_files();
/// The files of examples/, e.g. "dino/scene.toml", sorted by name.
std::span<const EmbeddedFile> example_files();

}  // namespace phyxel::app
