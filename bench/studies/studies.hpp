/// Subcommands of phyxel_studies: measurements for developers, behind the pages in docs/.
#pragma once

#include <CLI/CLI.hpp>

namespace phyxel::studies {

void add_accuracy_studies(CLI::App& program);
void add_pictures(CLI::App& program);
void add_setup(CLI::App& program);
void add_neighbour_search(CLI::App& program);
void add_laws(CLI::App& program);
void add_problems(CLI::App& program);

}  // namespace phyxel::studies
