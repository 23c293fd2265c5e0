/// The ranks of a test program.
#pragma once

#include "mpi/communicator.hpp"
#include "phyxel/ranks.hpp"

namespace phyxel::test {

const Ranks& all_ranks();
/// What they talk through.
const MpiCommunicator& world();

}  // namespace phyxel::test
