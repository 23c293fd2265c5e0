// Compiled without fused multiplications, so that neighbours are those of the CPU.
#include <algorithm>

#include "setup/device_lists.cuh"
#include "setup/wait_free.hpp"

namespace phyxel::cuda {
namespace {

// Size of the halo's hash table: at most half full, and within 48 KiB with the other shared arrays.
constexpr int table_size = 2 * most_halo;

/// Collects the halo of a tile: the places of other tiles in its lists, ascending. One block a
/// tile.
/// @param tile_begin first place of each tile of the batch
/// @param found lists as places, shape [tiles * tile_size, longest]
/// @param halo shape [tiles, most_halo]
/// @param points number of points of each tile's halo; if above `most_halo`, it is incomplete
__global__ void collect_halo(const Index* tile_begin, const Index* found, const Index* length,
                             Index longest, Index* halo, Index* points) {
  __shared__ Index table[table_size];
  __shared__ Index sorted[most_slots];
  __shared__ int count;
  const int thread = static_cast<int>(threadIdx.x);
  for (int k = thread; k < table_size; k += tile_size) table[k] = -1;
  if (thread == 0) count = 0;
  __syncthreads();
  const Index begin = tile_begin[blockIdx.x];
  const std::size_t row = static_cast<std::size_t>(blockIdx.x) * tile_size + threadIdx.x;
  for (Index e = 0; e < length[row]; ++e) {
    const Index place = found[row * longest + e];
    if (place >= begin && place < begin + tile_size) continue;
    unsigned at = static_cast<unsigned>(place) * 2654435761U >> 16;
    for (;; ++at) {
      Index& cell = table[at % table_size];
      const Index there = atomicCAS(&cell, -1, place);
      if (there == place) break;
      if (there == -1) {
        const int number = atomicAdd(&count, 1);
        if (number < most_slots) sorted[number] = place;
        break;
      }
      if (*const_cast<volatile int*>(&count) > most_halo) break;  // the tile will be refused
    }
  }
  __syncthreads();
  const int all = count;
  if (thread == 0) points[blockIdx.x] = all;
  if (all > most_halo) return;
  int size = 2;
  while (size < all) size *= 2;
  for (int k = all + thread; k < size; k += tile_size) sorted[k] = INT32_MAX;
  __syncthreads();
  for (int width = 2; width <= size; width *= 2) {  // bitonic sort
    for (int apart = width / 2; apart > 0; apart /= 2) {
      for (int k = thread; k < size; k += tile_size) {
        const int other = k ^ apart;
        if (other > k && (sorted[k] > sorted[other]) == ((k & width) == 0)) {
          const Index swap = sorted[k];
          sorted[k] = sorted[other];
          sorted[other] = swap;
        }
      }
      __syncthreads();
    }
  }
  Index* out = halo + static_cast<std::size_t>(blockIdx.x) * most_halo;
  for (int k = thread; k < all; k += tile_size) out[k] = sorted[k];
}

/// Index of the first of `count` ascending values that is not less than `wanted`.
__device__ Index lower_bound(const Index* values, Index count, Index wanted) {
  Index low = 0, high = count;
  while (low < high) {
    const Index middle = low + (high - low) / 2;
    if (values[middle] < wanted) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low;
}

/// The lists of a batch of tiles, from places over slots to ordered entries.
struct Batch {
  Index first_tile, tiles;
  DeviceArray<Index> found;            ///< Lists as places, shape [places, longest].
  DeviceArray<Index> length;           ///< Length of each list, shape [places].
  DeviceArray<Index> halo;             ///< Shape [tiles, most_halo].
  DeviceArray<Index> points;           ///< Number of points of each halo, shape [tiles].
  Index stride = 0;                    ///< The largest number of points.
  DeviceArray<std::uint16_t> slots;    ///< Lists as slots, shape [places, longest].
  DeviceArray<std::uint16_t> ordered;  ///< Lists in the order of steps, shape [places, capacity].
  DeviceArray<Index> steps;            ///< Number of steps of each team, shape [places / team].

  std::size_t places() const { return static_cast<std::size_t>(tiles) * tile_size; }
  std::size_t first_place() const { return static_cast<std::size_t>(first_tile) * tile_size; }
};

/// The packed lists of a batch.
struct Piece {
  DeviceArray<std::uint16_t> entries;  ///< As in `TileLists`.
  DeviceArray<Index> halo;             ///< Shape [tiles, stride].
  Index stride, tiles;
  std::int64_t chunks;
};

/// Makes the lists of a model in batches of tiles, whose size the memory limits.
class ListMaker {
 public:
  ListMaker(const ListSource& source, Index longest)
      : source_(source),
        longest_(std::max<Index>(longest, 1)),
        // Twice the longest list is more than teams take, except for extreme clouds.
        capacity_(std::min(team * longest_, 2 * longest_ + 64)) {}

  DeviceTileLists make() {
    const Index tiles = source_.tiles;
    const std::size_t place_bytes = 6 * static_cast<std::size_t>(longest_) + 2 * capacity_ + 16;
    const Index most_tiles = static_cast<Index>(std::clamp<std::size_t>(
        (std::size_t{3} << 29) / (tile_size * place_bytes + 4 * most_halo), 1, 16384));
    DeviceTileLists lists;
    lists.rows = {static_cast<std::size_t>(tiles) * (tile_size / warp_size), source_.what};
    std::vector<Piece> pieces;
    std::int64_t chunks = 0;
    for (Index first = 0; first < tiles; first += most_tiles) {
      Batch batch;
      batch.first_tile = first;
      batch.tiles = std::min(most_tiles, tiles - first);
      find(batch);
      name_slots(batch);
      order(batch);
      pieces.push_back(packed(batch, lists, chunks));
      chunks += pieces.back().chunks;
      lists.halo_stride = std::max(lists.halo_stride, batch.stride);
    }
    join(pieces, chunks, lists);
    return lists;
  }

  /// Finds lists and halos as places.
  void find(Batch& b) {
    b.found = {b.places() * longest_, source_.what};
    b.length = {b.places(), source_.what};
    for_each("find_neighbours", static_cast<std::int64_t>(b.places()),
             [near = source_.near, phyxel_at = source_.phyxel_at + b.first_place(),
              place_of = source_.place_of, found = b.found.data(), length = b.length.data(),
              longest = longest_] __device__(std::int64_t row) {
               const Index i = phyxel_at[row];
               Index count = 0;
               if (i >= 0) {
                 near.visit(i, [&](Index j) { found[row * longest + count++] = place_of[j]; });
               }
               length[row] = count;
             });
    b.halo = {static_cast<std::size_t>(b.tiles) * most_halo, source_.what};
    b.points = {static_cast<std::size_t>(b.tiles), source_.what};
    collect_halo<<<b.tiles, tile_size>>>(source_.tile_begin + b.first_tile, b.found.data(),
                                         b.length.data(), longest_, b.halo.data(), b.points.data());
    check_launch({"collect_halo", static_cast<unsigned>(b.tiles), tile_size, source_.what});
    b.stride = largest(b.points);
    if (b.stride > most_halo) refuse_halo(b.stride);
  }

  /// Replaces places by slots, sorted by `earlier_slot`.
  void name_slots(Batch& b) {
    b.slots = {b.places() * longest_, source_.what};
    b.slots.clear();  // rows are longer than lists, and are copied whole
    for_each("name_slots", static_cast<std::int64_t>(b.places()),
             [tile_begin = source_.tile_begin + b.first_tile, longest = longest_,
              found = b.found.data(), length = b.length.data(), halo = b.halo.data(),
              points = b.points.data(), slots = b.slots.data()] __device__(std::int64_t row) {
               const Index tile = static_cast<Index>(row / tile_size);
               const Index begin = tile_begin[tile];
               const Index* of_tile = halo + static_cast<std::size_t>(tile) * most_halo;
               std::uint16_t* list = slots + row * longest;
               for (Index e = 0; e < length[row]; ++e) {
                 const Index place = found[row * longest + e];
                 int slot = place - begin;
                 if (slot < 0 || slot >= tile_size) {
                   slot = tile_size + far_slots + lower_bound(of_tile, points[tile], place);
                 }
                 const auto s = static_cast<std::uint16_t>(slot);
                 Index k = e;
                 for (; k > 0 && earlier_slot(s, list[k - 1]); --k) list[k] = list[k - 1];
                 list[k] = s;
               }
             });
  }

  /// Orders the lists of each team, with more room if one of them needs it.
  void order(Batch& b) {
    const std::size_t teams = b.places() / team;
    DeviceArray<std::uint16_t> spent(b.slots.size(), source_.what);
    for (;; capacity_ = team * longest_) {
      b.ordered = {b.places() * capacity_, source_.what};
      b.steps = {teams, source_.what};
      PHYXEL_CUDA(
          cudaMemcpyAsync(spent.data(), b.slots.data(), b.slots.bytes(), cudaMemcpyDeviceToDevice));
      for_each(
          "order_wait_free", static_cast<std::int64_t>(teams),
          [longest = longest_, capacity = capacity_, length = b.length.data(), slots = spent.data(),
           ordered = b.ordered.data(), steps = b.steps.data()] __device__(std::int64_t t) {
            steps[t] = order_wait_free(slots + t * team * longest, longest, length + t * team,
                                       tile_size, ordered + t * team * capacity, capacity);
          });
      const Index fewest =
          reduce(b.steps.data(), static_cast<std::int64_t>(teams), Index{0}, Smaller{});
      if (fewest >= 0) return;
    }
  }

  /// Packs a batch into chunks and sets its rows. @param before number of chunks before the batch
  Piece packed(const Batch& b, DeviceTileLists& lists, std::int64_t before) {
    // The rows of a warp have the length of its longest team.
    constexpr int teams_a_warp = warp_size / team;
    const std::size_t warps = b.places() / warp_size;
    DeviceArray<std::int64_t> warp_chunks(warps, source_.what);
    TileLists::Row* rows = lists.rows.data() + b.first_place() / warp_size;
    for_each("row_lengths", static_cast<std::int64_t>(warps),
             [steps = b.steps.data(), warp_chunks = warp_chunks.data(),
              rows] __device__(std::int64_t w) {
               Index length = 0;
               for (int t = 0; t < teams_a_warp; ++t) {
                 length = max(length, steps[w * teams_a_warp + t]);
               }
               rows[w].length = length;
               warp_chunks[w] = (length + chunk - 1) / chunk;
             });
    const DeviceArray<std::int64_t> begins = running_sums(warp_chunks);
    const std::int64_t chunks = last_of(begins);
    Piece piece{{static_cast<std::size_t>(chunks) * warp_size * chunk, source_.what},
                packed_halo(b),
                b.stride,
                b.tiles,
                chunks};
    for_each(
        "pack_entries", static_cast<std::int64_t>(b.places()),
        [rows, before, begins = begins.data(), steps = b.steps.data(), ordered = b.ordered.data(),
         capacity = capacity_, entries = piece.entries.data()] __device__(std::int64_t row) {
          const std::int64_t w = row / warp_size;
          const int lane = static_cast<int>(row % warp_size);
          const Index length = rows[w].length, ready = steps[row / team];
          const auto idle = static_cast<std::uint16_t>(tile_size + lane % columns);
          if (lane == 0) rows[w].chunk = static_cast<std::int32_t>(before + begins[w]);
          for (Index e = 0; e < (length + chunk - 1) / chunk * chunk; ++e) {
            const std::uint16_t slot = e < ready ? ordered[row * capacity + e] : idle;
            entries[((begins[w] + e / chunk) * warp_size + lane) * chunk + e % chunk] =
                e < length ? static_cast<std::uint16_t>(16 * slot) : std::uint16_t{0};
          }
        });
    return piece;
  }

  /// The halos of a batch with the stride of its largest one, as places in the share.
  DeviceArray<Index> packed_halo(const Batch& b) {
    DeviceArray<Index> packed(static_cast<std::size_t>(b.tiles) * b.stride, source_.what);
    for_each("pack_halo", static_cast<std::int64_t>(packed.size()),
             [stride = b.stride, halo = b.halo.data(), points = b.points.data(),
              out = packed.data(), whole = source_.whole_place, here = source_.place_here,
              n = source_.here] __device__(std::int64_t k) {
               const auto tile = k / stride, h = k % stride;
               const Index place = h < points[tile] ? halo[tile * most_halo + h] : -1;
               out[k] = whole && place >= 0 ? here[lower_bound(whole, n, place)] : place;
             });
    return packed;
  }

  /// Joins the pieces of all batches.
  void join(std::vector<Piece>& pieces, std::int64_t chunks, DeviceTileLists& lists) {
    lists.entries = {static_cast<std::size_t>(chunks) * warp_size * chunk, source_.what};
    lists.halo = {static_cast<std::size_t>(source_.tiles) * lists.halo_stride, source_.what};
    std::uint16_t* entries = lists.entries.data();
    Index* halo = lists.halo.data();
    for (Piece& piece : pieces) {
      PHYXEL_CUDA(cudaMemcpyAsync(entries, piece.entries.data(), piece.entries.bytes(),
                                  cudaMemcpyDeviceToDevice));
      entries += piece.entries.size();
      const auto count = static_cast<std::int64_t>(piece.tiles) * lists.halo_stride;
      for_each("join_halo", count,
               [halo, from = piece.halo.data(), stride = piece.stride,
                all = lists.halo_stride] __device__(std::int64_t k) {
                 const auto tile = k / all, h = k % all;
                 halo[k] = h < stride ? from[tile * stride + h] : -1;
               });
      halo += count;
      PHYXEL_CUDA(cudaDeviceSynchronize());
      piece = {};
    }
  }

 private:
  const ListSource& source_;
  Index longest_;  ///< Length of the longest list, at least 1.
  int capacity_;   ///< Steps that `ordered` has room for.
};

}  // namespace

Index largest(const DeviceArray<Index>& values) {
  return reduce(values.data(), static_cast<std::int64_t>(values.size()), Index{0}, Larger{});
}

DeviceTileLists find_lists(const ListSource& source, Index longest) {
  return ListMaker(source, longest).make();
}

}  // namespace phyxel::cuda
