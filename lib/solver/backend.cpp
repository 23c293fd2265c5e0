#include "phyxel/backend.hpp"

#include "phyxel/error.hpp"

namespace phyxel {

void Backend::fit_residuals(std::vector<double>&) {
  throw InputError(name() + ": no hourglass control here; allowed is hourglass = 0");
}

}  // namespace phyxel
