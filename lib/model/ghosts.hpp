/// Values of ghosts, the phyxels of a share that other ranks own.
#pragma once

#include <cstddef>
#include <limits>

#include "phyxel/share.hpp"

namespace phyxel {

/// Copies the owners' values to ghosts. Collective.
/// @param values of each phyxel of the share. @param begin,end phyxels [begin, end) of whole
/// bodies, to which the exchange is limited
template <class Values>
void refresh_ghosts(const Share& share, Values& values, Index begin = 0,
                    Index end = std::numeric_limits<Index>::max()) {
  constexpr std::size_t width = sizeof(typename Values::value_type);
  share.transport->start(
      {reinterpret_cast<std::byte*>(values.data() + begin), width, width, nullptr, begin, end});
  share.transport->finish();
}

}  // namespace phyxel
