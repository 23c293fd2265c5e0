/// The ranks of this program.
#pragma once

#include <cstdint>

#include "mpi/communicator.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/ranks.hpp"

namespace phyxel::app {

/// Sets the ranks, called by main(). Before, there is one rank.
void set_ranks(const Ranks& ranks);
const Ranks& all_ranks();
/// The communicator of the ranks.
const MpiCommunicator& ranks();

/// Checks that a number is equal on all ranks. Collective. @throws AgreedError naming `what`
void require_alike(std::uint64_t value, const char* what);

/// The traffic of the rank that had most. Collective.
Traffic most_traffic(const Backend& backend);

}  // namespace phyxel::app
