// Compiled without fused multiplications, so that neighbours are those of the CPU.
#include <algorithm>

#include "model/space_filling_curve.hpp"
#include "phyxel/physics/moment.hpp"
#include "phyxel/physics/weight.hpp"
#include "setup/device_lists.cuh"

namespace phyxel::cuda {
namespace {

// --- lists copied from the host --------------------------------------------------------------

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

// --- lists found on the device ---------------------------------------------------------------

/// Input of the neighbour search.
struct SearchCloud {
  DeviceArray<Vec3d> position;  ///< Rest positions [m], shape [n].
  DeviceArray<double> support;  ///< [m], shape [n].
  std::vector<DeviceHash::Body> bodies;
  std::vector<double> largest_support;  ///< Largest support of each body [m].
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

/// Builder of a model's tiles by a neighbour search on the device.
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

  /// Length of each phyxel's list, shape [n].
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

  /// Assigns places as `make_tiling` does: bodies one after the other along the curve, each from
  /// the start of a tile; within a tile, phyxels with long lists first.
  void place_phyxels() {
    const Index n = model_.size();
    const DeviceArray<Index> length = count(nullptr);
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

  void find_moments() {
    const auto places = out_.phyxel.size();
    out_.inverse_moment = {places, "inverse moments"};
    out_.moment_offset = {places, "moments"};
    out_.inverse_moment.clear();
    out_.moment_offset.clear();
    const HashView hash = table_.view();
    for_each("moments", static_cast<std::int64_t>(out_.own_tiles) * tile_size,
             [hash, global_id = global_id_.data(), phyxel_at = out_.phyxel_at.data(),
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
                 in_ascending_order(global_id, each, [&](Index j) {
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

  /// Finds the lists of one pass.
  /// @param inverse_reach null for lists of neighbours
  DeviceTileLists make_lists(const double* inverse_reach, Index longest) const {
    return find_lists({.hash = table_.view(),
                       .position = cloud_.position.data(),
                       .support = cloud_.support.data(),
                       .inverse_reach = inverse_reach,
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
  SearchCloud cloud_;
  DeviceHash table_;
  DeviceArray<double> largest_support_;
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
