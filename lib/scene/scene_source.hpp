/// From the keys of a [[body]] that say what it is made from to a source of bodies.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "phyxel/scene.hpp"
#include "scene/scene_table.hpp"

namespace phyxel {

/// Refuses the file of a key unless there is one.
void check_file_exists(const SceneTable& body, const char* kind, const std::filesystem::path& file);

Grading read_grading(const SceneTable& table);

/// The regions of a grading in which phyxels are nearer to each other. @param ratio of the grading
std::vector<FinerRequest> read_finer(const SceneTable& table, double ratio);

BodySource read_source(const SceneTable& body);

/// The name of a body that its scene does not name.
std::string name_of_source(const BodySource& source);

/// Chooses where phyxels lie if a scene says nothing of it: where they are most accurate, but in
/// the middle of cells where the kernel rule tells volumes, which takes phyxels for ones with
/// others all around. @param body with its supports
void choose_placement(const SceneTable& table, BodyRequest& body);

}  // namespace phyxel
