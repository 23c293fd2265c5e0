/// What resident blocks read: the plan in device memory, and the arrays of a block in shared
/// memory.
#pragma once

#include <type_traits>

#include "phyxel/types.hpp"
#include "solver/packet.cuh"
#include "solver/resident_plan.hpp"

namespace phyxel::cuda {

/// A neighbour of a phyxel: w_ij x_ij and its slot. Whole 16-byte words, with nothing left over.
template <class Real>
struct alignas(16) Pair {
  Vec3<Real> wx;
  std::conditional_t<sizeof(Real) == 4, unsigned, unsigned long long> slot;
};

/// `ResidentPlan` in device memory.
template <class Real>
struct ResidentView {
  const Slice* slices;
  const Index* place;
  const Pair<Real>* pairs;  ///< In the order of `ResidentPlan::entries`.
  const Real* weights;      ///< w_ij of the pairs, for the terms that need them; or null.
  const std::uint32_t* destinations;
  const int* slice_of_block;  ///< -1: none.
  Packet* displacements;      ///< Mailboxes, shape [packets, places]; null in clusters.
  Packet* stresses;           ///< Likewise.
  int most_slots, most_destinations;
  int longest[2];  ///< Entries a lane may have; the second is 0 where one list serves both passes.
};

/// What surfels need of the phyxels that carry them, after each step of a launch.
template <class Real, class StateReal>
struct Trail {
  Real* gradients;           ///< [steps, 9, places]; null: nothing is wanted.
  StateReal* displacements;  ///< [steps, 3, places]
};

/// Numbers of all slots: packet k of slot s is packets[k * slots + s].
struct SlotImage {
  Packet* packets;
  int slots;
};

/// The passes whose weights w_ij a block keeps beside the pairs.
enum class KeptWeights { none, first_pass, both_passes };

/// Where everything is in a block's shared memory.
template <class Real>
struct ResidentMemory {
  SlotImage displacements, stresses;
  Pair<Real>*pairs, *second_pairs;
  Real *weights, *second_weights;  ///< As far as they are kept.
  Index* place_of_slot;            ///< For mailboxes.
  unsigned long long* barriers;    ///< For clusters: two.
  std::uint32_t* destinations;     ///< Likewise.

  /// @param packets of a phyxel's stresses
  __device__ ResidentMemory(char* shared, const ResidentView<Real>& r, int packets,
                            KeptWeights kept) {
    const int slots = r.most_slots;
    displacements = {reinterpret_cast<Packet*>(shared), slots};
    stresses = {displacements.packets + displacement_packets<Real> * slots, slots};
    pairs = reinterpret_cast<Pair<Real>*>(stresses.packets + packets * slots);
    Pair<Real>* end = pairs + r.longest[0] * slice_size;
    second_pairs = r.longest[1] ? end : pairs;
    end += r.longest[1] * slice_size;
    weights = reinterpret_cast<Real*>(end);
    if (kept != KeptWeights::none) end += weight_pairs(r.longest[0]);
    second_weights = weights;
    if (kept == KeptWeights::both_passes && r.longest[1]) {
      second_weights = reinterpret_cast<Real*>(end);
      end += weight_pairs(r.longest[1]);
    }
    place_of_slot = reinterpret_cast<Index*>(end);
    barriers = reinterpret_cast<unsigned long long*>(end);
    destinations = reinterpret_cast<std::uint32_t*>(barriers + 2);
  }
  /// As many pairs take the room of the weights of `longest` entries a lane.
  __host__ __device__ static int weight_pairs(int longest) {
    return longest * slice_size * static_cast<int>(sizeof(Real)) /
           static_cast<int>(sizeof(Pair<Real>));
  }
  /// @param packets of a phyxel's stresses. @param tail what the channel needs
  static int bytes(int most_slots, int longest, int second_longest, int packets, KeptWeights kept,
                   int tail) {
    int pairs = (longest + second_longest) * slice_size;
    if (kept != KeptWeights::none) pairs += weight_pairs(longest);
    if (kept == KeptWeights::both_passes) pairs += weight_pairs(second_longest);
    return most_slots * static_cast<int>(sizeof(Packet)) * (displacement_packets<Real> + packets) +
           pairs * static_cast<int>(sizeof(Pair<Real>)) + tail;
  }
};

}  // namespace phyxel::cuda
