/// The end of a run that has gone wrong.
#pragma once

#include <string>

#include "phyxel/error.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// Ends a run, on all ranks alike.
[[noreturn]] inline void say_diverged(const Model& model, const std::string& why) {
  if (model.share) throw AgreedError(ExitCode::diverged, why);
  throw DivergedError(why);
}

}  // namespace phyxel
