/// The files of report/page, which are part of the program.
#pragma once

#include <string_view>

namespace phyxel::app {

/// Of that name; empty if there is none.
std::string_view page_file(std::string_view name);

}  // namespace phyxel::app
