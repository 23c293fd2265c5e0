/// One rank's share of a model that several ranks step together.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// Values of phyxels in memory: those of phyxel i are `bytes` bytes at base + slot[i] * stride.
struct Records {
  std::byte* base = nullptr;
  std::size_t stride = 0, bytes = 0;
  const Index* slot = nullptr;  ///< Null: phyxel i is in slot i.

  /// Where those of phyxel i begin.
  std::byte* of(Index i) const {
    return base + static_cast<std::size_t>(slot ? slot[i] : i) * stride;
  }
};

/// What exchanges have cost a rank.
struct Traffic {
  std::int64_t bytes_sent = 0;
  double seconds = 0;  ///< For packing, waiting and unpacking.
};

/// Another rank that has ghosts of this one, or of which this one has ghosts: if A is one of B's,
/// then B is one of A's.
struct Peer {
  int rank = 0;
  bool same_host = false;
  /// Phyxels here that it gets, and that come from it; both sides have them in the order of their
  /// numbers in the whole model.
  std::vector<Index> send, receive;
};

/// The other ranks, as one of them sees them. Every function but `peers` and `traffic` is
/// collective: all ranks call it, in the same order.
class Others {
 public:
  virtual ~Others() = default;
  /// Over all ranks, element by element.
  virtual void add(std::span<std::int64_t> values) const = 0;
  /// Over all ranks.
  virtual double largest(double value) const = 0;
  /// Over all ranks.
  virtual double smallest(double value) const = 0;

  /// Which one this is.
  virtual int rank() const = 0;
  virtual int count() const = 0;  ///< Of all ranks.
  /// Those with which this one exchanges.
  virtual const std::vector<Peer>& peers() const = 0;
  /// What each peer is told, by peer, and so what they tell.
  virtual std::vector<std::vector<std::byte>> told(
      const std::vector<std::vector<std::byte>>& words) const = 0;

  /// Whether `outgoing` and `incoming` may be memory of a GPU.
  virtual bool takes_device_memory() const = 0;
  /// Sends `outgoing` of each peer to it, and takes `incoming` from it. Between `begin` and
  /// `finish` neither may be touched, and nothing else may begin.
  using Bytes = std::vector<std::span<std::byte>>;
  /// Sends and takes; `finish` waits for it.
  virtual void begin(const Bytes& outgoing, const Bytes& incoming) const = 0;
  /// Copies values from the ranks that own phyxels to those that have them as ghosts: `begin`
  /// takes them, and `finish` puts them there. Between the two, neither what is sent nor ghosts'
  /// values may be touched, and nothing else may begin.
  virtual void begin(const Records& records) const = 0;
  /// Waits until all values are in place.
  virtual void finish() const = 0;
  /// Of those two, since the start.
  virtual Traffic traffic() const = 0;
};

/// What a share knows of the whole. Of each body it has the phyxels that it owns, then ghosts whose
/// stresses are found here, too, then ghosts whose stresses are not (see `Part`).
struct Share {
  Index whole = 0;            ///< Phyxels of the whole model.
  std::vector<Index> number;  ///< Which of them each phyxel is, shape [n].
  std::vector<char> owned;    ///< Whether each is no ghost, shape [n].
  /// Where each is in the whole model's tiles (`Tiling::place`), shape [n]; empty: no GPU steps
  /// this.
  std::vector<Index> place;
  std::vector<Index> surfel_number;  ///< Which of the whole model's surfels each surfel is.
  /// 1: ghosts' stresses come from their owners. 2: displacements of two rings of ghosts do, and
  /// the inner ring's stresses are found twice.
  int rings = 1;
  std::shared_ptr<const Others> others;
};

}  // namespace phyxel
