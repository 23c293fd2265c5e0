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

/// Sorts the entries of each point and body by the patches of the surface, and returns these.
Numbers sort_by_patches(Entries& entries, const Candidates& points) {
  const std::size_t count = entries.keys.size();
  const Numbers sums = running_sums(entries.begins);
  const auto rows = static_cast<std::size_t>(last_of(sums));
  Numbers row(count, name), patch(count, name);
  for_each("number_rows", count_of(count),
           [sums = sums.data(), row = row.data()] __device__(std::int64_t e) {
             row[e] = sums[e + 1] - 1;
           });
  const DeviceArray<Offset> start = starts_of<Offset>(row, rows, name);
  for_each("find_patches", count_of(rows),
           [start = start.data(), near = entries.near.data(), patch = patch.data(),
            points = points.data()] __device__(std::int64_t r) {
             const Offset first = start[r];
             find_patches(
                 static_cast<Index>(start[r + 1] - first),
                 [&](Index k) -> const SurfaceSite& { return points[near[first + k]].site; },
                 [&](Index k) -> Index& { return patch[first + k]; });
           });
  const auto most = static_cast<std::uint64_t>(reduce(patch.data(), count_of(count), 0, Larger{}));
  if (most == 0) return {};
  DeviceArray<std::uint64_t> order(count, name);
  Numbers sorted(count, name);
  for_each("order_patches", count_of(count),
           [row = row.data(), patch = patch.data(), order = order.data(), sorted = sorted.data(),
            most] __device__(std::int64_t e) {
             order[e] = static_cast<std::uint64_t>(row[e]) * (most + 1) +
                        static_cast<std::uint64_t>(patch[e]);
             sorted[e] = static_cast<Index>(e);
           });
  sort_pairs(order, sorted, bits_below(rows * (most + 1)));
  entries.keys = gathered(entries.keys, sorted);
  return gathered(patch, sorted);
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
  const std::size_t n = points.size(), count = keys.size();
  FoundRows found;
  Entries entries = entries_of(std::move(keys), points, by_list, {});
  Numbers patch;
  if (count > 0) patch = sort_by_patches(entries, points);
  if (patch.size() > 0) entries = entries_of(std::move(entries.keys), points, by_list, patch);
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
             rows[row] = row_of(points[p], p, body, patch ? patch[e] : 0,
                                layer.law[layer.partner_of(points[p].body, body)]);
           });
  found.keys = std::move(entries.keys);
  return found;
}

}  // namespace phyxel::cuda
