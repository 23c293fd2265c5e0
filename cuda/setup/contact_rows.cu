#include <cooperative_groups.h>
#include <cooperative_groups/scan.h>

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
  const Index* body;  ///< The body of each candidate.
  double range;       ///< The largest one [m].

  /// Calls visit(k) for each candidate in the lists of a point, by one of the threads that share
  /// it.
  template <class Visit>
  __device__ void each(Index p, int thread, int threads, Visit&& visit) const {
    const ContactCandidate& point = points[p];
    const Vec3d now = point.now;
    const double reach = range + layer.skins[point.body];
    const bool touches_itself = layer.partner_of(point.body, point.body) >= 0;
    const auto look = [&](std::uint32_t entry, const Vec3d& there) {
      // Most entries of the cells are too far from any point to be looked at.
      if (const Vec3d way = there - now; dot(way, way) > reach * reach) return;
      const Index k = hash.index[entry];
      // Most of the others are of the same body.
      if (body[k] == point.body && !touches_itself) return;
      const ContactCandidate& other = points[k];
      if (!is_near(point, other, layer.skins)) return;
      if (layer.partner_of(point.body, other.body) >= 0) visit(k);
    };
    hash.visit_part_of_near(0, now, reach, thread, threads, look);
  }
};

/// Finds the entries of points, in any order, and counts them: some threads for each point. A warp
/// asks for places in memory once, since all threads count with the same number.
struct FindEntries {
  static constexpr int threads = 8;  ///< Of a point.

  Near near;
  const Index* order;  ///< Place of each candidate in `by_list`.
  std::uint64_t points;
  std::uint64_t* keys;  ///< Receives as many entries as there is room for.
  std::uint64_t room;
  unsigned long long* count;  ///< Receives the number of all entries.

  __device__ void operator()(std::int64_t i) const {
    constexpr int most = 16;
    const std::int64_t p = i / threads;
    std::uint64_t some[most];
    int held = 0;
    const auto put = [&](unsigned long long first) {
      for (int e = 0; e < held; ++e) {
        if (first + e < room) keys[first + e] = some[e];
      }
      held = 0;
    };
    near.each(static_cast<Index>(p), static_cast<int>(i % threads), threads, [&](Index k) {
      some[held++] = static_cast<std::uint64_t>(p) * points + static_cast<std::uint64_t>(order[k]);
      if (held == most) put(atomicAdd(count, static_cast<unsigned long long>(most)));
    });
    const auto warp = cooperative_groups::coalesced_threads();
    const int before = cooperative_groups::exclusive_scan(warp, held);
    unsigned long long first = 0;
    if (warp.thread_rank() + 1 == warp.size()) {
      first = atomicAdd(count, static_cast<unsigned long long>(before + held));
    }
    put(warp.shfl(first, warp.size() - 1) + static_cast<unsigned long long>(before));
  }
};

/// The extent of a phyxel of the layer; of none if it is no candidate.
struct ExtentOf {
  LayerView layer;
  const char* is_candidate;
  __device__ Extent operator()(std::int64_t k) const {
    if (!is_candidate[k]) return {no_box, 0};
    return {{layer.position[k], layer.position[k]}, layer.site[k].range};
  }
};
struct ExtentOfBoth {
  __host__ __device__ Extent operator()(const Extent& a, const Extent& b) const {
    return {AroundBoth{}(a.box, b.box), Larger{}(a.range, b.range)};
  }
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

/// Rows of entries before they are divided into patches. Arrays have room for a row per entry.
struct WholeRows {
  Numbers row;                ///< The row of each entry.
  DeviceArray<Offset> start;  ///< The first entry of each row, and the end of the last row.
  DeviceArray<char> divided;  ///< 1 for rows of points beside several patches, else 0.
};

/// Finds the rows of entries and those that are divided. Sets the numbers of both among the facts.
/// @param sums of `Entries::begins`
WholeRows whole_rows_of(const Entries& entries, const Numbers& sums, const Candidates& points,
                        SearchFacts* facts) {
  const std::size_t count = entries.keys.size();
  WholeRows whole{{count, name}, {count + 1, name}, cleared<char>(count)};
  for_each("number_rows", count_of(count),
           [sums = sums.data(), begins = entries.begins.data(), row = whole.row.data(),
            start = whole.start.data(), facts, count] __device__(std::int64_t e) {
             const Index r = sums[e + 1] - 1;
             row[e] = r;
             if (begins[e]) start[r] = e;
             if (e + 1 < static_cast<std::int64_t>(count)) return;
             start[r + 1] = e + 1;
             facts->rows = r + 1;
           });
  for_each("divide_rows", count_of(count),
           [start = whole.start.data(), row = whole.row.data(), keys = entries.keys.data(),
            near = entries.near.data(), points = points.data(), divided = whole.divided.data(),
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
  for_each("count_divided", count_of(count),
           [start = whole.start.data(), divided = whole.divided.data(),
            facts] __device__(std::int64_t r) {
             if (!divided[r]) return;
             atomicAdd(&facts->divided, 1ull);
             atomicAdd(&facts->repeated, static_cast<unsigned long long>(
                                             (most_patches - 1) * (start[r + 1] - start[r])));
           });
  return whole;
}

/// Repeats the entries of divided rows for each patch. @returns the patches of the entries
/// @param rows number of rows. @param more entries that patches have more than the rows
Numbers repeat_for_patches(Entries& entries, const WholeRows& whole, std::size_t rows,
                           std::size_t more) {
  const std::size_t count = entries.keys.size(), all = count + more;
  const Numbers& row = whole.row;
  const DeviceArray<Offset>& start = whole.start;
  const DeviceArray<char>& divided = whole.divided;
  DeviceArray<Offset> copies(rows, name);  // entries of all patches of a row
  for_each("count_patches", count_of(rows),
           [start = start.data(), divided = divided.data(),
            copies = copies.data()] __device__(std::int64_t r) {
             copies[r] = (divided[r] ? most_patches : 1) * (start[r + 1] - start[r]);
           });
  const DeviceArray<Offset> first = running_sums(copies);
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

Candidates candidates_of(const LayerView& layer, std::size_t count, FactsOnDevice& facts) {
  DeviceArray<char> flags(count, name);
  for_each("choose_candidates", count_of(count),
           [layer, flags = flags.data()] __device__(std::int64_t k) {
             flags[k] = layer.is_near_others(static_cast<Index>(k));
           });
  const thrust::counting_iterator<Index> all(0);
  const auto chosen = flagged_of<decltype(all), Index>(all, flags, &facts.view()->candidates);
  const thrust::transform_iterator extents(thrust::counting_iterator<std::int64_t>(0),
                                           ExtentOf{layer, flags.data()});
  reduce_into(&facts.view()->extent, extents, count_of(count), Extent{}, ExtentOfBoth{});
  Candidates some(static_cast<std::size_t>(facts.read().candidates), name);
  for_each("make_candidates", count_of(some.size()),
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
  DeviceArray<std::uint32_t> list(points.size(), name);
  Numbers by_list(points.size(), name);
  for_each("list_candidates", count_of(points.size()),
           [points = points.data(), list = list.data(),
            by_list = by_list.data()] __device__(std::int64_t p) {
             list[p] = static_cast<std::uint32_t>(points[p].body) * contact_threads +
                       static_cast<std::uint32_t>(part_of_list(points[p]));
             by_list[p] = static_cast<Index>(p);
           });
  if (points.size() > 0) sort_pairs(list, by_list, bits_below(contact_threads * bodies));
  return by_list;
}

DeviceArray<std::uint64_t> entries_among(const Candidates& points, const LayerView& layer,
                                         const Numbers& by_list, const Extent& extent,
                                         FactsOnDevice& facts, std::size_t& room) {
  const std::size_t n = points.size();
  if (n == 0) return {};
  DeviceArray<Vec3d> now(n, name);
  Numbers order(n, name), body(n, name);
  for_each("place_candidates", count_of(n),
           [points = points.data(), now = now.data(), body = body.data(), by_list = by_list.data(),
            order = order.data()] __device__(std::int64_t p) {
             now[p] = points[p].now;
             body[p] = points[p].body;
             order[by_list[p]] = static_cast<Index>(p);
           });
  const DeviceHash hash(now, extent.box, extent.range + layer.most_skin);
  const Near near{layer, hash.view(), points.data(), body.data(), extent.range};
  if (room == 0) room = n;
  DeviceArray<std::uint64_t> keys;
  for (bool had_room = false; !had_room;) {
    keys = {};
    keys = {room, name};
    facts.clear();
    for_each("find_entries", FindEntries::threads * count_of(n),
             FindEntries{near, order.data(), n, keys.data(), room, &facts.view()->entries});
    const auto count = static_cast<std::size_t>(facts.read().entries);
    had_room = count <= room;
    if (had_room) keys.keep_first(count);
    if (!had_room || 4 * count < room) room = count + count / 4 + 1;
  }
  if (keys.size() > 0) sort_values(keys, bits_below(n * n));
  return keys;
}

FoundRows rows_of(DeviceArray<std::uint64_t> keys, const Candidates& points, const LayerView& layer,
                  const Numbers& by_list, FactsOnDevice& facts) {
  const std::size_t n = points.size();
  FoundRows found;
  facts.clear();
  Entries entries = entries_of(std::move(keys), points, by_list, {});
  Numbers sums = running_sums(entries.begins), patch;
  const WholeRows whole = whole_rows_of(entries, sums, points, facts.view());
  const SearchFacts& counted = facts.read();
  const auto rows = static_cast<std::size_t>(counted.rows),
             divided = static_cast<std::size_t>(counted.divided);
  if (divided > 0) {
    patch = repeat_for_patches(entries, whole, rows, static_cast<std::size_t>(counted.repeated));
    entries = entries_of(std::move(entries.keys), points, by_list, patch);
    sums = running_sums(entries.begins);
  }
  const std::size_t count = entries.keys.size();
  found.near = std::move(entries.near);
  found.row_of_entry = {count, name};
  found.rows = {rows + (most_patches - 1) * divided, name};
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
