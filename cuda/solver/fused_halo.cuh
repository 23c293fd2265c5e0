/// The halo exchange inside the passes: stores of records into the memory of other ranks' GPUs,
/// opened by CUDA IPC, and flags that announce them.
///
/// The boundary tiles of a rank come first in a launch. Their blocks wait for the ghosts, and store
/// their results in the memory of the peers at once; the last of them raises the flags. The
/// transfer overlaps with the work on the other tiles.
#pragma once

#include "solver/records.cuh"

namespace phyxel::cuda {

/// The values that a step sends, in this order.
enum class Sent : int { stresses, displacements };
inline constexpr int kinds_sent = 2;

/// A copy of one record from a tile slot of this rank to one of a peer.
struct RemoteCopy {
  Index here, there;
  int peer;
};

__device__ inline void raise_flag(unsigned* flag, unsigned value) {
  asm volatile("st.release.sys.global.u32 [%0], %1;" ::"l"(flag), "r"(value) : "memory");
}
__device__ inline unsigned read_flag(const unsigned* flag) {
  unsigned value;
  asm volatile("ld.acquire.sys.global.u32 %0, [%1];" : "=r"(value) : "l"(flag) : "memory");
  return value;
}

/// Flags and counters of one kind of exchange.
struct Signals {
  unsigned* const* there;  ///< The flag of this rank in each peer's memory.
  unsigned* here;          ///< The flags of the peers in this rank's memory.
  int peers;
  unsigned *sent, *received, *blocks_done;  ///< Exchanges; finished blocks of the present one.
  unsigned long long* waited;               ///< Time waited for peers [ns].
};

/// Makes all threads of a block wait until every peer has signalled the next exchange. @param
/// measures true in the one block that measures the time
__device__ inline void wait_for_flags(const Signals& signals, bool measures) {
  const unsigned next = *signals.received + 1;
  unsigned long long start = 0, end = 0;
  if (measures) asm volatile("mov.u64 %0, %globaltimer;" : "=l"(start));
  for (int p = static_cast<int>(threadIdx.x); p < signals.peers;
       p += static_cast<int>(blockDim.x)) {
    while (static_cast<int>(read_flag(signals.here + p) - next) < 0) __nanosleep(50);
  }
  __syncthreads();
  if (!measures || threadIdx.x > 0) return;
  asm volatile("mov.u64 %0, %globaltimer;" : "=l"(end));
  *signals.waited += end - start;
}
/// Counts an exchange as received. Called by one thread when all waiting blocks have passed.
__device__ inline void mark_received(const Signals& signals) { ++*signals.received; }

/// Stores records in the memory of the peers, with all threads of a block.
template <class Records>
__device__ void store(const Records& records, const Records* peers, const RemoteCopy* copies,
                      int begin, int end, int stride) {
  for (int k = begin; k < end; k += stride) {
    const RemoteCopy c = copies[k];
    peers[c.peer].set(static_cast<std::size_t>(c.there),
                      records.get(static_cast<std::size_t>(c.here)));
  }
}
/// Signals the peers from the last of `blocks` blocks that have stored records. @returns true to
/// the threads of that block
__device__ inline bool tell_if_last(const Signals& signals, unsigned blocks) {
  __syncthreads();
  bool last = false;
  if (threadIdx.x == 0) {
    __threadfence_system();  // for all stores of this block, which precede the barrier
    last = atomicAdd(signals.blocks_done, 1U) == blocks - 1;
  }
  // Without static shared memory, since a block may need all there is.
  if (__syncthreads_or(last) == 0) return false;
  const unsigned exchanges = *signals.sent + 1;
  __threadfence_system();
  __syncthreads();
  if (threadIdx.x == 0) {
    *signals.blocks_done = 0;
    *signals.sent = exchanges;
  }
  for (int p = static_cast<int>(threadIdx.x); p < signals.peers;
       p += static_cast<int>(blockDim.x)) {
    raise_flag(signals.there[p], exchanges);
  }
  return true;
}

template <class Records>
__global__ void store_at_peers(const __grid_constant__ Records records, const Records* peers,
                               const RemoteCopy* copies, int count,
                               const __grid_constant__ Signals signals) {
  store(records, peers, copies, static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x), count,
        static_cast<int>(gridDim.x * blockDim.x));
  tell_if_last(signals, gridDim.x);
}
/// Waits for the peers. One block.
static __global__ void wait_for_peers(const __grid_constant__ Signals signals) {
  wait_for_flags(signals, true);
  if (threadIdx.x == 0) mark_received(signals);
}

/// The exchange of a pass without ghosts, or whose ghosts have arrived.
struct NoHalo {
  static __device__ void before(Index /*tile*/) {}
  static __device__ void after(Index /*tile*/) {}
};

/// The exchange of a pass whose boundary tiles wait for ghosts and store `Records` in the memory of
/// the peers.
template <class Records>
struct FusedHalo {
  Signals awaited, told;
  Index tiles;         ///< Boundary tiles, at least one.
  const Index* first;  ///< The first copy of each boundary tile, shape [tiles + 1].
  const RemoteCopy* copies;
  Records own;
  const Records* peers;
  bool waits;  ///< False if the ghosts have arrived.

  __device__ void before(Index tile) const {
    if (tile < tiles && waits) wait_for_flags(awaited, tile == 0);
  }
  /// Stores the records of a tile and signals the peers. Call from all threads of a block.
  __device__ void after(Index tile) const {
    if (tile >= tiles) return;
    __syncthreads();  // before records of other threads are read
    store(own, peers, copies, first[tile] + static_cast<int>(threadIdx.x), first[tile + 1],
          static_cast<int>(blockDim.x));
    if (tell_if_last(told, static_cast<unsigned>(tiles)) && threadIdx.x == 0 && waits) {
      mark_received(awaited);
    }
  }
};

}  // namespace phyxel::cuda
