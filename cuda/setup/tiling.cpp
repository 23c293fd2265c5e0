#include "setup/tiling.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <exception>
#include <numeric>
#include <span>
#include <utility>

#include "model/space_filling_curve.hpp"
#include "parallel_sort.hpp"
#include "phyxel/error.hpp"
#include "setup/wait_free.hpp"
#include "tabulated.hpp"

namespace phyxel::cuda {
namespace {

void find_places(Tiling& tiling) {
#pragma omp parallel for schedule(static)
  for (Index place = 0; place < tiling.places(); ++place) {
    if (tiling.phyxel[place] >= 0) tiling.place[tiling.phyxel[place]] = place;
  }
}

/// Assigns places to bodies one after the other, each from the start of a tile.
void place_phyxels(const Model& model, Tiling& tiling) {
  const Csr& lists = model.neighbourhood.neighbours;
  tiling.place.resize(static_cast<std::size_t>(model.size()));
  for (std::size_t p = 0; p < model.parts.size(); ++p) {
    const Part& part = model.parts[p];
    std::vector<Index> order = curve_order(model.position, part.begin, part.end);
    for (std::size_t begin = 0; begin < order.size(); begin += tile_size) {
      const auto first = order.begin() + static_cast<std::ptrdiff_t>(begin);
      const auto last =
          order.begin() + static_cast<std::ptrdiff_t>(std::min(begin + tile_size, order.size()));
      order_in_tile({first, last}, [&](Index i) { return lists.length(i); });
      tiling.part.push_back(static_cast<Index>(p));
      tiling.phyxel.insert(tiling.phyxel.end(), first, last);
      tiling.phyxel.resize(tiling.part.size() * tile_size, -1);
    }
  }
  tiling.own_tiles = tiling.tiles();
  find_places(tiling);
}

/// For each phyxel 1 if it needs a ghost in either pass, else 0.
std::vector<char> reach_ghosts(const Model& model) {
  std::vector<char> reaches(static_cast<std::size_t>(model.size()), 0);
  const auto is_ghost = [&](Index j) { return !model.owns(j); };
  for (Index i = 0; i < model.size(); ++i) {
    const auto near = model.neighbourhood.neighbours.row(i),
               inverse = model.neighbourhood.inverse().row(i);
    reaches[i] = std::any_of(near.begin(), near.end(), is_ghost) ||
                 std::any_of(inverse.begin(), inverse.end(), is_ghost);
  }
  return reaches;
}

}  // namespace

void place_share(const Model& model, const std::vector<char>& reaches_ghosts, Tiling& tiling) {
  const std::vector<Index>& whole = model.share->place;
  tiling.place.resize(static_cast<std::size_t>(model.size()));
  const auto sorted = [&](Index begin, Index end) {
    using Placed = std::pair<Index, Index>;
    auto pairs = in_bulk(static_cast<std::size_t>(end - begin), [&](std::size_t k) {
      const Index i = begin + static_cast<Index>(k);
      return Placed{whole[i], i};
    });
    parallel_sort(pairs);
    return in_bulk(pairs.size(), [&](std::size_t k) { return pairs[k].second; });
  };
  // Own phyxels, by tiles of the whole model.
  Bulk<Index> own;
  std::vector<Index> begin, part_of;  // first own phyxel and part of each tile
  for (std::size_t p = 0; p < model.parts.size(); ++p) {
    const Bulk<Index> of_part = sorted(model.parts[p].begin, model.parts[p].owned_end());
    const auto before = static_cast<Index>(own.size());
    for (const Index k : chosen(0, static_cast<Index>(of_part.size()), [&](Index k) {
           return k == 0 || whole[of_part[k]] / tile_size != whole[of_part[k - 1]] / tile_size;
         })) {
      begin.push_back(before + k);
      part_of.push_back(static_cast<Index>(p));
    }
    own.insert(own.end(), of_part.begin(), of_part.end());
  }
  const auto tiles = static_cast<Index>(begin.size());
  begin.push_back(static_cast<Index>(own.size()));
  const auto at_boundary = in_bulk(part_of.size(), [&](std::size_t t) -> char {
    return std::any_of(own.begin() + begin[t], own.begin() + begin[t + 1],
                       [&](Index i) { return reaches_ghosts[i]; });
  });
  std::vector<Index> order = chosen(0, tiles, [&](Index t) { return at_boundary[t]; });
  tiling.boundary_tiles = static_cast<Index>(order.size());
  const std::vector<Index> inside = chosen(0, tiles, [&](Index t) { return !at_boundary[t]; });
  order.insert(order.end(), inside.begin(), inside.end());
  tiling.phyxel.assign(order.size() * tile_size, -1);
  tiling.part = tabulated(order.size(), [&](std::size_t t) { return part_of[order[t]]; });
#pragma omp parallel for schedule(static)
  for (Index t = 0; t < tiles; ++t) {
    for (Index k = begin[order[t]]; k < begin[order[t] + 1]; ++k) {
      tiling.phyxel[t * tile_size + whole[own[k]] % tile_size] = own[k];
    }
  }
  tiling.own_tiles = tiles;
  for (std::size_t p = 0; p < model.parts.size(); ++p) {
    std::size_t next = 0;  // number of ghosts placed
    for (const Index i : sorted(model.parts[p].owned_end(), model.parts[p].end)) {
      if (next % tile_size == 0) {
        tiling.part.push_back(static_cast<Index>(p));
        tiling.phyxel.resize(tiling.part.size() * tile_size, -1);
      }
      tiling.phyxel[(tiling.part.size() - 1) * tile_size + next++ % tile_size] = i;
    }
  }
  find_places(tiling);
}

std::vector<Index> numbers_at(const Model& model, const std::vector<Index>& phyxel) {
  return tabulated(phyxel.size(), [&](std::size_t place) {
    return phyxel[place] < 0 ? -1 : model.global_id(phyxel[place]);
  });
}

namespace {

/// The place in the whole model's tiles of the phyxel at each place, by which halos are ordered.
std::vector<Index> orders_of(const Model& model, const Tiling& tiling) {
  std::vector<Index> order(tiling.phyxel.size());
  std::iota(order.begin(), order.end(), 0);
  if (!model.share) return order;
  for (std::size_t place = 0; place < order.size(); ++place) {
    if (tiling.phyxel[place] >= 0) order[place] = model.share->place[tiling.phyxel[place]];
  }
  return order;
}

/// The halo and the lists of a tile.
struct TileRows {
  std::vector<Index> halo;
  /// Ordered slots of each place; lists of a warp have the same length.
  std::array<std::vector<std::uint16_t>, tile_size> slots;
};

/// Builds the halo and the lists of a tile.
/// @param order place in the whole model's tiles of each place, by which the halo is sorted
TileRows rows_of_tile(const Csr& lists, const Tiling& tiling, const std::vector<Index>& order,
                      Index tile) {
  const Index begin = tile * tile_size, end = begin + tile_size;
  TileRows rows;
  for (Index place = begin; place < end; ++place) {
    if (tiling.phyxel[place] < 0) continue;
    for (const Index j : lists.row(tiling.phyxel[place])) {
      const Index other = tiling.place[j];
      if (other < begin || other >= end) rows.halo.push_back(other);
    }
  }
  const auto earlier = [&](Index a, Index b) { return order[a] < order[b]; };
  std::sort(rows.halo.begin(), rows.halo.end(), earlier);
  rows.halo.erase(std::unique(rows.halo.begin(), rows.halo.end()), rows.halo.end());
  if (rows.halo.size() > most_halo) refuse_halo(static_cast<int>(rows.halo.size()));
  const auto slot_of = [&](Index place) {
    if (place >= begin && place < end) return static_cast<std::uint16_t>(place - begin);
    const auto at = std::lower_bound(rows.halo.begin(), rows.halo.end(), place, earlier);
    return static_cast<std::uint16_t>(tile_size + far_slots + (at - rows.halo.begin()));
  };
  for (int first = 0; first < tile_size; first += team) {
    int length[team], longest = 0;
    for (int lane = 0; lane < team; ++lane) {
      const Index i = tiling.phyxel[begin + first + lane];
      length[lane] = i < 0 ? 0 : lists.length(i);
      longest = std::max(longest, length[lane]);
    }
    std::vector<std::uint16_t> given(static_cast<std::size_t>(team) * longest),
        ordered(static_cast<std::size_t>(team) * team * longest);
    for (int lane = 0; lane < team; ++lane) {
      if (length[lane] == 0) continue;
      std::uint16_t* at = given.data() + lane * longest;
      for (const Index j : lists.row(tiling.phyxel[begin + first + lane])) {
        *at++ = slot_of(tiling.place[j]);
      }
      std::sort(at - length[lane], at, earlier_slot);
    }
    const int capacity = team * longest;
    const int steps =
        order_wait_free(given.data(), longest, length, tile_size, ordered.data(), capacity);
    for (int lane = 0; lane < team; ++lane) {
      const std::uint16_t* from = ordered.data() + lane * capacity;
      rows.slots[first + lane].assign(from, from + steps);
    }
  }
  for (int first = 0; first < tile_size; first += warp_size) {
    std::size_t longest = 0;
    for (int l = 0; l < warp_size; ++l) longest = std::max(longest, rows.slots[first + l].size());
    for (int l = 0; l < warp_size; ++l) {
      rows.slots[first + l].resize(longest, static_cast<std::uint16_t>(tile_size + l % columns));
    }
  }
  return rows;
}

TileLists make_lists(const Csr& lists, const Tiling& tiling, const std::vector<Index>& order) {
  constexpr int warps = tile_size / warp_size;
  constexpr Index batch = 4096;  // tiles, whose rows take about 40 kB each before they are packed
  const Index tiles = tiling.own_tiles;
  TileLists out;
  std::vector<std::vector<Index>> halos(static_cast<std::size_t>(tiles));
  std::int32_t chunks = 0;
  for (Index first = 0; first < tiles; first += batch) {
    const Index last = std::min(tiles, first + batch);
    std::vector<TileRows> rows(static_cast<std::size_t>(last - first));
    std::exception_ptr failure;
#pragma omp parallel for schedule(dynamic, 16)
    for (Index tile = first; tile < last; ++tile) {
      try {
        rows[tile - first] = rows_of_tile(lists, tiling, order, tile);
        halos[tile] = rows[tile - first].halo;  // a copy, without spare capacity
      } catch (...) {
#pragma omp critical
        failure = std::current_exception();
      }
    }
    if (failure) std::rethrow_exception(failure);

    for (const TileRows& of_tile : rows) {
      for (int w = 0; w < warps; ++w) {
        const auto length = static_cast<std::int32_t>(of_tile.slots[w * warp_size].size());
        out.rows.push_back({chunks, length});
        chunks += (length + chunk - 1) / chunk;
      }
    }
    out.entries.resize(static_cast<std::size_t>(chunks) * warp_size * chunk, 0);
#pragma omp parallel for schedule(static)
    for (Index tile = first; tile < last; ++tile) {
      for (int i = 0; i < tile_size; ++i) {
        const TileLists::Row row = out.rows[static_cast<std::size_t>(tile) * warps + i / warp_size];
        for (std::int32_t e = 0; e < row.length; ++e) {
          const std::size_t at =
              (static_cast<std::size_t>(row.chunk + e / chunk) * warp_size + i % warp_size) *
                  chunk +
              e % chunk;
          out.entries[at] = static_cast<std::uint16_t>(16 * rows[tile - first].slots[i][e]);
        }
      }
    }
  }
  for (const std::vector<Index>& halo : halos) {
    out.halo_stride = std::max(out.halo_stride, static_cast<int>(halo.size()));
  }
  out.halo.assign(static_cast<std::size_t>(tiles) * out.halo_stride, -1);
  for (Index tile = 0; tile < tiles; ++tile) {
    std::copy(halos[tile].begin(), halos[tile].end(),
              out.halo.begin() + static_cast<std::ptrdiff_t>(tile) * out.halo_stride);
    halos[tile] = {};
  }
  return out;
}

}  // namespace

void refuse_halo(int points) {
  throw InputError(
      fmt::format("the halo of a tile of {} phyxels has {} points; a GPU's tile has room for {}; "
                  "allowed: a smaller support, or the CPU",
                  tile_size, points, most_halo));
}

Tiling make_tiling(const Model& model) {
  Tiling tiling;
  if (model.share) {
    place_share(model, reach_ghosts(model), tiling);
  } else {
    place_phyxels(model, tiling);
  }
  const std::vector<Index> order = orders_of(model, tiling);
  tiling.neighbours = make_lists(model.neighbourhood.neighbours, tiling, order);
  if (!model.neighbourhood.symmetric) {
    tiling.inverse = make_lists(model.neighbourhood.inverse(), tiling, order);
  }
  return tiling;
}

}  // namespace phyxel::cuda
