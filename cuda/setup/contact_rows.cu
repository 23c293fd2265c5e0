#include <utility>

#include "setup/contact_rows.cuh"
#include "setup/device_hash.cuh"

namespace phyxel::cuda {
namespace {

constexpr const char* name = contact_arrays;

/// The input of the search for entries.
struct Near {
  LayerView layer;
  HashView hash;
  const ContactCandidate* points;
  double reach;

  /// Calls visit(k) for each candidate in the lists of a point.
  template <class Visit>
  __device__ void each(Index p, Visit&& visit) const {
    const ContactCandidate& point = points[p];
    const Vec3d now = point.now;
    hash.visit_near(0, now, reach, [&](std::uint32_t entry, const Vec3d& there) {
      // Most entries of the cells are too far from any point to be looked at.
      if (const Vec3d way = there - now; dot(way, way) > reach * reach) return;
      const Index k = hash.index[entry];
      const ContactCandidate& other = points[k];
      if (!is_near(point, other, layer.skin)) return;
      if (layer.partner_of(point.body, other.body) >= 0) visit(k);
    });
  }
};

struct RangeOf {
  const ContactCandidate* points;
  __device__ double operator()(std::int64_t p) const { return points[p].site.range; }
};

/// Entries, and flags of the first entry of each row.
struct Entries {
  DeviceArray<std::uint64_t> keys;
  Numbers near;    ///< Their candidates.
  Numbers begins;  ///< 1 at the first entry of a row, else 0.
};

/// Entries in rows by points and bodies, and by patches if they have some.
Entries entries_of(DeviceArray<std::uint64_t> keys, const Candidates& points,
                   const Numbers& by_list, const Numbers& patch) {
  const std::size_t entries = keys.size();
  Entries found{std::move(keys), {entries, name}, {entries, name}};
  for_each("begin_rows", count_of(entries),
           [keys = found.keys.data(), near = found.near.data(), begins = found.begins.data(),
            points = points.data(), by_list = by_list.data(), patch = patch.data(),
            n = points.size()] __device__(std::int64_t e) {
             const Index k = by_list[keys[e] % n];
             near[e] = k;
             begins[e] = e == 0 || keys[e - 1] / n != keys[e] / n ||
                         points[by_list[keys[e - 1] % n]].body != points[k].body ||
                         (patch && patch[e - 1] != patch[e]);
           });
  return found;
}

/// Repeats the entries of each point and body for each of its patches, if there are some, and
/// returns the patches; none if no point is beside several.
Numbers repeat_for_patches(Entries& entries, const Candidates& points) {
  const std::size_t count = entries.keys.size();
  const Numbers sums = running_sums(entries.begins);
  const auto rows = static_cast<std::size_t>(last_of(sums));
  Numbers row(count, name);
  for_each("number_rows", count_of(count),
           [sums = sums.data(), row = row.data()] __device__(std::int64_t e) {
             row[e] = sums[e + 1] - 1;
           });
  const DeviceArray<Offset> start = starts_of<Offset>(row, rows, name);
  const auto divided = cleared<char>(rows);
  for_each("divide_rows", count_of(count),
           [start = start.data(), row = row.data(), keys = entries.keys.data(),
            near = entries.near.data(), points = points.data(), divided = divided.data(),
            n = points.size()] __device__(std::int64_t e) {
             const Index r = row[e];
             const Offset first = start[r];
             if (is_far_from_others(points[keys[e] / n].site.range, points[near[e]].site,
                                    start[r + 1] - first, [&](Offset k) -> const SurfaceSite& {
                                      return points[near[first + k]].site;
                                    })) {
               divided[r] = 1;
             }
           });
  DeviceArray<Offset> copies(rows, name);  // entries of all patches of a row
  for_each("count_patches", count_of(rows),
           [start = start.data(), divided = divided.data(),
            copies = copies.data()] __device__(std::int64_t r) {
             copies[r] = (divided[r] ? most_patches : 1) * (start[r + 1] - start[r]);
           });
  const DeviceArray<Offset> first = running_sums(copies);
  const auto all = static_cast<std::size_t>(last_of(first));
  if (all == count) return {};
  DeviceArray<std::uint64_t> keys(all, name);
  Numbers patch(all, name);
  for_each("repeat_entries", count_of(count),
           [start = start.data(), row = row.data(), divided = divided.data(), first = first.data(),
            old = entries.keys.data(), keys = keys.data(),
            patch = patch.data()] __device__(std::int64_t e) {
             const Index r = row[e];
             const Offset size = start[r + 1] - start[r];
             for (int p = 0; p < (divided[r] ? most_patches : 1); ++p) {
               const Offset at = first[r] + p * size + e - start[r];
               keys[at] = old[e];
               patch[at] = p;
             }
           });
  entries.keys = std::move(keys);
  return patch;
}

}  // namespace

Candidates candidates_of(const LayerView& layer, std::size_t count) {
  DeviceArray<char> flags(count, name);
  for_each("choose_candidates", count_of(count),
           [layer, flags = flags.data()] __device__(std::int64_t k) {
             flags[k] = layer.is_near_others(static_cast<Index>(k));
           });
  const Numbers chosen = flagged_numbers(flags);
  Candidates some(chosen.size(), name);
  for_each("make_candidates", count_of(chosen.size()),
           [layer, chosen = chosen.data(), some = some.data()] __device__(std::int64_t c) {
             const Index k = chosen[c];
             ContactCandidate& made = some[c];
             made.now = layer.position[k];
             made.site = layer.site[k];
             made.site.mobility = layer.gain[k] * made.site.mobility;
             made.id = layer.id[k];
             made.body = layer.body[k];
             made.rank = layer.rank;
             made.place = k;
           });
  return some;
}

Numbers in_list_order(const Candidates& points, std::size_t bodies) {
  DeviceArray<std::uint64_t> list(points.size(), name);
  Numbers by_list(points.size(), name);
  for_each("list_candidates", count_of(points.size()),
           [points = points.data(), list = list.data(),
            by_list = by_list.data()] __device__(std::int64_t p) {
             list[p] = static_cast<std::uint64_t>(points[p].body) * contact_threads +
                       static_cast<std::uint64_t>(part_of_list(points[p]));
             by_list[p] = static_cast<Index>(p);
           });
  if (points.size() > 0) sort_pairs(list, by_list, bits_below(contact_threads * bodies));
  return by_list;
}

DeviceArray<std::uint64_t> entries_among(const Candidates& points, const LayerView& layer,
                                         const Numbers& by_list) {
  const std::size_t n = points.size();
  if (n == 0) return {};
  DeviceArray<Vec3d> now(n, name);
  Numbers order(n, name);
  for_each("place_candidates", count_of(n),
           [points = points.data(), now = now.data(), by_list = by_list.data(),
            order = order.data()] __device__(std::int64_t p) {
             now[p] = points[p].now;
             order[by_list[p]] = static_cast<Index>(p);
           });
  const thrust::transform_iterator ranges(thrust::counting_iterator<std::int64_t>(0),
                                          RangeOf{points.data()});
  const double reach = reduce(ranges, count_of(n), 0.0, Larger{}) + layer.skin;
  const DeviceHash hash(now, {{0, static_cast<Index>(n), reach}});
  const Near near{layer, hash.view(), points.data(), reach};
  DeviceArray<Offset> count(n, name);
  for_each("count_entries", count_of(n), [near, count = count.data()] __device__(std::int64_t p) {
    Offset own = 0;
    near.each(static_cast<Index>(p), [&](Index) { ++own; });
    count[p] = own;
  });
  const DeviceArray<Offset> start = running_sums(count);
  DeviceArray<std::uint64_t> keys(static_cast<std::size_t>(last_of(start)), name);
  for_each("find_entries", count_of(n),
           [near, start = start.data(), order = order.data(), keys = keys.data(),
            n] __device__(std::int64_t p) {
             Offset next = start[p];
             near.each(static_cast<Index>(p), [&](Index k) {
               keys[next++] =
                   static_cast<std::uint64_t>(p) * n + static_cast<std::uint64_t>(order[k]);
             });
           });
  if (keys.size() > 0) sort_values(keys, bits_below(n * n));
  return keys;
}

FoundRows rows_of(DeviceArray<std::uint64_t> keys, const Candidates& points, const LayerView& layer,
                  const Numbers& by_list) {
  const std::size_t n = points.size();
  FoundRows found;
  Entries entries = entries_of(std::move(keys), points, by_list, {});
  Numbers patch;
  if (entries.keys.size() > 0) patch = repeat_for_patches(entries, points);
  if (patch.size() > 0) entries = entries_of(std::move(entries.keys), points, by_list, patch);
  const std::size_t count = entries.keys.size();
  const Numbers sums = running_sums(entries.begins);
  found.near = std::move(entries.near);
  found.row_of_entry = {count, name};
  found.rows = {static_cast<std::size_t>(last_of(sums)), name};
  for_each("make_rows", count_of(count),
           [layer, keys = entries.keys.data(), near = found.near.data(),
            begins = entries.begins.data(), patch = patch.data(), sums = sums.data(),
            points = points.data(), row_of_entry = found.row_of_entry.data(),
            rows = found.rows.data(), n] __device__(std::int64_t e) {
             const Index row = sums[e + 1] - 1;
             row_of_entry[e] = row;
             if (!begins[e]) return;
             const auto p = static_cast<Index>(keys[e] / n);
             const Index body = points[near[e]].body;
             rows[row] = row_of(points[p], p, body, patch ? patch[e] : 0, 1,
                                layer.law[layer.partner_of(points[p].body, body)]);
           });
  found.have_patches = patch.size() > 0;
  if (found.have_patches) {
    for_each(
        "set_patches", count_of(found.rows.size()),
        [rows = found.rows.data(), all = count_of(found.rows.size())] __device__(std::int64_t r) {
          const bool is_divided = rows[r].patch > 0 || (r + 1 < all && rows[r + 1].patch > 0);
          if (is_divided) rows[r].patches = most_patches;
        });
  }
  found.keys = std::move(entries.keys);
  return found;
}

}  // namespace phyxel::cuda
