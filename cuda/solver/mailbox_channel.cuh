/// The channel between blocks through global memory.
#pragma once

#include "solver/resident_memory.cuh"

namespace phyxel::cuda {

/// Sends through mailboxes in global memory. All threads fetch; the first `slice_size` compute.
template <class Real>
struct MailboxChannel {
  static constexpr int threads = 128;
  static int bytes(int most_slots, int) { return most_slots * static_cast<int>(sizeof(Index)); }

  const Index* place_of_slot;
  Packet* boxes[2];
  std::size_t places;
  int slots;
  unsigned tag;

  __device__ MailboxChannel(const ResidentView<Real>& r, const Slice& slice,
                            const ResidentMemory<Real>& memory, std::size_t all_places,
                            unsigned first_tag)
      : place_of_slot(memory.place_of_slot),
        boxes{r.displacements, r.stresses},
        places(all_places),
        slots(slice.slots),
        tag(first_tag) {
    for (int s = static_cast<int>(threadIdx.x); s < slice.slots; s += threads) {
      memory.place_of_slot[s] = r.place[slice.first_slot + s];
    }
    __syncthreads();
  }

  /// Writes a phyxel's numbers to its mailbox. @param kind 0 for displacements, 1 for stresses
  template <int packets>
  __device__ void send(int kind, SlotImage image, std::size_t place, bool somebody,
                       const Real* numbers) {
    if (!somebody) return;
#pragma unroll
    for (int k = 0; k < packets; ++k) {
      const Packet packet = Packing<Real>::packed(numbers + k * Packing<Real>::numbers, tag);
      store_packet(boxes[kind] + k * places + place, packet);
      image.packets[k * image.slots + threadIdx.x] = packet;
    }
  }
  /// Fills all slots of the image, with several loads of packets in flight per thread.
  template <int packets>
  __device__ void receive(int kind, SlotImage image) {
    constexpr int batch = packets >= 9 ? 1 : packets >= 3 ? 3 : 4;  // slots
    for (int first = slice_size + static_cast<int>(threadIdx.x); first < slots;
         first += batch * threads) {
      const Packet* from[batch];
      Packet got[batch * packets];
#pragma unroll
      for (int b = 0; b < batch; ++b) {
        const int slot = first + b * threads;
        const Index place = slot < slots ? place_of_slot[slot] : -1;
        from[b] = place >= 0 ? boxes[kind] + place : nullptr;
#pragma unroll
        for (int k = 0; k < packets; ++k) {
          if (from[b]) got[b * packets + k] = load_packet(from[b] + k * places);
        }
      }
      bool all;
      do {
        all = true;
#pragma unroll
        for (int b = 0; b < batch; ++b) {
#pragma unroll
          for (int k = 0; k < packets; ++k) {
            if (!from[b] || Packing<Real>::tag(got[b * packets + k]) == tag) continue;
            got[b * packets + k] = load_packet(from[b] + k * places);
            all = false;
          }
        }
      } while (!all);
#pragma unroll
      for (int b = 0; b < batch; ++b) {
#pragma unroll
        for (int k = 0; k < packets; ++k) {
          if (from[b]) {
            image.packets[k * image.slots + first + b * threads] = got[b * packets + k];
          }
        }
      }
    }
    ++tag;
    __syncthreads();
  }
  __device__ void finish() {}
};

}  // namespace phyxel::cuda
