// Compiled without fused multiplications, so that neighbours are those of the CPU.
#include <algorithm>

#include "model/space_filling_curve.hpp"
#include "setup/device_lists.cuh"
#include "setup/device_neighbours.cuh"

namespace phyxel::cuda {
namespace {

/// The last of some ascending numbers, the first of which is 0, that is not above `i`.
__device__ Index last_before(const Index* begins, Index count, Index i) {
  Index first = 0, last = count - 1;
  while (first < last) {
    const Index middle = (first + last + 1) / 2;
    if (begins[middle] <= i) {
      first = middle;
    } else {
      last = middle - 1;
    }
  }
  return first;
}

/// Builder of a model's tiles on the device.
class Finder {
 public:
  explicit Finder(const Model& model) : model_(model), neighbours_(neighbours_of(model)) {}

  DeviceTiling find() {
    if (model_.share) {
      place_share();
    } else {
      place_phyxels();
    }
    if (model_.has_lists()) {
      send_moments();
    } else {
      find_moments();
    }
    out_.neighbours = make_lists(neighbours_.near(), most_neighbours_);
    if (!model_.neighbourhood.symmetric) {
      out_.inverse = make_lists(neighbours_.inverse(), largest(count(neighbours_.inverse())));
    }
    return std::move(out_);
  }

  /// Length of each phyxel's list, shape [n].
  DeviceArray<Index> count(const NeighbourSource& from) {
    DeviceArray<Index> length(static_cast<std::size_t>(model_.size()), "list lengths");
    for_each("count_neighbours", model_.size(),
             [from, length = length.data()] __device__(std::int64_t k) {
               const Index i = from.in_order(k);
               Index found = 0;
               from.visit(i, [&](Index) { ++found; });
               length[i] = found;
             });
    return length;
  }

  /// Assigns places as `make_tiling` does: bodies one after the other along the curve, each from
  /// the start of a tile; within a tile, phyxels with long lists first.
  void place_phyxels() {
    const Index n = model_.size();
    const DeviceArray<Index> length = count(neighbours_.near());
    most_neighbours_ = largest(length);
    const DeviceArray<Index> order = curve_order();
    std::vector<Index> tile_begin;  // first phyxel of each tile in the order, and the end
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

  /// Assigns the places of a share: its own tiles are tiles of the whole model.
  void place_share() {
    const auto n = static_cast<std::size_t>(model_.size());
    const Share& share = *model_.share;
    const DeviceArray<char> owned = sent(share.owned, "places");
    DeviceArray<Index> length(n, "list lengths");
    DeviceArray<char> reaches(n, "list lengths");
    for_each("reach_ghosts", model_.size(),
             [near = neighbours_.near(), inverse = neighbours_.inverse(), owned = owned.data(),
              symmetric = model_.neighbourhood.symmetric, length = length.data(),
              reaches = reaches.data()] __device__(std::int64_t k) {
               const Index i = near.in_order(k);
               Index found = 0;
               char ghosts = 0;
               const auto look_at = [&](Index j) {
                 if (!owned[j]) ghosts = 1;
               };
               if (owned[i]) {
                 near.visit(i, [&](Index j) {
                   ++found;
                   look_at(j);
                 });
                 if (!symmetric) inverse.visit(i, look_at);
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
    global_id_ = sent(share.global_id, "places");
    std::vector<Index> first_place;
    for (Index tile = 0; tile < out_.own_tiles; ++tile) {
      Index any = -1;
      for (int k = 0; k < tile_size && any < 0; ++k) any = out_.phyxel[tile * tile_size + k];
      first_place.push_back(share.place[any] / tile_size * tile_size);
    }
    tile_begin_ = sent(first_place, "tiles");
    // The map from places in the whole model to places in the share.
    whole_place_ = sent(share.place, "places");
    place_here_ = sent(out_.place, "places");
    sort_pairs(whole_place_, place_here_);
  }

  /// Sends the moments that the host has found along with the lists.
  void send_moments() {
    const auto places = out_.phyxel.size();
    out_.inverse_moment = {places, "inverse moments"};
    out_.moment_offset = {places, "moments"};
    out_.inverse_moment.clear();
    out_.moment_offset.clear();
    const DeviceArray<Index> place = sent(out_.place, "places");
    const DeviceArray<Sym3d> inverse_moment = sent(model_.inverse_moment, "inverse moments");
    const DeviceArray<Vec3d> moment_offset = sent(model_.moment_offset, "moments");
    for_each("place_moments", model_.size(),
             [place = place.data(), from = inverse_moment.data(),
              from_offset = moment_offset.data(), to = out_.inverse_moment.data(),
              to_offset = out_.moment_offset.data()] __device__(std::int64_t i) {
               to[place[i]] = from[i];
               to_offset[place[i]] = from_offset[i];
             });
    PHYXEL_CUDA(cudaDeviceSynchronize());
  }

  void find_moments() {
    const auto places = out_.phyxel.size();
    out_.inverse_moment = {places, "inverse moments"};
    out_.moment_offset = {places, "moments"};
    out_.inverse_moment.clear();
    out_.moment_offset.clear();
    for_each("moments", static_cast<std::int64_t>(out_.own_tiles) * tile_size,
             [near = neighbours_.near(), global_id = global_id_.data(),
              phyxel_at = out_.phyxel_at.data(), inverse_moment = out_.inverse_moment.data(),
              moment_offset = out_.moment_offset.data()] __device__(std::int64_t place) {
               const Index i = phyxel_at[place];
               const Moments found = i >= 0 ? moments_of(near, i, global_id) : Moments{};
               inverse_moment[place] = pseudo_inverse(found.moment).matrix;
               moment_offset[place] = found.offset;
             });
  }

  DeviceArray<Index> curve_order() {
    const Index n = model_.size();
    std::vector<HilbertFrame> frames;
    std::vector<Index> begins;
    for (const Part& part : model_.parts) {
      const Box box = box_around(neighbours_.position, part.begin, part.end);
      frames.push_back(HilbertFrame::around(box.low, box.high));
      begins.push_back(part.begin);
    }
    const DeviceArray<HilbertFrame> frame = sent(frames, "set-up");
    const DeviceArray<Index> begin = sent(begins, "set-up");
    const auto parts = static_cast<Index>(begins.size());
    DeviceArray<std::uint64_t> key(static_cast<std::size_t>(n), "places along a curve");
    DeviceArray<Index> order(static_cast<std::size_t>(n), "places along a curve");
    for_each(
        "hilbert_keys", n,
        [parts, begin = begin.data(), frame = frame.data(), key = key.data(), order = order.data(),
         position = neighbours_.position.data()] __device__(std::int64_t k) {
          const auto i = static_cast<Index>(k);
          key[i] = frame[last_before(begin, parts, i)].key_of(position[i]);
          order[i] = i;
        });
    sort_pairs(key, order);
    if (model_.parts.size() > 1) {
      DeviceArray<std::uint32_t> body(static_cast<std::size_t>(n), "set-up");
      for_each("bodies", n,
               [parts, begin = begin.data(), body = body.data(),
                order = order.data()] __device__(std::int64_t k) {
                 body[k] = static_cast<std::uint32_t>(last_before(begin, parts, order[k]));
               });
      sort_pairs(body, order);
    }
    return order;
  }

  void sort_tiles(const DeviceArray<Index>& begins, const DeviceArray<Index>& order,
                  const DeviceArray<Index>& length);

  /// Makes the lists of one pass.
  DeviceTileLists make_lists(const NeighbourSource& near, Index longest) const {
    return find_lists({.near = near,
                       .phyxel_at = out_.phyxel_at.data(),
                       .place_of = place_of_.data(),
                       .tile_begin = tile_begin_.data(),
                       .whole_place = whole_place_.data(),
                       .place_here = place_here_.data(),
                       .here = static_cast<Index>(whole_place_.size()),
                       .tiles = out_.own_tiles,
                       .what = "neighbour lists of " + std::to_string(model_.size()) + " phyxels"},
                      longest);
  }

 private:
  const Model& model_;
  Neighbours neighbours_;
  Index most_neighbours_ = 0;
  DeviceArray<Index> place_of_;    ///< Place of each phyxel in the whole model's tiles.
  DeviceArray<Index> tile_begin_;  ///< First place of each own tile in the whole model's tiles.
  DeviceArray<Index> global_id_;   ///< Global ids of a share; empty for a whole model.
  /// Places of a share in the whole model's tiles, ascending, and the same phyxels' places here.
  DeviceArray<Index> whole_place_, place_here_;
  DeviceTiling out_;
};

/// Sorts the phyxels of a tile by the length of their lists, longest first. One block a tile.
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

}  // namespace

DeviceTiling make_device_tiling(const Model& model) { return Finder(model).find(); }

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
