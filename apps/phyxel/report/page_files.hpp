/// The files of report/page, embedded in the program.
#pragma once

#include <string_view>

namespace phyxel::app {

/// The content of the file of that name; empty if there is none.
std::string_view page_file(std::string_view name);

}  // namespace phyxel::app
