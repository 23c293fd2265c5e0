/// The message of a refusal, for tests of wrong input.
#pragma once

#include <string>
#include <utility>

#include "phyxel/error.hpp"

namespace phyxel::testing {

/// Returns the message of the InputError that `work` throws, or "accepted" if it throws none.
template <class Work>
std::string refusal_of(Work&& work) {
  try {
    std::forward<Work>(work)();
  } catch (const InputError& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace phyxel::testing
