/// The channel between blocks of a cluster.
#pragma once

#include "solver/resident_memory.cuh"

namespace phyxel::cuda {

// Clusters need compute capability 9; `fits_clusters` checks for it.
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ < 900
#define PHYXEL_CLUSTER_ASM(...) __trap()
#else
#define PHYXEL_CLUSTER_ASM(...) asm volatile(__VA_ARGS__)
#endif

/// Sends directly into the shared memory of the other blocks of a cluster. A cluster steps one
/// body.
template <class Real>
struct ClusterChannel {
  static constexpr int threads = slice_size;
  static int bytes(int, int most_destinations) {
    return 2 * static_cast<int>(sizeof(unsigned long long)) +
           (most_destinations > near ? most_destinations - near : 0) * slice_size *
               static_cast<int>(sizeof(std::uint32_t));
  }

  static constexpr int near = 8;  ///< Destinations that a thread keeps in registers.

  /// A slot of another block's displacement image, and that block's barriers; 0 if there is none.
  struct Destination {
    unsigned slot, bells;
  };
  Destination destination[near];
  const std::uint32_t* more;  ///< The remaining destinations, in shared memory.
  int more_count, halo;
  unsigned image;     ///< This block's displacement image, in shared memory.
  unsigned barriers;  ///< This block's two barriers.
  unsigned parity = 0;

  __device__ static unsigned address(const void* shared) {
    return static_cast<unsigned>(__cvta_generic_to_shared(shared));
  }
  __device__ static void meet_cluster() {
    PHYXEL_CLUSTER_ASM("barrier.cluster.arrive.aligned; barrier.cluster.wait.aligned;" ::
                           : "memory");
  }

  __device__ ClusterChannel(const ResidentView<Real>& r, const Slice& slice,
                            const ResidentMemory<Real>& memory, std::size_t, unsigned)
      : more(memory.destinations),
        more_count(max(0, slice.destinations - near)),
        halo(slice.halo),
        image(address(memory.displacements.packets)),
        barriers(address(memory.barriers)) {
    const std::uint32_t* all = r.destinations + slice.first_destination;
#pragma unroll
    for (int d = 0; d < near; ++d) {
      destination[d] =
          d < slice.destinations ? resolve(all[d * slice_size + threadIdx.x]) : Destination{0, 0};
    }
    for (int k = static_cast<int>(threadIdx.x); k < more_count * slice_size; k += threads) {
      memory.destinations[k] = all[near * slice_size + k];
    }
    if (threadIdx.x == 0) {
      PHYXEL_CLUSTER_ASM("mbarrier.init.shared::cta.b64 [%0], %1;" ::"r"(barriers), "n"(threads));
      PHYXEL_CLUSTER_ASM("mbarrier.init.shared::cta.b64 [%0], %1;" ::"r"(barriers + 8),
                         "n"(threads));
      PHYXEL_CLUSTER_ASM("fence.mbarrier_init.release.cluster;" ::: "memory");
    }
    __syncthreads();
    meet_cluster();
  }

  __device__ Destination resolve(std::uint32_t to) const {
    if (to == nobody) return {0, 0};
    Destination d;
    PHYXEL_CLUSTER_ASM("mapa.shared::cluster.u32 %0, %1, %2;"
                       : "=r"(d.slot)
                       : "r"(image + 16 * (to & 0xFFFF)), "r"(to >> 16));
    PHYXEL_CLUSTER_ASM("mapa.shared::cluster.u32 %0, %1, %2;"
                       : "=r"(d.bells)
                       : "r"(barriers), "r"(to >> 16));
    return d;
  }
  template <int packets>
  __device__ static void send_to(Destination d, int kind, unsigned image_offset, int slots,
                                 const Packet* packet) {
#pragma unroll
    for (int k = 0; k < packets; ++k) {
      const auto words = reinterpret_cast<const uint4&>(packet[k]);
      PHYXEL_CLUSTER_ASM(
          "st.async.shared::cluster.mbarrier::complete_tx::bytes.v4.b32 [%0], {%1, %2, %3, %4}, "
          "[%5];" ::"r"(d.slot + image_offset + 16 * static_cast<unsigned>(k * slots)),
          "r"(words.x), "r"(words.y), "r"(words.z), "r"(words.w),
          "r"(d.bells + 8 * static_cast<unsigned>(kind))
          : "memory");
    }
  }

  template <int packets>
  __device__ void send(int kind, SlotImage to, std::size_t, bool somebody, const Real* numbers) {
    const unsigned offset = address(to.packets) - image;
    const unsigned barrier = barriers + 8 * static_cast<unsigned>(kind);
    Packet packet[packets];
#pragma unroll
    for (int k = 0; k < packets; ++k) {
      packet[k] = Packing<Real>::packed(numbers + k * Packing<Real>::numbers, 0);
    }
    if (somebody) {
#pragma unroll
      for (int d = 0; d < near; ++d) {
        if (destination[d].slot) {
          send_to<packets>(destination[d], kind, offset, to.slots, packet);
        }
      }
      for (int d = 0; d < more_count; ++d) {
        const Destination far = resolve(more[d * slice_size + threadIdx.x]);
        if (far.slot) send_to<packets>(far, kind, offset, to.slots, packet);
      }
#pragma unroll
      for (int k = 0; k < packets; ++k) to.packets[k * to.slots + threadIdx.x] = packet[k];
    }
    if (threadIdx.x == 0) {
      PHYXEL_CLUSTER_ASM("mbarrier.arrive.expect_tx.shared::cta.b64 _, [%0], %1;" ::"r"(barrier),
                         "r"(16 * packets * halo)
                         : "memory");
    } else {
      PHYXEL_CLUSTER_ASM("mbarrier.arrive.shared::cta.b64 _, [%0];" ::"r"(barrier) : "memory");
    }
  }
  template <int packets>
  __device__ void receive(int kind, SlotImage) {
    const unsigned barrier = barriers + 8 * static_cast<unsigned>(kind);
    unsigned done;
    do {
      PHYXEL_CLUSTER_ASM(
          "{ .reg .pred p; mbarrier.try_wait.parity.acquire.cluster.shared::cta.b64 p, [%1], %2; "
          "selp.u32 %0, 1, 0, p; }"
          : "=r"(done)
          : "r"(barrier), "r"(parity)
          : "memory");
    } while (!done);
    if (kind == 1) parity ^= 1;  // the block waits for each barrier once a step
  }
  /// Keeps blocks from leaving while others may still write to their memory.
  __device__ void finish() { meet_cluster(); }
  /// A block of the cluster without a slice.
  __device__ static void stand_by() {
    meet_cluster();
    meet_cluster();
  }
};

}  // namespace phyxel::cuda
