/// Names that a user types, of which only some are known.
#pragma once

#include <string>
#include <vector>

namespace phyxel::app {

/// Checks that all names are known.
/// @param what option or noun before the name in the message, e.g. "--table"
/// @throws InputError with the first unknown name, a similar known one, and all known ones
void check_known(const char* what, const std::vector<std::string>& names,
                 const std::vector<std::string>& known);

}  // namespace phyxel::app
