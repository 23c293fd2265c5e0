#include "mpi/migrate.hpp"

#include <omp.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <span>
#include <tuple>
#include <utility>

#include "model/space_filling_curve.hpp"
#include "parallel_sort.hpp"
#include "sort_unique.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// A phyxel's key in the global order.
struct Key {
  Index part = 0;
  std::uint64_t key = 0;  ///< Position along the curve.
  Index number = 0;
};
/// Key and index of a phyxel, which are sorted in place of the phyxel. Numbers are compared only
/// for equal keys.
struct Keyed {
  std::uint64_t key;
  Index part;
  Index here;
};
using KeyedPhyxels = Bulk<Keyed>;

/// Returns the index of the first phyxel that is not before a key.
std::ptrdiff_t first_from(const MigratingPhyxels& phyxels, const KeyedPhyxels& sorted,
                          const Key& key) {
  const auto before = [&](const Keyed& a, const Key& b) {
    return std::tuple(a.part, a.key, phyxels[a.here].number) < std::tuple(b.part, b.key, b.number);
  };
  return std::lower_bound(sorted.begin(), sorted.end(), key, before) - sorted.begin();
}

/// Finds the first key of each rank's range, except that of the first rank.
std::vector<Key> find_splitters(const MpiCommunicator& ranks, const MigratingPhyxels& phyxels,
                                const KeyedPhyxels& sorted,
                                const std::vector<std::pair<Index, Index>>& starts) {
  std::vector<Key> splitters;
  for (const auto& [part, offset] : starts) splitters.push_back({part, 0, 0});
  const auto try_bits = [&](const auto& with_bit) {
    std::vector<std::int64_t> before;
    std::vector<Key> trials;
    for (const Key& splitter : splitters) {
      const Key trial = trials.emplace_back(with_bit(splitter));
      before.push_back(first_from(phyxels, sorted, trial) -
                       first_from(phyxels, sorted, {trial.part, 0, 0}));
    }
    ranks.add(before);
    for (std::size_t s = 0; s < splitters.size(); ++s) {
      if (before[s] <= starts[s].second) splitters[s] = trials[s];
    }
  };
  for (int bit = 3 * hilbert_bits - 1; bit >= 0; --bit) {
    try_bits([&](Key k) {
      k.key |= std::uint64_t{1} << bit;
      return k;
    });
  }
  for (int bit = 30; bit >= 0; --bit) {
    try_bits([&](Key k) {
      k.number |= Index{1} << bit;
      return k;
    });
  }
  return splitters;
}

/// Cells of a grid over each body, wide enough that all phyxels within reach are in neighbouring
/// cells.
class Cells {
 public:
  using Name = std::uint64_t;
  Cells(const std::vector<double>& reach, const std::vector<Box>& boxes) : boxes_(boxes) {
    for (std::size_t b = 0; b < boxes.size(); ++b) {
      const double edge = std::max(reach[b], boxes[b].extent() / most);
      inverse_edge_.push_back(edge > 0 ? 1 / edge : 0);
    }
  }
  /// Returns the name of a phyxel's cell. @param log_edge if positive, names blocks with 2^log_edge
  /// cells per side instead
  Name name_of(const MigratingPhyxel& p, int log_edge = 0) const {
    const auto b = static_cast<std::size_t>(p.body);
    const Vec3d at = inverse_edge_[b] * (p.position - boxes_[b].low);
    const auto along = [&](double x) { return (static_cast<Name>(x) >> log_edge) + 1; };
    return name(b, along(at.x), along(at.y), along(at.z));
  }
  /// True if any(name) is true for a cell or one of its neighbours.
  template <class Any>
  static bool any_around(Name cell, Any&& any) {
    for (Name z = 0; z < 3; ++z) {
      for (Name y = 0; y < 3; ++y) {
        for (Name x = 0; x < 3; ++x) {
          if (any(cell + name(0, x, y, z) - name(0, 1, 1, 1))) return true;
        }
      }
    }
    return false;
  }

 private:
  static constexpr double most = 4096;  ///< Most cells along a side.
  static constexpr int bits = 14;
  static Name name(std::size_t body, Name x, Name y, Name z) {
    return static_cast<Name>(body) << (3 * bits) | z << (2 * bits) | y << bits | x;
  }
  const std::vector<Box>& boxes_;
  std::vector<double> inverse_edge_;
};
using Names = std::vector<Cells::Name>;

/// A cell in which a rank has phyxels.
struct Occupied {
  Cells::Name name;
  int rank;
  friend auto operator<=>(const Occupied&, const Occupied&) = default;
};
/// Returns the occupied cells of other ranks, sorted. @param own occupied cells of this rank
Bulk<Occupied> of_other_ranks(const MpiCommunicator& ranks, const Names& own) {
  const std::vector<Names> from_each =
      ranks.alltoallv(std::vector<Names>(static_cast<std::size_t>(ranks.size()), own));
  Bulk<Occupied> all;
  for (int r = 0; r < ranks.size(); ++r) {
    if (r == ranks.rank()) continue;
    for (const Cells::Name name : from_each[r]) all.push_back({name, r});
  }
  parallel_sort(all);
  return all;
}
/// Returns the entries of one cell.
std::span<const Occupied> at_cell(const Bulk<Occupied>& all, Cells::Name name) {
  const auto first = std::lower_bound(all.begin(), all.end(), Occupied{name, 0});
  auto last = first;
  while (last != all.end() && last->name == name) ++last;
  return {first, last};
}

/// Returns own phyxels in blocks of cells that have, or whose neighbours have, phyxels of another
/// rank: few of a large body.
std::vector<Index> near_others(const MpiCommunicator& ranks, const MigratingPhyxels& own,
                               const Cells& cells) {
  constexpr int log_edge = 3;
  const auto n = static_cast<Index>(own.size());
  const Bulk<Cells::Name> block =
      in_bulk(own.size(), [&](std::size_t i) { return cells.name_of(own[i], log_edge); });
  Names blocks;
#pragma omp parallel
  {
    Names mine;  // consecutive phyxels are mostly in the same cell
    Cells::Name last = ~Cells::Name{0};
#pragma omp for schedule(static) nowait
    for (Index i = 0; i < n; ++i) {
      if (block[i] != last) mine.push_back(block[i]);
      last = block[i];
    }
    sort_unique(mine);
#pragma omp critical
    blocks.insert(blocks.end(), mine.begin(), mine.end());
  }
  sort_unique(blocks);
  const Bulk<Occupied> others = of_other_ranks(ranks, blocks);
  std::erase_if(blocks, [&](Cells::Name own_block) {
    return !Cells::any_around(own_block,
                              [&](Cells::Name next) { return !at_cell(others, next).empty(); });
  });
  return chosen(
      0, n, [&](Index i) { return std::binary_search(blocks.begin(), blocks.end(), block[i]); });
}

}  // namespace

std::vector<Box> boxes_of(const MpiCommunicator& ranks, const MigratingPhyxels& own,
                          std::size_t count, const WhichOf& which) {
  constexpr double far = std::numeric_limits<double>::infinity();
  const std::vector<Box> none(count, {{far, far, far}, {-far, -far, -far}});
  std::vector<Box> boxes = none;
  const auto stretch = [](Box& box, const Vec3d& low, const Vec3d& high) {
    box.low = {std::min(box.low.x, low.x), std::min(box.low.y, low.y), std::min(box.low.z, low.z)};
    box.high = {std::max(box.high.x, high.x), std::max(box.high.y, high.y),
                std::max(box.high.z, high.z)};
  };
#pragma omp parallel
  {
    std::vector<Box> mine = none;
#pragma omp for schedule(static) nowait
    for (std::size_t i = 0; i < own.size(); ++i) {
      stretch(mine[which(own[i])], own[i].position, own[i].position);
    }
#pragma omp critical
    for (std::size_t b = 0; b < count; ++b) stretch(boxes[b], mine[b].low, mine[b].high);
  }
  const std::vector<Box> all = ranks.gathered(std::span<const Box>(boxes));
  for (std::size_t k = 0; k < all.size(); ++k) {
    stretch(boxes[k % count], all[k].low, all[k].high);
  }
  return boxes;
}

MigratingPhyxels migrate_along_curve(const MpiCommunicator& ranks, MigratingPhyxels own,
                                     const WhichOf& part_of, const std::vector<Index>& sizes,
                                     const std::vector<Box>& boxes, Index group) {
  const int parts = ranks.size();
  std::vector<HilbertFrame> frames;
  for (const Box& box : boxes) frames.push_back(HilbertFrame::around(box.low, box.high));
  const auto keyed = [&](const MigratingPhyxels& phyxels) {
    KeyedPhyxels keys = in_bulk(phyxels.size(), [&](std::size_t i) {
      const std::size_t part = part_of(phyxels[i]);
      return Keyed{frames[part].key_of(phyxels[i].position), static_cast<Index>(part),
                   static_cast<Index>(i)};
    });
    parallel_sort(keys, [&](const Keyed& a, const Keyed& b) {
      if (a.part != b.part) return a.part < b.part;
      if (a.key != b.key) return a.key < b.key;
      return phyxels[a.here].number < phyxels[b.here].number;
    });
    return keys;
  };
  const auto groups_of = [&](Index size) { return (std::int64_t{size} + group - 1) / group; };
  std::int64_t groups = 0;
  for (const Index size : sizes) groups += groups_of(size);
  // Part and index along the curve of the start of each rank's range.
  std::vector<std::pair<Index, Index>> starts;
  for (int r = 0; r < parts; ++r) {
    std::int64_t at = groups * r / parts;
    std::size_t part = 0;
    while (part + 1 < sizes.size() && at >= groups_of(sizes[part])) at -= groups_of(sizes[part++]);
    starts.emplace_back(static_cast<Index>(part), static_cast<Index>(at * group));
  }
  const auto ordered = [](const MigratingPhyxels& phyxels, const KeyedPhyxels& sorted) {
    return in_bulk(sorted.size(), [&](std::size_t k) { return phyxels[sorted[k].here]; });
  };
  ByRank<MigratingPhyxel> send;
  {
    const KeyedPhyxels sorted = keyed(own);
    for (const Key& splitter :
         find_splitters(ranks, own, sorted, {starts.begin() + 1, starts.end()})) {
      send.begin.push_back(static_cast<std::size_t>(first_from(own, sorted, splitter)));
    }
    send.begin.push_back(own.size());
    send.values = ordered(own, sorted);
  }
  release(own);
  own = ranks.alltoallv(send).values;
  release(send.values);
  const auto [first_part, first_along] = starts[static_cast<std::size_t>(ranks.rank())];
  own = ordered(own, keyed(own));
  for (const auto& [first, last] : ranges_by(own, part_of)) {
    // A rank's first part may have begun on another one.
    const bool begins = first > 0 || static_cast<Index>(part_of(own[0])) != first_part;
    const Index begun = begins ? 0 : first_along;
    const std::size_t begin = first, end = last;  // for clang, whose OpenMP takes no bindings
#pragma omp parallel for schedule(static)
    for (std::size_t k = begin; k < end; ++k) {
      own[k].along = begun + static_cast<Index>(k - begin);
    }
  }
  return own;
}

namespace {

/// Key of the order by body, then by number.
std::uint64_t numbered(const MigratingPhyxel& p) {
  return static_cast<std::uint64_t>(p.body) << 32 | static_cast<std::uint64_t>(p.number);
}

/// Returns the indices of phyxels in that order.
Bulk<Index> order_by_number(const MigratingPhyxels& phyxels) {
  using Numbered = std::pair<std::uint64_t, Index>;
  auto keys = in_bulk(phyxels.size(), [&](std::size_t i) {
    return Numbered{numbered(phyxels[i]), static_cast<Index>(i)};
  });
  parallel_sort(keys);
  return in_bulk(keys.size(), [&](std::size_t k) { return keys[k].second; });
}

/// Groups phyxels by owner and keeps their order.
ByRank<MigratingPhyxel> by_owner(const MigratingPhyxels& own, const Bulk<int>& owner, int ranks) {
  const auto parts = static_cast<std::size_t>(ranks);
  // Each thread handles a contiguous range; `at` has its offset among the phyxels for a rank.
  const auto threads = static_cast<std::size_t>(omp_get_max_threads());
  const auto begin_of = [&](std::size_t stretch) { return own.size() * stretch / threads; };
  std::vector<std::vector<std::size_t>> at(threads, std::vector<std::size_t>(parts, 0));
#pragma omp parallel for schedule(static, 1)
  for (std::size_t t = 0; t < threads; ++t) {
    for (std::size_t k = begin_of(t); k < begin_of(t + 1); ++k) {
      ++at[t][static_cast<std::size_t>(owner[k])];
    }
  }
  ByRank<MigratingPhyxel> send{MigratingPhyxels(own.size())};
  for (std::size_t r = 0; r < parts; ++r) {
    std::size_t next = send.begin.back();
    for (std::size_t t = 0; t < threads; ++t) next += std::exchange(at[t][r], next);
    send.begin.push_back(next);
  }
#pragma omp parallel for schedule(static, 1)
  for (std::size_t t = 0; t < threads; ++t) {
    for (std::size_t k = begin_of(t); k < begin_of(t + 1); ++k) {
      send.values[at[t][static_cast<std::size_t>(owner[k])]++] = own[k];
    }
  }
  return send;
}

}  // namespace

MigratingPhyxels migrate_to_owners(const MpiCommunicator& ranks, MigratingPhyxels own,
                                   Bulk<int> owner) {
  ByRank<MigratingPhyxel> send = by_owner(own, owner, ranks.size());
  release(own);
  release(owner);
  const MigratingPhyxels received = ranks.alltoallv(send).values;
  release(send.values);
  const Bulk<Index> order = order_by_number(received);
  return in_bulk(order.size(), [&](std::size_t k) { return received[order[k]]; });
}

RemotePhyxels remote_phyxels_around(const MpiCommunicator& ranks, const MigratingPhyxels& own,
                                    const std::vector<double>& reach,
                                    const std::vector<Box>& boxes) {
  RemotePhyxels others;
  if (ranks.size() == 1) return others;
  const Cells cells(reach, boxes);
  const std::vector<Index> near = near_others(ranks, own, cells);
  using Placed = std::pair<Cells::Name, Index>;
  auto here = in_bulk(near.size(), [&](std::size_t k) {
    return Placed{cells.name_of(own[near[k]]), near[k]};
  });
  parallel_sort(here);
  Names occupied;
  std::vector<std::size_t> begin;  // first phyxel of each cell in `here`
  for (std::size_t k = 0; k < here.size(); ++k) {
    if (k > 0 && here[k].first == here[k - 1].first) continue;
    occupied.push_back(here[k].first);
    begin.push_back(k);
  }
  begin.push_back(here.size());
  const Bulk<Occupied> elsewhere = of_other_ranks(ranks, occupied);
  std::vector<MigratingPhyxels> send(static_cast<std::size_t>(ranks.size()));
#pragma omp parallel
  {
    std::vector<MigratingPhyxels> mine(send.size());
    std::vector<int> wanted_by;
#pragma omp for schedule(dynamic, 256) nowait
    for (std::size_t c = 0; c < occupied.size(); ++c) {
      wanted_by.clear();
      Cells::any_around(occupied[c], [&](Cells::Name next) {
        for (const Occupied& there : at_cell(elsewhere, next)) wanted_by.push_back(there.rank);
        return false;
      });
      sort_unique(wanted_by);
      for (const int rank : wanted_by) {
        for (std::size_t k = begin[c]; k < begin[c + 1]; ++k) {
          mine[static_cast<std::size_t>(rank)].push_back(own[here[k].second]);
        }
      }
    }
#pragma omp critical
    for (std::size_t r = 0; r < send.size(); ++r) {
      send[r].insert(send[r].end(), mine[r].begin(), mine[r].end());
    }
  }
  ByRank<MigratingPhyxel> joined;
  for (MigratingPhyxels& of_rank : send) {
    joined.values.insert(joined.values.end(), of_rank.begin(), of_rank.end());
    joined.begin.push_back(joined.values.size());
    release(of_rank);
  }
  ByRank<MigratingPhyxel> received = ranks.alltoallv(joined);
  const Bulk<Index> order = order_by_number(received.values);
  others.phyxels = in_bulk(order.size(), [&](std::size_t k) { return received.values[order[k]]; });
  others.owner = in_bulk(order.size(), [&](std::size_t k) {
    const auto end = std::upper_bound(received.begin.begin(), received.begin.end(),
                                      static_cast<std::size_t>(order[k]));
    return static_cast<int>(end - received.begin.begin()) - 1;
  });
  return others;
}

Surrounded surrounded(const MpiCommunicator& ranks, const MigratingPhyxels& own,
                      const RemotePhyxels& others) {
  // The position of a phyxel is its own index plus the number of the other kind before it.
  const auto before = [](const MigratingPhyxels& phyxels, const MigratingPhyxel& p) {
    const std::uint64_t at = numbered(p);
    const auto first = std::partition_point(
        phyxels.begin(), phyxels.end(), [&](const MigratingPhyxel& q) { return numbered(q) < at; });
    return static_cast<std::size_t>(first - phyxels.begin());
  };
  Surrounded all;
  all.phyxels.resize(own.size() + others.phyxels.size());
  all.owner.resize(all.phyxels.size(), ranks.rank());
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < own.size(); ++k) {
    all.phyxels[k + before(others.phyxels, own[k])] = own[k];
  }
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < others.phyxels.size(); ++k) {
    const std::size_t at = k + before(own, others.phyxels[k]);
    all.phyxels[at] = others.phyxels[k];
    all.owner[at] = others.owner[k];
  }
  return all;
}

std::vector<double> medians_of(const MpiCommunicator& ranks, std::span<const Bulk<double>> values) {
  // Bits of non-negative numbers have the order of the numbers. A radix selection counts, digit by
  // digit, the numbers with the leading digits of the median.
  constexpr int digit_bits = 8, digits = 1 << digit_bits;
  std::vector<std::uint64_t> medians(values.size(), 0);
  std::vector<std::int64_t> sizes;
  for (const Bulk<double>& list : values) sizes.push_back(static_cast<std::int64_t>(list.size()));
  ranks.add(sizes);
  std::vector<std::int64_t> before;  // numbers before the median among the remaining ones
  for (const std::int64_t size : sizes) before.push_back(size / 2);
  for (int shift = 64 - digit_bits; shift >= 0; shift -= digit_bits) {
    std::vector<std::int64_t> counts(values.size() * digits, 0);
    for (std::size_t k = 0; k < values.size(); ++k) {
      const std::uint64_t begins = medians[k];
      std::int64_t* const of_list = counts.data() + k * digits;
#pragma omp parallel for schedule(static) reduction(+ : of_list[:digits])
      for (std::size_t i = 0; i < values[k].size(); ++i) {
        const std::uint64_t bits = std::bit_cast<std::uint64_t>(values[k][i]) ^ begins;
        if (shift + digit_bits < 64 && bits >> (shift + digit_bits) != 0) continue;
        ++of_list[bits >> shift & (digits - 1)];
      }
    }
    ranks.add(counts);
    for (std::size_t k = 0; k < values.size(); ++k) {
      if (sizes[k] == 0) continue;
      const std::int64_t* const of_list = counts.data() + k * digits;
      std::uint64_t digit = 0;
      while (digit < digits - 1 && before[k] >= of_list[digit]) before[k] -= of_list[digit++];
      medians[k] |= digit << shift;
    }
  }
  std::vector<double> result;
  for (const std::uint64_t bits : medians) result.push_back(std::bit_cast<double>(bits));
  return result;
}

std::vector<double> largest_of(const MpiCommunicator& ranks, const std::vector<double>& values) {
  std::vector<double> largest = values;
  const std::vector<double> all = ranks.gathered(std::span<const double>(values));
  for (std::size_t k = 0; k < all.size(); ++k) {
    double& value = largest[k % values.size()];
    value = std::max(value, all[k]);
  }
  return largest;
}

}  // namespace phyxel
