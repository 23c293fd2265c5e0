/// The ranks of a test program.
#pragma once

#include "mpi/communicator.hpp"
#include "phyxel/ranks.hpp"

namespace phyxel::test {

const Ranks& all_ranks();
/// The communicator of the test program.
const MpiCommunicator& world();

}  // namespace phyxel::test
