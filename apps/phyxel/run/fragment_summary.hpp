/// The fragments of broken bodies in the summary of a run.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "phyxel/fragments.hpp"

namespace phyxel::app {

/// The entry of run.json; null for a run without bodies that may break.
nlohmann::ordered_json json_of(const std::vector<FragmentReading>& fragments);

/// Prints how many fragments there are; nothing for a run without bodies that may break.
void say_fragments(const std::vector<FragmentReading>& fragments);

}  // namespace phyxel::app
