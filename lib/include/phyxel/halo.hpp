/// The exchange of values between the ranks that own phyxels and those that have them as ghosts.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// Values of phyxels in memory: those of phyxel i are `bytes` bytes at base + slot[i] * stride.
struct Records {
  std::byte* base = nullptr;
  std::size_t stride = 0, bytes = 0;
  const Index* slot = nullptr;  ///< Slot of each phyxel; null if phyxel i is in slot i - begin.
  /// The phyxels [begin, end) of whole bodies that have values.
  Index begin = 0, end = std::numeric_limits<Index>::max();

  /// The address of the values of phyxel i.
  std::byte* of(Index i) const {
    return base + static_cast<std::size_t>(slot ? slot[i] : i - begin) * stride;
  }
  /// The phyxels of a list of a halo plan that have values.
  std::span<const Index> chosen(const std::vector<Index>& list) const {
    // Lists are in the order of global ids, hence body by body.
    const auto first_from = [&](Index bound) {
      return std::partition_point(list.begin(), list.end(), [&](Index i) { return i < bound; });
    };
    return {first_from(begin), first_from(end)};
  }
};

/// Cost of a rank's exchanges.
struct Traffic {
  std::int64_t bytes_sent = 0;
  double seconds = 0;  ///< Time for packing, waiting and unpacking [s].

  friend Traffic operator-(const Traffic& a, const Traffic& b) {
    return {a.bytes_sent - b.bytes_sent, a.seconds - b.seconds};
  }
};

/// Send and receive lists of a share: the phyxels that are ghosts of other ranks, and the share's
/// ghosts.
struct HaloPlan {
  /// Another rank that this one exchanges values with: if A is a peer of B, then B is one of A.
  struct Peer {
    int rank = 0;
    bool same_host = false;
    /// Phyxels of this rank that are ghosts of the peer, and ghosts of this rank that the peer
    /// owns. Both ranks have them in the order of their global ids.
    std::vector<Index> send, receive;
  };
  std::vector<Peer> peers;  ///< In the order of ranks.
};

/// Transport of values from the owners of phyxels to the ranks that have them as ghosts. All ranks
/// start and finish the same exchanges in the same order, one at a time.
class HaloTransport {
 public:
  virtual ~HaloTransport() = default;

  /// Packed values to or from each peer, in the order of the plan.
  using PeerBytes = std::vector<std::span<std::byte>>;

  /// Starts an exchange: packs the values of phyxels that other ranks have as ghosts and sends
  /// them. Until `finish`, the values of ghosts must not be touched; those of other phyxels may.
  virtual void start(const Records& records) = 0;
  /// Starts an exchange of packed values. Neither memory may be touched until `finish`.
  virtual void start(const PeerBytes& outgoing, const PeerBytes& incoming) = 0;
  /// Lets messages make progress, between `start` and `finish`.
  virtual void progress() = 0;
  /// Waits for the exchange, and stores the received values in the records of ghosts.
  virtual void finish() = 0;

  /// True if `outgoing` and `incoming` may be memory of a GPU.
  virtual bool takes_device_memory() const = 0;
  /// The cost of all exchanges so far.
  virtual Traffic traffic() const = 0;
};

}  // namespace phyxel
