/// Exchanges of values of any kind between ranks.
#pragma once

#include <cstring>
#include <type_traits>
#include <vector>

#include "phyxel/communicator.hpp"

namespace phyxel {

/// Sends values to each rank, and returns those that each has sent to this one. Collective.
template <class T>
std::vector<std::vector<T>> exchanged(const Communicator& ranks,
                                      const std::vector<std::vector<T>>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  std::vector<std::vector<std::byte>> bytes(values.size());
  for (std::size_t r = 0; r < values.size(); ++r) {
    bytes[r].resize(values[r].size() * sizeof(T));
    if (!bytes[r].empty()) std::memcpy(bytes[r].data(), values[r].data(), bytes[r].size());
  }
  const std::vector<std::vector<std::byte>> received = ranks.alltoallv(bytes);
  std::vector<std::vector<T>> all(received.size());
  for (std::size_t r = 0; r < received.size(); ++r) {
    all[r].resize(received[r].size() / sizeof(T));
    if (!all[r].empty()) {
      std::memcpy(static_cast<void*>(all[r].data()), received[r].data(), received[r].size());
    }
  }
  return all;
}

/// Gathers the values of all ranks, by rank. Collective.
template <class T>
std::vector<std::vector<T>> allgathered(const Communicator& ranks, const std::vector<T>& values) {
  return exchanged(ranks, std::vector(static_cast<std::size_t>(ranks.size()), values));
}

}  // namespace phyxel
