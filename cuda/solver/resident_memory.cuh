/// Data of resident blocks: the plan in device memory, and the arrays of a block in shared memory.
#pragma once

#include <type_traits>

#include "phyxel/types.hpp"
#include "solver/packet.cuh"
#include "solver/resident_plan.hpp"

namespace phyxel::cuda {

/// A neighbour of a phyxel: w_ij x_ij and its slot, packed into 16-byte words without padding.
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
  const Real* weights;      ///< w_ij of the pairs if a term needs them, else null.
  const std::uint32_t* destinations;
  const int* slice_of_block;  ///< -1 for a block without a slice.
  Packet* displacements;      ///< Mailboxes, shape [packets, places]; null in clusters.
  Packet* stresses;           ///< Likewise.
  int most_slots, most_destinations;
  int longest[2];  ///< Most entries of a lane; the second is 0 if one list serves both passes.
};

/// The trail of a launch: values of phyxels after each step, from which surfels are computed.
template <class Real, class StateReal>
struct Trail {
  Real* gradients;           ///< [steps, 9, places]; null without surfels.
  StateReal* displacements;  ///< [steps, 3, places]
};

/// Numbers of all slots: packet k of slot s is packets[k * slots + s].
struct SlotImage {
  Packet* packets;
  int slots;
};

/// The passes for which a block keeps the weights w_ij beside the pairs.
enum class KeptWeights { none, first_pass, both_passes };

/// The layout of a block's shared memory.
template <class Real>
struct ResidentMemory {
  SlotImage displacements, stresses;
  Pair<Real>*pairs, *second_pairs;
  Real *weights, *second_weights;  ///< Null if not kept.
  Index* place_of_slot;            ///< For mailboxes.
  unsigned long long* barriers;    ///< For clusters: two.
  std::uint32_t* destinations;     ///< Likewise.

  /// @param packets number of packets of a phyxel's stresses
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
  /// Number of pairs that take the space of the weights of `longest` entries per lane.
  __host__ __device__ static int weight_pairs(int longest) {
    return longest * slice_size * static_cast<int>(sizeof(Real)) /
           static_cast<int>(sizeof(Pair<Real>));
  }
  /// Bytes of shared memory of a block. @param packets number of packets of a phyxel's stresses.
  /// @param tail bytes that the channel needs
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
