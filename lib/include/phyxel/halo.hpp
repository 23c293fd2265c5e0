/// The exchange of values between the ranks that own phyxels and those that have them as ghosts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// Values of phyxels in memory: those of phyxel i are `bytes` bytes at base + slot[i] * stride.
struct Records {
  std::byte* base = nullptr;
  std::size_t stride = 0, bytes = 0;
  const Index* slot = nullptr;  ///< Null: phyxel i is in slot i.

  /// Where the values of phyxel i begin.
  std::byte* of(Index i) const {
    return base + static_cast<std::size_t>(slot ? slot[i] : i) * stride;
  }
};

/// What exchanges have cost a rank.
struct Traffic {
  std::int64_t bytes_sent = 0;
  double seconds = 0;  ///< For packing, waiting and unpacking.
};

/// Which phyxels of a share other ranks have as ghosts, and which ghosts of it they own.
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

/// Carries values from the owners of phyxels to those that have them as ghosts. All ranks start and
/// finish the same exchanges, in the same order; one is under way at a time.
class HaloTransport {
 public:
  virtual ~HaloTransport() = default;

  /// Bytes to or from each peer of the plan, in its order.
  using PeerBytes = std::vector<std::span<std::byte>>;

  /// Starts an exchange: packs the values of phyxels that other ranks have as ghosts and sends
  /// them. Until `finish`, the values of ghosts must not be touched; those of other phyxels may.
  virtual void start(const Records& records) = 0;
  /// Starts an exchange of packed values. Neither memory may be touched until `finish`.
  virtual void start(const PeerBytes& outgoing, const PeerBytes& incoming) = 0;
  /// Lets messages under way advance; to be called now and then between `start` and `finish`.
  virtual void progress() = 0;
  /// Waits for the exchange, and stores what has come in the records of ghosts.
  virtual void finish() = 0;

  /// True if `outgoing` and `incoming` may be memory of a GPU.
  virtual bool takes_device_memory() const = 0;
  /// The cost of all exchanges so far.
  virtual Traffic traffic() const = 0;
};

}  // namespace phyxel
