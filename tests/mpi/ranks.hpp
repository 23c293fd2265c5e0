/// The ranks of a test program.
#pragma once

#include "mpi/communicator.hpp"

namespace phyxel::test {

const Communicator& world();

}  // namespace phyxel::test
