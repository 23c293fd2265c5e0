/// Records stored where the kernels of other ranks read them, in memory that CUDA IPC has opened,
/// and the flags that tell of them.
///
/// A rank's tiles that reach ghosts, or are ghosts elsewhere, come first in a launch. Their blocks
/// wait for the ghosts, and store what they have found with the peers at once; the last of them
/// raises the flags. Values travel while the other tiles run.
#pragma once

#include "solver/records.cuh"

namespace phyxel::cuda {

/// What a step sends, in this order.
enum class Sent : int { stresses, displacements };
inline constexpr int kinds_sent = 2;

/// The copy of one record from a place here to a place of a peer.
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
  unsigned* here;          ///< Those of the peers, in this rank's.
  int peers;
  unsigned *sent, *received, *blocks_done;  ///< Exchanges so far; blocks of the one under way.
  unsigned long long* waited;               ///< [ns]
};

/// All threads of a block wait until every peer has told of the next exchange. One block of many
/// measures the time.
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
/// By one thread, when all blocks that wait for the exchange have.
__device__ inline void mark_received(const Signals& signals) { ++*signals.received; }

/// All threads of a block store records with the peers.
template <class Records>
__device__ void store(const Records& records, const Records* peers, const RemoteCopy* copies,
                      int begin, int end, int stride) {
  for (int k = begin; k < end; k += stride) {
    const RemoteCopy c = copies[k];
    peers[c.peer].set(static_cast<std::size_t>(c.there),
                      records.get(static_cast<std::size_t>(c.here)));
  }
}
/// Of `blocks` blocks that have stored records, the last one to come here tells the peers.
/// @returns to its threads whether it is that one
__device__ inline bool tell_if_last(const Signals& signals, unsigned blocks) {
  __syncthreads();
  bool last = false;
  if (threadIdx.x == 0) {
    __threadfence_system();  // for all of this block, which the barrier has brought together
    last = atomicAdd(signals.blocks_done, 1U) == blocks - 1;
  }
  // Through no static shared memory: a block may need all there is.
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
/// One block.
static __global__ void wait_for_peers(const __grid_constant__ Signals signals) {
  wait_for_flags(signals, true);
  if (threadIdx.x == 0) mark_received(signals);
}

/// A pass that has no ghosts, or whose ghosts are there.
struct NoHalo {
  static __device__ void before(Index /*tile*/) {}
  static __device__ void after(Index /*tile*/) {}
};

/// A pass of which the first tiles wait for ghosts and store `Records` with the peers.
template <class Records>
struct FusedHalo {
  Signals awaited, told;
  Index tiles;         ///< Boundary tiles, at least one.
  const Index* first;  ///< The first copy of each of them, shape [tiles + 1].
  const RemoteCopy* copies;
  Records own;
  const Records* peers;
  bool waits;  ///< Or the ghosts are there.

  __device__ void before(Index tile) const {
    if (tile < tiles && waits) wait_for_flags(awaited, tile == 0);
  }
  /// To be called by all threads of a block.
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
