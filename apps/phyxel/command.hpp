/// The subcommands of the program, one file each, `<name>.cpp`. Each function adds a subcommand to
/// the parser, whose errors (`phyxel::Error`) main() turns into a message and an exit code.
#pragma once

#include "cli_forward.hpp"

namespace phyxel::app {

void add_run(CLI::App& program);
void add_view(CLI::App& program);
void add_sample(CLI::App& program);
void add_info(CLI::App& program);
void add_export(CLI::App& program);
void add_render(CLI::App& program);
void add_report(CLI::App& program);
void add_bench(CLI::App& program);
void add_accuracy(CLI::App& program);
void add_paper(CLI::App& program);
void add_doctor(CLI::App& program);
void add_examples(CLI::App& program);
void add_completion(CLI::App& program);

}  // namespace phyxel::app
