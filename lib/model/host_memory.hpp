/// Whether the host has room.
#pragma once

#include <string>

namespace phyxel {

/// @throws InputError naming `what`, how much its phyxels take, how much there is (in a container:
/// its
///   limit), and how many would do; or if they are more than an index counts.
void require_host_memory(const std::string& what, double phyxels, double bytes_per_phyxel);

}  // namespace phyxel
