#include "mpi/spread.hpp"

#include <omp.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "model/space_filling_curve.hpp"
#include "parallel_sort.hpp"
#include "sort_unique.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Those of each rank, joined; they are gone afterwards.
SpreadPhyxels joined(std::vector<SpreadPhyxels> parts) {
  SpreadPhyxels all;
  std::size_t size = 0;
  for (const SpreadPhyxels& part : parts) size += part.size();
  all.reserve(size);
  for (SpreadPhyxels& part : parts) {
    all.insert(all.end(), part.begin(), part.end());
    SpreadPhyxels().swap(part);
  }
  return all;
}

/// phyxels[order(k)] for k in [first, last).
template <class Order>
SpreadPhyxels ordered(const SpreadPhyxels& phyxels, std::size_t first, std::size_t last,
                      Order&& order) {
  SpreadPhyxels result(last - first);
#pragma omp parallel for schedule(static)
  for (std::size_t k = first; k < last; ++k) {
    result[k - first] = phyxels[static_cast<std::size_t>(order(k))];
  }
  return result;
}

/// A phyxel's place in the order of all.
struct Key {
  Index body = 0;
  std::uint64_t key = 0;  ///< Of the curve.
  Index number = 0;
  friend auto operator<=>(const Key&, const Key&) = default;
};
struct Keyed {
  Key key;
  Index here = 0;
};

/// Which is the first that is not before a key.
std::ptrdiff_t first_from(const std::vector<Keyed>& sorted, const Key& key) {
  return std::lower_bound(sorted.begin(), sorted.end(), key,
                          [](const Keyed& a, const Key& b) { return a.key < b; }) -
         sorted.begin();
}

/// The start of the stretch of each rank but the first: nothing before it belongs there.
std::vector<Key> find_splitters(const Communicator& ranks, const std::vector<Keyed>& sorted,
                                const std::vector<std::pair<Index, Index>>& starts) {
  std::vector<Key> splitters;
  for (const auto& [body, offset] : starts) splitters.push_back({body, 0, 0});
  const auto try_bits = [&](const auto& with_bit) {
    std::vector<std::int64_t> before;
    std::vector<Key> trials;
    for (const Key& splitter : splitters) {
      const Key trial = trials.emplace_back(with_bit(splitter));
      before.push_back(first_from(sorted, trial) - first_from(sorted, {trial.body, 0, 0}));
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

/// Cells of a grid over each body, wide enough that what is within reach is in the next one.
class Cells {
 public:
  using Name = std::uint64_t;
  Cells(const std::vector<double>& reach, const std::vector<Box>& boxes) : boxes_(boxes) {
    for (std::size_t b = 0; b < boxes.size(); ++b) {
      const double edge = std::max(reach[b], boxes[b].extent() / most);
      inverse_edge_.push_back(edge > 0 ? 1 / edge : 0);
    }
  }
  Name name_of(const SpreadPhyxel& p) const {
    const auto b = static_cast<std::size_t>(p.body);
    const Vec3d at = inverse_edge_[b] * (p.position - boxes_[b].low);
    return name(b, static_cast<Name>(at.x) + 1, static_cast<Name>(at.y) + 1,
                static_cast<Name>(at.z) + 1);
  }
  /// Calls visit(name) for a cell and those next to it.
  template <class Visit>
  static void visit_around(Name cell, Visit&& visit) {
    for (Name z = 0; z < 3; ++z) {
      for (Name y = 0; y < 3; ++y) {
        for (Name x = 0; x < 3; ++x) visit(cell + name(0, x, y, z) - name(0, 1, 1, 1));
      }
    }
  }

 private:
  static constexpr double most = 4096;  ///< Cells along a side.
  static constexpr int bits = 14;
  static Name name(std::size_t body, Name x, Name y, Name z) {
    return static_cast<Name>(body) << (3 * bits) | z << (2 * bits) | y << bits | x;
  }
  const std::vector<Box>& boxes_;
  std::vector<double> inverse_edge_;
};

/// The order of all phyxels: by body, then by number.
std::uint64_t numbered(const SpreadPhyxel& p) {
  return static_cast<std::uint64_t>(p.body) << 32 | static_cast<std::uint64_t>(p.number);
}

struct Others {
  SpreadPhyxels phyxels;
  std::vector<int> owner;
};
/// Phyxels of other ranks in the cells that have own ones, or next to them.
Others of_others(const Communicator& ranks, const SpreadPhyxels& own, const Cells& cells) {
  const auto each = static_cast<std::size_t>(ranks.size());
  using Placed = std::pair<Cells::Name, Index>;
  auto here = tabulated(own.size(), [&](std::size_t i) {
    return Placed{cells.name_of(own[i]), static_cast<Index>(i)};
  });
  parallel_sort(here);
  std::vector<Cells::Name> occupied;
  std::vector<std::size_t> begin;  // of their cells, in `here`
  for (std::size_t k = 0; k < here.size(); ++k) {
    if (k > 0 && here[k].first == here[k - 1].first) continue;
    occupied.push_back(here[k].first);
    begin.push_back(k);
  }
  begin.push_back(here.size());
  // Who is where.
  std::vector<std::pair<Cells::Name, int>> elsewhere;
  {
    const auto from_each = ranks.exchanged(std::vector<std::vector<Cells::Name>>(each, occupied));
    for (std::size_t r = 0; r < each; ++r) {
      if (static_cast<int>(r) == ranks.rank()) continue;
      for (const Cells::Name name : from_each[r]) elsewhere.emplace_back(name, static_cast<int>(r));
    }
  }
  parallel_sort(elsewhere);
  std::vector<SpreadPhyxels> send(each);
#pragma omp parallel
  {
    std::vector<SpreadPhyxels> mine(each);
    std::vector<int> wanted_by;
#pragma omp for schedule(dynamic, 256) nowait
    for (std::size_t c = 0; c < occupied.size(); ++c) {
      wanted_by.clear();
      Cells::visit_around(occupied[c], [&](Cells::Name next) {
        for (auto at = std::lower_bound(elsewhere.begin(), elsewhere.end(), std::pair{next, -1});
             at != elsewhere.end() && at->first == next; ++at) {
          wanted_by.push_back(at->second);
        }
      });
      sort_unique(wanted_by);
      for (const int rank : wanted_by) {
        for (std::size_t k = begin[c]; k < begin[c + 1]; ++k) {
          mine[static_cast<std::size_t>(rank)].push_back(own[here[k].second]);
        }
      }
    }
#pragma omp critical
    for (std::size_t r = 0; r < each; ++r) {
      send[r].insert(send[r].end(), mine[r].begin(), mine[r].end());
    }
  }
  std::vector<SpreadPhyxels> received = ranks.exchanged(send);
  Others others;
  for (std::size_t r = 0; r < each; ++r) {
    others.owner.insert(others.owner.end(), received[r].size(), static_cast<int>(r));
  }
  others.phyxels = joined(std::move(received));
  return others;
}

}  // namespace

std::vector<Box> boxes_of(const Communicator& ranks, const SpreadPhyxels& own, std::size_t bodies) {
  constexpr double far = std::numeric_limits<double>::infinity();
  std::vector<Box> boxes(bodies, {{far, far, far}, {-far, -far, -far}});
  const auto stretch = [](Box& box, const Vec3d& low, const Vec3d& high) {
    box.low = {std::min(box.low.x, low.x), std::min(box.low.y, low.y), std::min(box.low.z, low.z)};
    box.high = {std::max(box.high.x, high.x), std::max(box.high.y, high.y),
                std::max(box.high.z, high.z)};
  };
  for (const SpreadPhyxel& p : own) stretch(boxes[p.body], p.position, p.position);
  const std::vector<Box> all = ranks.gathered(std::span<const Box>(boxes));
  for (std::size_t k = 0; k < all.size(); ++k) {
    stretch(boxes[k % bodies], all[k].low, all[k].high);
  }
  return boxes;
}

SpreadPhyxels spread_along_curve(const Communicator& ranks, SpreadPhyxels own,
                                 const std::vector<Index>& sizes, const std::vector<Box>& boxes,
                                 Index group) {
  const int parts = ranks.size();
  std::vector<HilbertFrame> frames;
  for (const Box& box : boxes) frames.push_back(HilbertFrame::around(box.low, box.high));
  const auto keyed = [&](const SpreadPhyxels& phyxels) {
    const auto n = static_cast<Index>(phyxels.size());
    std::vector<Keyed> keys(phyxels.size());
#pragma omp parallel for schedule(static)
    for (Index i = 0; i < n; ++i) {
      const SpreadPhyxel& p = phyxels[i];
      keys[i] = {{p.body, frames[p.body].key_of(p.position), p.number}, i};
    }
    parallel_sort(keys, [](const Keyed& a, const Keyed& b) { return a.key < b.key; });
    return keys;
  };
  const auto groups_of = [&](Index size) { return (std::int64_t{size} + group - 1) / group; };
  std::int64_t groups = 0;
  for (const Index size : sizes) groups += groups_of(size);
  // Body and place along the curve where each rank's stretch begins.
  std::vector<std::pair<Index, Index>> starts;
  for (int r = 0; r < parts; ++r) {
    std::int64_t at = groups * r / parts;
    std::size_t body = 0;
    while (body + 1 < sizes.size() && at >= groups_of(sizes[body])) at -= groups_of(sizes[body++]);
    starts.emplace_back(static_cast<Index>(body), static_cast<Index>(at * group));
  }
  {
    const std::vector<Keyed> sorted = keyed(own);
    const std::vector<Key> splitters =
        find_splitters(ranks, sorted, {starts.begin() + 1, starts.end()});
    std::vector<SpreadPhyxels> send;
    std::size_t first = 0;
    for (int r = 0; r < parts; ++r) {
      std::size_t last = sorted.size();
      if (r + 1 < parts) {
        last = static_cast<std::size_t>(first_from(sorted, splitters[static_cast<std::size_t>(r)]));
      }
      send.push_back(ordered(own, first, last, [&](std::size_t k) { return sorted[k].here; }));
      first = last;
    }
    SpreadPhyxels().swap(own);
    own = joined(ranks.exchanged(send));
  }
  const auto [first_body, first_along] = starts[static_cast<std::size_t>(ranks.rank())];
  const std::vector<Keyed> sorted = keyed(own);
  own = ordered(own, 0, own.size(), [&](std::size_t k) { return sorted[k].here; });
  for (const auto& [first, last] : stretches_of_bodies(own)) {
    // A rank's first body may have begun on another one.
    const Index begun = first == 0 && own[0].body == first_body ? first_along : 0;
    const std::size_t begin = first, end = last;  // for clang, whose OpenMP takes no bindings
#pragma omp parallel for schedule(static)
    for (std::size_t k = begin; k < end; ++k) {
      own[k].along = begun + static_cast<Index>(k - begin);
    }
  }
  return own;
}

std::vector<std::pair<std::size_t, std::size_t>> stretches_of_bodies(const SpreadPhyxels& phyxels) {
  std::vector<std::pair<std::size_t, std::size_t>> stretches;
  for (auto first = phyxels.begin(), last = first; first != phyxels.end(); first = last) {
    last = std::partition_point(first, phyxels.end(),
                                [&](const SpreadPhyxel& p) { return p.body == first->body; });
    stretches.emplace_back(first - phyxels.begin(), last - phyxels.begin());
  }
  return stretches;
}

std::vector<Index> order_by_number(const SpreadPhyxels& phyxels) {
  std::int64_t descents = 0;
  const auto n = static_cast<Index>(phyxels.size());
#pragma omp parallel for schedule(static) reduction(+ : descents)
  for (Index i = 1; i < n; ++i) descents += numbered(phyxels[i]) < numbered(phyxels[i - 1]);
  if (descents == 0) {
    return tabulated(phyxels.size(), [](std::size_t i) { return static_cast<Index>(i); });
  }
  auto keys = tabulated(phyxels.size(), [&](std::size_t i) {
    return std::pair(numbered(phyxels[i]), static_cast<Index>(i));
  });
  parallel_sort(keys);
  return tabulated(keys.size(), [&](std::size_t k) { return keys[k].second; });
}

SpreadPhyxels sent_to_owners(const Communicator& ranks, const SpreadPhyxels& own,
                             const std::vector<int>& owner) {
  const auto parts = static_cast<std::size_t>(ranks.size());
  // Threads take stretches; where each begins among what a rank gets.
  const auto threads = static_cast<std::size_t>(omp_get_max_threads());
  const auto begin_of = [&](std::size_t stretch) { return own.size() * stretch / threads; };
  std::vector<std::vector<std::size_t>> at(threads, std::vector<std::size_t>(parts, 0));
#pragma omp parallel for schedule(static, 1)
  for (std::size_t t = 0; t < threads; ++t) {
    for (std::size_t k = begin_of(t); k < begin_of(t + 1); ++k) {
      ++at[t][static_cast<std::size_t>(owner[k])];
    }
  }
  std::vector<SpreadPhyxels> send(parts);
  for (std::size_t r = 0; r < parts; ++r) {
    std::size_t size = 0;
    for (std::size_t t = 0; t < threads; ++t) size += std::exchange(at[t][r], size);
    send[r].resize(size);
  }
#pragma omp parallel for schedule(static, 1)
  for (std::size_t t = 0; t < threads; ++t) {
    for (std::size_t k = begin_of(t); k < begin_of(t + 1); ++k) {
      const auto r = static_cast<std::size_t>(owner[k]);
      send[r][at[t][r]++] = own[k];
    }
  }
  const SpreadPhyxels received = joined(ranks.exchanged(send));
  const std::vector<Index> order = order_by_number(received);
  return ordered(received, 0, received.size(), [&](std::size_t k) { return order[k]; });
}

Surrounded surrounded(const Communicator& ranks, const SpreadPhyxels& own,
                      const std::vector<double>& reach, const std::vector<Box>& boxes) {
  const Others others = of_others(ranks, own, Cells(reach, boxes));
  // Both in the order of numbers, then each knows how many of the other come before it.
  const std::vector<Index> own_order = order_by_number(own),
                           order = order_by_number(others.phyxels);
  const auto before = [](const SpreadPhyxels& phyxels, const std::vector<Index>& sorted,
                         const SpreadPhyxel& p) {
    return static_cast<std::size_t>(
        std::partition_point(sorted.begin(), sorted.end(),
                             [&](Index k) { return numbered(phyxels[k]) < numbered(p); }) -
        sorted.begin());
  };
  Surrounded all;
  all.phyxels.resize(own.size() + others.phyxels.size());
  all.owner.resize(all.phyxels.size(), ranks.rank());
  all.here.resize(all.phyxels.size(), -1);
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < own.size(); ++k) {
    const SpreadPhyxel& p = own[own_order[k]];
    const std::size_t at = k + before(others.phyxels, order, p);
    all.phyxels[at] = p;
    all.here[at] = own_order[k];
  }
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < order.size(); ++k) {
    const SpreadPhyxel& p = others.phyxels[order[k]];
    const std::size_t at = k + before(own, own_order, p);
    all.phyxels[at] = p;
    all.owner[at] = others.owner[order[k]];
  }
  return all;
}

std::vector<double> medians_of(const Communicator& ranks, std::vector<std::vector<double>> values) {
  std::vector<std::int64_t> sizes;
  for (std::vector<double>& list : values) {
    parallel_sort(list);
    sizes.push_back(static_cast<std::int64_t>(list.size()));
  }
  ranks.add(sizes);
  // Bits of numbers that are not negative are in the order of the numbers.
  std::vector<std::uint64_t> medians(values.size(), 0);
  for (int bit = 62; bit >= 0; --bit) {
    std::vector<std::int64_t> below;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const auto trial = std::bit_cast<double>(medians[k] | std::uint64_t{1} << bit);
      // No list holds a NaN, so all of it is below one.
      below.push_back(std::isnan(trial)
                          ? static_cast<std::int64_t>(values[k].size())
                          : std::lower_bound(values[k].begin(), values[k].end(), trial) -
                                values[k].begin());
    }
    ranks.add(below);
    for (std::size_t k = 0; k < values.size(); ++k) {
      if (sizes[k] > 0 && below[k] <= sizes[k] / 2) medians[k] |= std::uint64_t{1} << bit;
    }
  }
  std::vector<double> result;
  for (const std::uint64_t bits : medians) result.push_back(std::bit_cast<double>(bits));
  return result;
}

std::vector<double> largest_of(const Communicator& ranks, const std::vector<double>& values) {
  std::vector<double> largest = values;
  const std::vector<double> all = ranks.gathered(std::span<const double>(values));
  for (std::size_t k = 0; k < all.size(); ++k) {
    double& value = largest[k % values.size()];
    value = std::max(value, all[k]);
  }
  return largest;
}

}  // namespace phyxel
