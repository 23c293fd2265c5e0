/// The ranks of this program, which all commands see.
#pragma once

#include <cstdint>

#include "mpi/communicator.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/ranks.hpp"

namespace phyxel::app {

/// For main(): who they are. Until then there is one.
void set_ranks(const Ranks& ranks);
const Ranks& all_ranks();
/// What they talk through.
const MpiCommunicator& ranks();

/// @throws AgreedError if it is not the same number on all ranks. Collective.
void require_alike(std::uint64_t value, const char* what);

/// What exchanges have cost the rank that had most. Collective.
Traffic most_traffic(const Backend& backend);

}  // namespace phyxel::app
