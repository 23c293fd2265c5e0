#include "known_names.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "phyxel/error.hpp"

namespace phyxel::app {

void check_known(const char* what, const std::vector<std::string>& names,
                 const std::vector<std::string>& known) {
  for (const std::string& name : names) {
    if (std::find(known.begin(), known.end(), name) != known.end()) continue;
    throw InputError(fmt::format("{} {}: unknown{}; allowed: {}", what, name,
                                 did_you_mean(name, known), fmt::join(known, ", ")));
  }
}

}  // namespace phyxel::app
