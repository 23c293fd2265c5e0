#include <algorithm>
#include <cub/block/block_reduce.cuh>
#include <tuple>
#include <utility>

#include "model/parts.hpp"
#include "setup/contact_rows.cuh"
#include "setup/device_touching_points.hpp"
#include "setup/tiling.hpp"
#include "timeline.hpp"

namespace phyxel::cuda {
namespace {

constexpr const char* name = contact_arrays;
constexpr int group_threads = 256;

/// Finds the box of each group of a layer, grown by the ranges of its phyxels. One block per group.
__global__ void find_boxes(const Vec3d* position, const SurfaceSite* site, const Index* begin,
                           const Index* end, Box* boxes) {
  Box box = no_box;
  const AroundBoth around;
  for (Index k = begin[blockIdx.x] + static_cast<Index>(threadIdx.x); k < end[blockIdx.x];
       k += group_threads) {
    box = around(box, grown({position[k], position[k]}, site[k].range));
  }
  using Reduce = cub::BlockReduce<Box, group_threads>;
  __shared__ typename Reduce::TempStorage memory;
  const Box all = Reduce(memory).Reduce(box, around);
  if (threadIdx.x == 0) boxes[blockIdx.x] = all;
}

/// The extent of candidates on the host.
Extent extent_of(const std::vector<ContactCandidate>& points) {
  Extent extent;
  for (const ContactCandidate& point : points) {
    extend(extent.box, point.now);
    extent.range = std::max(extent.range, point.site.range);
  }
  return extent;
}

/// Flags of the candidates of a rank that are in rows.
DeviceArray<char> in_rows(const FoundRows& found, const Candidates& points, int rank) {
  auto flags = cleared<char>(points.size());
  for_each("flag_points", count_of(found.near.size()),
           [points = points.data(), near = found.near.data(), row = found.row_of_entry.data(),
            rows = found.rows.data(), flags = flags.data(), rank] __device__(std::int64_t e) {
             const Index k = near[e], p = rows[row[e]].point;
             if (points[k].rank == rank) flags[k] = 1;
             if (points[p].rank == rank) flags[p] = 1;
           });
  return flags;
}

/// Flags all points of the rows that have a flagged point. @returns flags of the entries of these
/// rows, for one patch alone
DeviceArray<char> spread(const FoundRows& found, const DeviceArray<char>& flags) {
  const std::int64_t entries = count_of(found.near.size());
  const auto touched = cleared<char>(found.rows.size());
  for_each("touch_rows", entries,
           [near = found.near.data(), row = found.row_of_entry.data(), rows = found.rows.data(),
            flags = flags.data(), touched = touched.data()] __device__(std::int64_t e) {
             if (flags[near[e]] || flags[rows[row[e]].point]) touched[row[e]] = 1;
           });
  DeviceArray<char> of_entry(found.near.size(), name);
  for_each("spread_rows", entries,
           [near = found.near.data(), row = found.row_of_entry.data(), rows = found.rows.data(),
            flags = flags.data(), touched = touched.data(),
            of_entry = of_entry.data()] __device__(std::int64_t e) {
             of_entry[e] = touched[row[e]] && rows[row[e]].patch == 0;
             if (touched[row[e]]) flags[near[e]] = flags[rows[row[e]].point] = 1;
           });
  return of_entry;
}

/// Flags of the chosen candidates that a rank steps, or that other ranks step.
DeviceArray<char> flags_of(const DeviceArray<char>& chosen, const Candidates& points, int rank,
                           bool own) {
  DeviceArray<char> flags(points.size(), name);
  for_each(
      "flag_points_of_rank", count_of(points.size()),
      [points = points.data(), chosen = chosen.data(), flags = flags.data(), rank, own] __device__(
          std::int64_t p) { flags[p] = chosen[p] && (points[p].rank == rank) == own; });
  return flags;
}

/// The numbers of flags that are 1, at the front of an array with room for all.
/// @param count receives how many there are, on the device
Numbers flagged_numbers(const DeviceArray<char>& flags, std::int64_t* count) {
  const thrust::counting_iterator<Index> all(0);
  return flagged_of<decltype(all), Index>(all, flags, count);
}

/// Entries of lists by list, each list in the order of the entries. @param list of each entry
/// @param is_sorted true if the lists of the entries ascend already
/// @returns the starts of the lists, and the entries
std::pair<DeviceArray<Offset>, Numbers> grouped(Numbers list, std::size_t lists, bool is_sorted) {
  Numbers entries(list.size(), name);
  for_each("number_entries", count_of(list.size()),
           [entries = entries.data()] __device__(std::int64_t e) {
             entries[e] = static_cast<Index>(e);
           });
  if (list.size() > 0 && !is_sorted) sort_pairs(list, entries, bits_below(lists));
  DeviceArray<Offset> starts = starts_of<Offset>(list, lists, name);
  return {std::move(starts), std::move(entries)};
}

/// Numbers points: those of this rank first. @param own,other numbers of candidates
/// @returns the number of each candidate that is a point
Numbers number_points(const Candidates& points, const Numbers& own, const Numbers& other,
                      Numbers& layer, DeviceTouchingPoints::Lists& lists) {
  const std::size_t count = own.size() + other.size();
  Numbers number(points.size(), name);
  lists.site = {count, name};
  lists.id = {count, name};
  layer = {own.size(), name};
  for_each("number_points", count_of(count),
           [points = points.data(), own = own.data(), other = other.data(),
            owned = count_of(own.size()), number = number.data(), site = lists.site.data(),
            id = lists.id.data(), layer = layer.data()] __device__(std::int64_t k) {
             const Index p = k < owned ? own[k] : other[k - owned];
             number[p] = static_cast<Index>(k);
             site[k] = points[p].site;
             id[k] = points[p].id;
             if (k < owned) layer[k] = points[p].place;
           });
  return number;
}

/// @param ascend true if the numbers of points are in the order of the candidates
void set_lists(const Candidates& points, const Numbers& number, FoundRows found, bool ascend,
               DeviceTouchingPoints::Lists& lists) {
  const std::size_t entries = found.near.size(), rows = found.rows.size();
  Numbers list(entries, name), list_of_point(entries, name);
  for_each("list_entries", count_of(entries),
           [points = points.data(), number = number.data(), near = found.near.data(),
            row = found.row_of_entry.data(), rows = found.rows.data(), list = list.data(),
            of_point = list_of_point.data()] __device__(std::int64_t e) {
             const Index k = near[e];
             list[e] = contact_threads * row[e] + part_of_list(points[k]);
             of_point[e] = contact_threads * number[k] + part_of_list(points[rows[row[e]].point]);
             near[e] = number[k];
           });
  Numbers point(rows, name);
  for_each("renumber_rows", count_of(rows),
           [rows = found.rows.data(), number = number.data(),
            point = point.data()] __device__(std::int64_t r) {
             rows[r].point = number[rows[r].point];
             point[r] = rows[r].point;
           });
  const std::size_t count = lists.site.size();
  lists.near_start = starts_of<Offset>(list, contact_threads * rows, name);
  std::tie(lists.entries_of_start, lists.entries_of) =
      grouped(std::move(list_of_point), contact_threads * count, false);
  std::tie(lists.rows_from_start, lists.rows_from) = grouped(std::move(point), count, ascend);
  lists.rows = std::move(found.rows);
  lists.have_patches = found.have_patches;
  lists.near = std::move(found.near);
  lists.rows_naming = gathered(found.row_of_entry, lists.entries_of);
}

/// Flags of the tiles in which flagged points of this rank are. @param place of the layer
DeviceArray<char> tiles_of(const DeviceArray<char>& flags, const Candidates& points,
                           const Numbers& place, Index tiles) {
  auto used = cleared<char>(static_cast<std::size_t>(tiles));
  for_each("use_tiles", count_of(points.size()),
           [flags = flags.data(), points = points.data(), place = place.data(),
            used = used.data()] __device__(std::int64_t p) {
             if (flags[p]) used[place[points[p].place] / tile_size] = 1;
           });
  return used;
}

/// Arrays of the layer, shape [layer] each.
struct LayerSource {
  const Index *place, *body;
  const Vec3d *rest, *centre;
};

/// Sets the arrays of this rank's points from their numbers in the layer, and from their tiles.
/// @param tiles number of tiles of the model
void set_own(const LayerSource& all, Index tiles, DeviceTouchingPoints::Own& own) {
  const std::size_t count = own.layer.size();
  Numbers number(static_cast<std::size_t>(tiles), name);
  for_each("number_tiles", count_of(own.tiles.size()),
           [tiles = own.tiles.data(), number = number.data()] __device__(std::int64_t t) {
             number[tiles[t]] = static_cast<Index>(t);
           });
  own.place = {count, name};
  own.body = {count, name};
  own.position = {count, name};
  own.centre = {count, name};
  own.entry = {count, name};
  for_each("gather_own", count_of(count),
           [all, layer = own.layer.data(), number = number.data(), place = own.place.data(),
            body = own.body.data(), position = own.position.data(), centre = own.centre.data(),
            entry = own.entry.data()] __device__(std::int64_t p) {
             const Index k = layer[p], slot = all.place[k];
             place[p] = slot;
             body[p] = all.body[k];
             position[p] = all.rest[k];
             centre[p] = all.centre[k];
             entry[p] = number[slot / tile_size] * tile_size + slot % tile_size;
           });
}

}  // namespace

DeviceTouchingPoints::DeviceTouchingPoints(const SurfaceLayer& layer,
                                           const std::vector<Index>& place, Index tiles,
                                           cudaStream_t stream)
    : pool_(std::make_unique<MemoryPool>(stream)), layer_(layer), tiles_(tiles) {
  const Model& model = layer.model();
  std::vector<Index> ids, begin, end;
  std::vector<Vec3d> centres, rest;
  for (const Index i : layer.phyxels()) {
    ids.push_back(model.global_id(i));
    centres.push_back(part_of(model, i).centre);
    rest.push_back(model.position[i]);
  }
  for (const LayerGroup& group : layer.groups()) {
    begin.push_back(static_cast<Index>(group.begin));
    end.push_back(static_cast<Index>(group.end));
  }
  site_ = sent(layer.sites(), name);
  place_ = sent(place, name);
  id_ = sent(ids, name);
  body_ = sent(layer.bodies(), name);
  rest_ = sent(rest, name);
  centre_ = sent(centres, name);
  group_begin_ = sent(begin, name);
  group_end_ = sent(end, name);
}

std::span<const Box> DeviceTouchingPoints::boxes_of_groups(const DeviceArray<Vec3d>& position) {
  const auto groups = static_cast<unsigned>(group_begin_.size());
  if (groups == 0) return {};
  const Phase phase("boxes of bodies");
  const DeviceArray<Box> boxes(groups, name);
  find_boxes<<<groups, group_threads, 0, work_stream()>>>(
      position.data(), site_.data(), group_begin_.data(), group_end_.data(), boxes.data());
  check_launch({"find_boxes", groups, group_threads, name});
  group_boxes_.fetch(boxes, work_stream());
  return group_boxes_.values();
}

// The pinned arrays may change: the search has waited since they were sent before.
void DeviceTouchingPoints::send_reach(const std::vector<double>& skins) {
  const BodyContact& contact = layer_.model().body_contact;
  const auto send = [](auto& pinned, const auto& values, auto& array) {
    pinned.resize(values.size());
    std::copy(values.begin(), values.end(), pinned.data());
    if (array.size() != values.size()) array = {values.size(), name};
    pinned.send(array, work_stream());
  };
  const Csr& partners = reach_.partners;
  std::vector<ContactLaw> laws;
  laws.reserve(partners.indices.size());
  for (Index b = 0; b < partners.rows(); ++b) {
    for (const Index other : partners.row(b)) laws.push_back(*contact.law_of(b, other));
  }
  send(sent_box_, reach_.boxes, box_);
  send(sent_start_, partners.offsets, partner_start_);
  send(sent_partner_, partners.indices, partner_);
  send(sent_law_, laws, partner_law_);
  send(sent_skin_, skins, skin_);
}

LayerView DeviceTouchingPoints::view(const DeviceArray<Vec3d>& position, double most_skin) const {
  const Share* const share = layer_.model().share.get();
  return {position.data(),
          site_.data(),
          gain_.data(),
          id_.data(),
          body_.data(),
          box_.data(),
          partner_start_.data(),
          partner_.data(),
          partner_law_.data(),
          skin_.data(),
          most_skin,
          share ? share->communicator->rank() : 0};
}

void DeviceTouchingPoints::find(const DeviceArray<Vec3d>& position, double dt,
                                const std::vector<double>& skins) {
  const Phase phase("points that may touch");
  const PooledMemory pooled(*pool_);
  pool_->begin_round();
  if (dt != dt_) {
    gain_ = sent(layer_.gains(dt), name);
    dt_ = dt;
  }
  reach_ = layer_.reach_of(boxes_of_groups(position), skins, near_bodies_);
  send_reach(skins);
  const Model& model = layer_.model();
  const LayerView layer = view(position, *std::ranges::max_element(skins));
  Phase part("points near other bodies");
  facts_.clear();
  Candidates points = candidates_of(layer, position.size(), facts_);
  Extent extent = facts_.last().extent;
  if (model.share) {
    const std::vector<ContactCandidate> all = of_all_ranks(model, fetched(points));
    extent = extent_of(all);
    points = sent(all, name);
  }
  part.next("points near each other");
  const Numbers by_list = in_list_order(points, reach_.boxes.size());
  DeviceArray<std::uint64_t> keys =
      entries_among(points, layer, by_list, extent, facts_, entry_room_);
  part.next("rows of points");
  FoundRows found = rows_of(std::move(keys), points, layer, by_list, facts_);
  any_ = found.rows.size() > 0;
  const DeviceArray<char> chosen = in_rows(found, points, layer.rank);
  if (model.share) {  // as of `phyxel::TouchingPoints`
    spread(found, chosen);
    const DeviceArray<char> kept = spread(found, chosen);
    found = rows_of(flagged<const std::uint64_t*, std::uint64_t>(found.keys.data(), kept), points,
                    layer, by_list, facts_);
  }
  part.next("lists of points");
  set_points(points, chosen, std::move(found), layer.rank);
}

void DeviceTouchingPoints::set_points(const Candidates& points, const DeviceArray<char>& chosen,
                                      FoundRows found, int rank) {
  const bool is_share = layer_.model().share != nullptr;
  const DeviceArray<char> are_own = flags_of(chosen, points, rank, true);
  facts_.clear();
  SearchFacts* const facts = facts_.view();
  Numbers own = flagged_numbers(are_own, &facts->own), other;
  if (is_share) other = flagged_numbers(flags_of(chosen, points, rank, false), &facts->other);
  own_.tiles = flagged_numbers(tiles_of(are_own, points, place_, tiles_), &facts->tiles);
  const SearchFacts& counted = facts_.read();
  own.keep_first(static_cast<std::size_t>(counted.own));
  other.keep_first(static_cast<std::size_t>(counted.other));
  own_.tiles.keep_first(static_cast<std::size_t>(counted.tiles));
  const Numbers number = number_points(points, own, other, own_.layer, lists_);
  set_lists(points, number, std::move(found), !is_share, lists_);
  set_own({place_.data(), body_.data(), rest_.data(), centre_.data()}, tiles_, own_);
  if (is_share) plan_exchange(points, other);
}

void DeviceTouchingPoints::plan_exchange(const Candidates& points, const Numbers& other) {
  const Communicator& ranks = *layer_.model().share->communicator;
  std::vector<std::vector<Index>> wanted(static_cast<std::size_t>(ranks.size()));
  std::vector<std::vector<Index>> receive(wanted.size());
  const std::vector<ContactCandidate> all = fetched(points);
  auto next = static_cast<Index>(own_.layer.size());
  for (const Index p : fetched(other)) {
    wanted[all[p].rank].push_back(all[p].place);
    receive[all[p].rank].push_back(next++);
  }
  exchange_ = {ranks, wanted, std::move(receive), fetched(own_.layer)};
}

DeviceArray<double> DeviceTouchingPoints::wave_moduli() {
  const PooledMemory pooled(*pool_);
  if (modulus_.size() == 0) modulus_ = sent(layer_.wave_moduli(), name);
  DeviceArray<double> own = gathered(modulus_, own_.layer);
  if (!layer_.model().share) return own;
  std::vector<double> all = fetched(own);
  all.resize(lists_.site.size());
  exchange_.refresh(all);
  return sent(all, name);
}

DeviceArray<double> DeviceTouchingPoints::regains(double dt) {
  const PooledMemory pooled(*pool_);
  if (dt != regain_dt_) {
    regain_ = sent(layer_.regains(dt), name);
    regain_dt_ = dt;
  }
  return gathered(regain_, own_.layer);
}

std::size_t DeviceTouchingPoints::bytes() const {
  const auto sum = [](const auto&... arrays) { return (arrays.bytes() + ...); };
  return pool_->idle_bytes() +
         sum(own_.layer, own_.place, own_.tiles, own_.entry, own_.body, own_.position, own_.centre,
             lists_.site, lists_.id, lists_.rows, lists_.near, lists_.rows_naming,
             lists_.entries_of, lists_.rows_from, lists_.near_start, lists_.entries_of_start,
             lists_.rows_from_start, site_, gain_, modulus_, regain_, place_, id_, body_, rest_,
             centre_, group_begin_, group_end_, box_, partner_start_, partner_, partner_law_);
}

}  // namespace phyxel::cuda
