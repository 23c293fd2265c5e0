// Compiled without fused multiplications: whoever is a neighbour on the CPU shall be one here.
#include <algorithm>

#include "model/space_filling_curve.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/weight.hpp"
#include "setup/device_hash.cuh"
#include "setup/device_tiling.hpp"
#include "setup/wait_free.hpp"

namespace phyxel::cuda {
namespace {

// --- lists that the host has ---------------------------------------------------------------

DeviceTileLists send(const TileLists& lists, const std::string& what) {
  return {sent(lists.halo, what), lists.halo_stride, sent(lists.rows, what),
          sent(lists.entries, what)};
}

DeviceTiling send_tiling(const Model& model) {
  Tiling tiling = make_tiling(model);
  const std::string what = "neighbour lists of " + std::to_string(model.size()) + " phyxels";
  DeviceTiling out;
  out.neighbours = send(tiling.neighbours, what);
  if (!tiling.inverse.rows.empty()) out.inverse = send(tiling.inverse, what);
  std::vector<Sym3d> inverse_moment(tiling.phyxel.size());
  std::vector<Vec3d> moment_offset(tiling.phyxel.size());
  for (Index i = 0; i < model.size(); ++i) {
    inverse_moment[tiling.place[i]] = model.inverse_moment[i];
    moment_offset[tiling.place[i]] = model.moment_offset[i];
  }
  out.inverse_moment = sent(inverse_moment, what);
  out.moment_offset = sent(moment_offset, what);
  out.phyxel_at = sent(tiling.phyxel, what);
  out.phyxel = std::move(tiling.phyxel);
  out.place = std::move(tiling.place);
  out.part = std::move(tiling.part);
  out.own_tiles = tiling.own_tiles;
  out.boundary_tiles = tiling.boundary_tiles;
  return out;
}

// --- lists found here ----------------------------------------------------------------------

/// What the search needs of a model.
struct SearchCloud {
  DeviceArray<Vec3d> position;
  DeviceArray<double> support;
  std::vector<DeviceHash::Body> bodies;
  std::vector<double> largest_support;  ///< Of each body.
};

SearchCloud send_cloud(const Model& model) {
  SearchCloud cloud{sent(model.position, "rest positions"),
                    sent(model.neighbourhood.support, "supports"),
                    {},
                    {}};
  for (const Part& part : model.parts) {
    const auto begin = model.neighbourhood.support.begin() + part.begin,
               end = model.neighbourhood.support.begin() + part.end;
    double sum = 0, largest = 0;
    for (auto h = begin; h != end; ++h) {
      sum += *h;
      largest = std::max(largest, *h);
    }
    const double mean = sum / std::max(1, part.end - part.begin);
    cloud.bodies.push_back({part.begin, part.end, model.neighbourhood.symmetric ? largest : mean});
    cloud.largest_support.push_back(largest);
  }
  return cloud;
}

/// Calls visit(j, x_j - x_i) for every neighbour j of the phyxel, or, with the largest support of
/// each body as `inverse_reach`, for every phyxel whose neighbour it is.
template <class Visit>
__device__ void visit_neighbours(const HashView& hash, int body, Index phyxel, Vec3d here,
                                 const double* support, const double* inverse_reach,
                                 Visit&& visit) {
  const double h = support[phyxel];
  hash.visit_near(body, here, inverse_reach ? inverse_reach[body] : h,
                  [&](std::uint32_t k, Vec3d p) {
                    const Vec3d x = p - here;
                    const Index j = hash.index[k];
                    const double reach = inverse_reach ? support[j] : h;
                    if (j != phyxel && dot(x, x) < reach * reach && hash.is_of(body, k)) {
                      visit(j, x);
                    }
                  });
}

class Finder {
 public:
  explicit Finder(const Model& model)
      : model_(model), cloud_(send_cloud(model)), table_(cloud_.position, cloud_.bodies) {
    largest_support_ = sent(cloud_.largest_support, "supports");
  }

  DeviceTiling find() {
    if (model_.share) {
      place_share();
    } else {
      place_phyxels();
    }
    find_moments();
    out_.neighbours = make_lists(nullptr, most_neighbours_);
    if (!model_.neighbourhood.symmetric) {
      const DeviceArray<Index> length = count(largest_support_.data());
      out_.inverse = make_lists(largest_support_.data(), largest(length));
    }
    return std::move(out_);
  }

  /// Lengths of the lists, by phyxel.
  DeviceArray<Index> count(const double* inverse_reach) {
    const auto n = static_cast<std::size_t>(model_.size());
    DeviceArray<Index> length(n, "list lengths");
    const HashView hash = table_.view();
    for_each("count_neighbours", model_.size(),
             [hash, length = length.data(), support = cloud_.support.data(),
              inverse_reach] __device__(std::int64_t at) {
               const Index i = hash.index[at];
               Index found = 0;
               visit_neighbours(hash, hash.body_of(i), i, hash.entries[at].position, support,
                                inverse_reach, [&](Index, Vec3d) { ++found; });
               length[i] = found;
             });
    return length;
  }

  /// Bodies one after the other along the curve, each from the start of a tile; within a tile long
  /// lists first. As `make_tiling` does.
  void place_phyxels() {
    const Index n = model_.size();
    const DeviceArray<Index> length = count(nullptr);
    most_neighbours_ = largest(length);
    const DeviceArray<Index> order = curve_order();
    std::vector<Index> tile_begin;  // in the order, and where the last tile ends
    for (std::size_t p = 0; p < model_.parts.size(); ++p) {
      const Part& part = model_.parts[p];
      for (Index begin = part.begin; begin < part.end; begin += tile_size) {
        out_.part.push_back(static_cast<Index>(p));
        tile_begin.push_back(begin);
      }
    }
    tile_begin.push_back(n);
    out_.own_tiles = out_.tiles();
    const DeviceArray<Index> begins = sent(tile_begin, "tiles");
    const auto places = out_.part.size() * tile_size;
    out_.phyxel_at = {places, "places"};
    place_of_ = {static_cast<std::size_t>(n), "places"};
    sort_tiles(begins, order, length);
    out_.phyxel = fetched(out_.phyxel_at);
    out_.place = fetched(place_of_);
    std::vector<Index> first_place;
    for (Index tile = 0; tile < out_.tiles(); ++tile) first_place.push_back(tile * tile_size);
    tile_begin_ = sent(first_place, "tiles");
  }

  /// Own tiles are those of the whole, in which lists are named by places in the whole.
  void place_share() {
    const auto n = static_cast<std::size_t>(model_.size());
    const Share& share = *model_.share;
    const DeviceArray<char> owned = sent(share.owned, "places");
    DeviceArray<Index> length(n, "list lengths");
    DeviceArray<char> reaches(n, "list lengths");
    const HashView hash = table_.view();
    const double* inverse_reach =
        model_.neighbourhood.symmetric ? nullptr : largest_support_.data();
    for_each("reach_ghosts", model_.size(),
             [hash, length = length.data(), reaches = reaches.data(), owned = owned.data(),
              support = cloud_.support.data(), inverse_reach] __device__(std::int64_t at) {
               const Index i = hash.index[at];
               const int body = hash.body_of(i);
               Index found = 0;
               char ghosts = 0;
               if (owned[i]) {
                 const Vec3d here = hash.entries[at].position;
                 visit_neighbours(hash, body, i, here, support, nullptr, [&](Index j, Vec3d) {
                   ++found;
                   if (!owned[j]) ghosts = 1;
                 });
                 if (inverse_reach) {
                   visit_neighbours(hash, body, i, here, support, inverse_reach,
                                    [&](Index j, Vec3d) {
                                      if (!owned[j]) ghosts = 1;
                                    });
                 }
               }
               length[i] = found;
               reaches[i] = ghosts;
             });
    most_neighbours_ = largest(length);
    Tiling tiling;
    phyxel::cuda::place_share(model_, fetched(reaches), tiling);
    out_.phyxel = std::move(tiling.phyxel);
    out_.place = std::move(tiling.place);
    out_.part = std::move(tiling.part);
    out_.own_tiles = tiling.own_tiles;
    out_.boundary_tiles = tiling.boundary_tiles;
    out_.phyxel_at = sent(out_.phyxel, "places");
    place_of_ = sent(share.place, "places");
    number_ = sent(share.global_id, "places");
    std::vector<Index> first_place;
    for (Index tile = 0; tile < out_.own_tiles; ++tile) {
      Index any = -1;
      for (int k = 0; k < tile_size && any < 0; ++k) any = out_.phyxel[tile * tile_size + k];
      first_place.push_back(share.place[any] / tile_size * tile_size);
    }
    tile_begin_ = sent(first_place, "tiles");
    // From places in the whole to places here.
    whole_place_ = sent(share.place, "places");
    place_here_ = sent(out_.place, "places");
    sort_pairs(whole_place_, place_here_);
  }

  void find_moments() {
    const auto places = out_.phyxel.size();
    out_.inverse_moment = {places, "inverse moments"};
    out_.moment_offset = {places, "moments"};
    out_.inverse_moment.clear();
    out_.moment_offset.clear();
    const HashView hash = table_.view();
    for_each("moments", static_cast<std::int64_t>(out_.own_tiles) * tile_size,
             [hash, number = number_.data(), phyxel_at = out_.phyxel_at.data(),
              position = cloud_.position.data(), support = cloud_.support.data(),
              inverse_moment = out_.inverse_moment.data(),
              moment_offset = out_.moment_offset.data()] __device__(std::int64_t place) {
               const Index i = phyxel_at[place];
               Sym3d moment;
               Vec3d offset;
               if (i >= 0) {
                 const double inverse_h_squared = 1 / (support[i] * support[i]);
                 const auto each = [&](auto&& offer) {
                   visit_neighbours(hash, hash.body_of(i), i, position[i], support, nullptr,
                                    [&](Index j, Vec3d) { offer(j); });
                 };
                 in_ascending_order(number, each, [&](Index j) {
                   const Vec3d x = position[j] - position[i];
                   const double w = weight_shape(dot(x, x), inverse_h_squared);
                   moment += moment_term(x, w);
                   offset += w * x;
                 });
               }
               inverse_moment[place] = pseudo_inverse(moment).matrix;
               moment_offset[place] = offset;
             });
  }

  DeviceArray<Index> curve_order() {
    const Index n = model_.size();
    std::vector<HilbertFrame> frames;
    for (const Part& part : model_.parts) {
      const Box box = box_around(cloud_.position, part.begin, part.end);
      frames.push_back(HilbertFrame::around(box.low, box.high));
    }
    const DeviceArray<HilbertFrame> frame = sent(frames, "set-up");
    DeviceArray<std::uint64_t> key(static_cast<std::size_t>(n), "places along a curve");
    DeviceArray<Index> order(static_cast<std::size_t>(n), "places along a curve");
    const HashView hash = table_.view();
    for_each("hilbert_keys", n,
             [hash, frame = frame.data(), key = key.data(), order = order.data(),
              position = cloud_.position.data()] __device__(std::int64_t i) {
               key[i] = frame[hash.body_of(static_cast<Index>(i))].key_of(position[i]);
               order[i] = static_cast<Index>(i);
             });
    sort_pairs(key, order);
    if (model_.parts.size() > 1) {
      DeviceArray<std::uint32_t> body(static_cast<std::size_t>(n), "set-up");
      for_each("bodies", n,
               [hash, body = body.data(), order = order.data()] __device__(std::int64_t k) {
                 body[k] = static_cast<std::uint32_t>(hash.body_of(order[k]));
               });
      sort_pairs(body, order);
    }
    return order;
  }

  void sort_tiles(const DeviceArray<Index>& begins, const DeviceArray<Index>& order,
                  const DeviceArray<Index>& length);
  DeviceTileLists make_lists(const double* inverse_reach, Index longest);

  static Index largest(const DeviceArray<Index>& values) {
    return reduce(values.data(), static_cast<std::int64_t>(values.size()), Index{0}, Larger{});
  }

 private:
  const Model& model_;
  SearchCloud cloud_;
  DeviceHash table_;
  DeviceArray<double> largest_support_;
  Index most_neighbours_ = 0;
  // Of each phyxel in the whole model's tiles; where own tiles begin there.
  DeviceArray<Index> place_of_, tile_begin_;
  // Of a share: numbers in the whole; places in the whole, ascending, and where those are here.
  DeviceArray<Index> number_, whole_place_, place_here_;
  DeviceTiling out_;
};

/// One block a tile.
__global__ void sort_tile(const Index* begins, const Index* order, const Index* length,
                          Index* phyxel_at, Index* place_of) {
  __shared__ Index lengths[tile_size];
  const int thread = static_cast<int>(threadIdx.x);
  const Index tile = static_cast<Index>(blockIdx.x);
  const Index begin = begins[tile];
  const int count = begins[tile + 1] - begin;
  Index* places = phyxel_at + static_cast<std::size_t>(tile) * tile_size;
  const Index i = thread < count ? order[begin + thread] : -1;
  lengths[thread] = i >= 0 ? length[i] : -1;
  __syncthreads();
  if (i < 0) {
    places[thread] = -1;
    return;
  }
  int rank = 0;
  for (int other = 0; other < count; ++other) {
    rank +=
        lengths[other] > lengths[thread] || (lengths[other] == lengths[thread] && other < thread);
  }
  places[rank] = i;
  place_of[i] = tile * tile_size + rank;
}

void Finder::sort_tiles(const DeviceArray<Index>& begins, const DeviceArray<Index>& order,
                        const DeviceArray<Index>& length) {
  const auto tiles = static_cast<unsigned>(out_.part.size());
  if (tiles == 0) return;
  sort_tile<<<tiles, tile_size>>>(begins.data(), order.data(), length.data(), out_.phyxel_at.data(),
                                  place_of_.data());
  check_launch({"sort_tile", tiles, tile_size, "tiles"});
}

// Of the halo's hash table: at most half full, and with all else within 48 KiB.
constexpr int table_size = 2 * most_halo;

/// One block a tile: the places outside that its lists name, ascending.
/// @param tile_begin first place of each tile of the batch
/// @param found [tiles * tile_size, longest]
/// @param halo [tiles, most_halo]
/// @param points of each tile's halo; more than fit: the number that were seen until then
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
      if (*const_cast<volatile int*>(&count) > most_halo) break;  // refused anyway
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
  for (int width = 2; width <= size; width *= 2) {  // bitonic
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

/// The rows of a batch of tiles on their way: as places, as slots, in order.
struct Batch {
  Index first_tile, tiles;
  DeviceArray<Index> found, length, halo, points;
  DeviceArray<std::uint16_t> slots, ordered;
  DeviceArray<Index> steps;  ///< Of each team.
};

DeviceTileLists Finder::make_lists(const double* inverse_reach, Index longest_found) {
  const Index longest = std::max<Index>(longest_found, 1), tiles = out_.own_tiles;
  const std::string what = "neighbour lists of " + std::to_string(model_.size()) + " phyxels";
  const HashView hash = table_.view();

  // Twice the longest list is far more than teams take, except for the oddest clouds.
  int capacity = std::min(team * longest, 2 * longest + 64);
  const std::size_t place_bytes = 6 * static_cast<std::size_t>(longest) + 2 * capacity + 16;
  const Index most_tiles = static_cast<Index>(std::clamp<std::size_t>(
      (std::size_t{3} << 29) / (tile_size * place_bytes + 4 * most_halo), 1, 16384));

  DeviceTileLists lists;
  lists.rows = {static_cast<std::size_t>(tiles) * (tile_size / warp_size), what};
  struct Piece {
    DeviceArray<std::uint16_t> entries;
    DeviceArray<Index> halo;  ///< [tiles, stride]
    Index stride, tiles;
  };
  std::vector<Piece> pieces;
  std::int64_t chunks = 0;
  for (Index first = 0; first < tiles; first += most_tiles) {
    Batch b;
    b.first_tile = first;
    b.tiles = std::min(most_tiles, tiles - first);
    const auto places = static_cast<std::size_t>(b.tiles) * tile_size;
    const auto places_64 = static_cast<std::int64_t>(places);
    const std::size_t first_place = static_cast<std::size_t>(first) * tile_size;
    b.found = {places * longest, what};
    b.length = {places, what};
    for_each(
        "find_neighbours", places_64,
        [hash, phyxel_at = out_.phyxel_at.data() + first_place, position = cloud_.position.data(),
         support = cloud_.support.data(), inverse_reach, place_of = place_of_.data(),
         found = b.found.data(), length = b.length.data(), longest] __device__(std::int64_t row) {
          const Index i = phyxel_at[row];
          Index count = 0;
          if (i >= 0) {
            visit_neighbours(hash, hash.body_of(i), i, position[i], support, inverse_reach,
                             [&](Index j, Vec3d) { found[row * longest + count++] = place_of[j]; });
          }
          length[row] = count;
        });
    b.halo = {static_cast<std::size_t>(b.tiles) * most_halo, what};
    b.points = {static_cast<std::size_t>(b.tiles), what};
    collect_halo<<<b.tiles, tile_size>>>(tile_begin_.data() + first, b.found.data(),
                                         b.length.data(), longest, b.halo.data(), b.points.data());
    check_launch({"collect_halo", static_cast<unsigned>(b.tiles), tile_size, what});
    const Index stride = largest(b.points);
    if (stride > most_halo) refuse_halo(stride);

    b.slots = {places * longest, what};
    b.slots.clear();  // lists end before their room does, and all of it is copied
    for_each("name_slots", places_64,
             [tile_begin = tile_begin_.data() + first, longest, found = b.found.data(),
              length = b.length.data(), halo = b.halo.data(), points = b.points.data(),
              slots = b.slots.data()] __device__(std::int64_t row) {
               const Index tile = static_cast<Index>(row / tile_size);
               const Index begin = tile_begin[tile];
               const Index* of_tile = halo + static_cast<std::size_t>(tile) * most_halo;
               std::uint16_t* list = slots + row * longest;
               for (Index e = 0; e < length[row]; ++e) {
                 const Index place = found[row * longest + e];
                 int slot = place - begin;
                 if (slot < 0 || slot >= tile_size) {
                   int low = 0, high = points[tile];  // the first that is not less
                   while (low < high) {
                     const int middle = (low + high) / 2;
                     if (of_tile[middle] < place) {
                       low = middle + 1;
                     } else {
                       high = middle;
                     }
                   }
                   slot = tile_size + far_slots + low;
                 }
                 const auto s = static_cast<std::uint16_t>(slot);
                 Index k = e;
                 for (; k > 0 && earlier_slot(s, list[k - 1]); --k) list[k] = list[k - 1];
                 list[k] = s;
               }
             });
    const std::size_t teams = places / team;
    DeviceArray<std::uint16_t> spent(b.slots.size(), what);
    for (;; capacity = team * longest) {
      b.ordered = {places * capacity, what};
      b.steps = {teams, what};
      PHYXEL_CUDA(
          cudaMemcpyAsync(spent.data(), b.slots.data(), b.slots.bytes(), cudaMemcpyDeviceToDevice));
      for_each("order_wait_free", static_cast<std::int64_t>(teams),
               [longest, capacity, length = b.length.data(), slots = spent.data(),
                ordered = b.ordered.data(), steps = b.steps.data()] __device__(std::int64_t t) {
                 steps[t] = order_wait_free(slots + t * team * longest, longest, length + t * team,
                                            tile_size, ordered + t * team * capacity, capacity);
               });
      const Index fewest =
          reduce(b.steps.data(), static_cast<std::int64_t>(teams), Index{0}, Smaller{});
      if (fewest >= 0) break;
    }

    // Rows of a warp are as long as its longest team's.
    constexpr int teams_a_warp = warp_size / team;
    const std::size_t warps = places / warp_size;
    DeviceArray<std::int64_t> warp_chunks(warps, what);
    TileLists::Row* rows = lists.rows.data() + first_place / warp_size;
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
    const std::int64_t piece_chunks = last_of(begins);
    Piece piece{{static_cast<std::size_t>(piece_chunks) * warp_size * chunk, what},
                {static_cast<std::size_t>(b.tiles) * stride, what},
                stride,
                b.tiles};
    for_each(
        "pack_entries", places_64,
        [rows, chunks, begins = begins.data(), steps = b.steps.data(), ordered = b.ordered.data(),
         capacity, entries = piece.entries.data()] __device__(std::int64_t row) {
          const std::int64_t w = row / warp_size;
          const int lane = static_cast<int>(row % warp_size);
          const Index length = rows[w].length, ready = steps[row / team];
          const auto idle = static_cast<std::uint16_t>(tile_size + lane % columns);
          if (lane == 0) rows[w].chunk = static_cast<std::int32_t>(chunks + begins[w]);
          for (Index e = 0; e < (length + chunk - 1) / chunk * chunk; ++e) {
            const std::uint16_t slot = e < ready ? ordered[row * capacity + e] : idle;
            entries[((begins[w] + e / chunk) * warp_size + lane) * chunk + e % chunk] =
                e < length ? static_cast<std::uint16_t>(16 * slot) : std::uint16_t{0};
          }
        });
    for_each("pack_halo", static_cast<std::int64_t>(piece.halo.size()),
             [stride, halo = b.halo.data(), points = b.points.data(), out = piece.halo.data(),
              whole = whole_place_.data(), here = place_here_.data(),
              n = static_cast<Index>(whole_place_.size())] __device__(std::int64_t k) {
               const auto tile = k / stride, h = k % stride;
               Index place = h < points[tile] ? halo[tile * most_halo + h] : -1;
               if (whole && place >= 0) {
                 Index low = 0, high = n - 1;
                 while (low < high) {
                   const Index middle = low + (high - low) / 2;
                   if (whole[middle] < place) {
                     low = middle + 1;
                   } else {
                     high = middle;
                   }
                 }
                 place = here[low];
               }
               out[k] = place;
             });
    chunks += piece_chunks;
    lists.halo_stride = std::max(lists.halo_stride, stride);
    pieces.push_back(std::move(piece));
  }

  lists.entries = {static_cast<std::size_t>(chunks) * warp_size * chunk, what};
  lists.halo = {static_cast<std::size_t>(tiles) * lists.halo_stride, what};
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
  return lists;
}

}  // namespace

DeviceTiling make_device_tiling(const Model& model) {
  return model.has_lists() ? send_tiling(model) : Finder(model).find();
}

Tiling fetched_tiling(const DeviceTiling& on_device) {
  const auto lists = [](const DeviceTileLists& l) {
    return TileLists{fetched(l.halo), l.halo_stride, fetched(l.rows), fetched(l.entries)};
  };
  Tiling tiling{on_device.phyxel,
                on_device.place,
                on_device.part,
                on_device.own_tiles,
                on_device.boundary_tiles,
                lists(on_device.neighbours),
                {}};
  if (on_device.inverse) tiling.inverse = lists(*on_device.inverse);
  return tiling;
}

}  // namespace phyxel::cuda
