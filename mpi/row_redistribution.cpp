#include "mpi/row_redistribution.hpp"

#include <algorithm>

#include "parallel_sort.hpp"
#include "phyxel/history.hpp"
#include "tabulated.hpp"

namespace phyxel {

template <class Wanted>
RowRedistribution::Places RowRedistribution::places_of(const std::vector<Index>& numbers,
                                                       Wanted&& wanted) {
  Places places;
  places.here = chosen(0, static_cast<Index>(numbers.size()), wanted);
  const auto by_number = [&](Index a, Index b) { return numbers[a] < numbers[b]; };
  if (!std::is_sorted(places.here.begin(), places.here.end(), by_number)) {
    parallel_sort(places.here, by_number);
  }
  places.number =
      tabulated(places.here.size(), [&](std::size_t k) { return numbers[places.here[k]]; });
  return places;
}

RowRedistribution::Places::Range RowRedistribution::Places::within(RowRange range) const {
  const auto before = [&](Index limit) {
    return static_cast<std::size_t>(std::lower_bound(number.begin(), number.end(), limit) -
                                    number.begin());
  };
  return {before(range.begin), before(range.end)};
}

RowRedistribution::RowRedistribution(const MpiCommunicator& ranks, const Model& share)
    : ranks_(ranks),
      share_(share),
      own_(places_of(share.share->global_id, [&](Index i) { return share.owns(i); })),
      surfels_(places_of(share.share->global_surfel_id, [](Index) { return true; })) {}

std::vector<double> RowRedistribution::redistributed(Quantity quantity,
                                                     std::span<const double> here,
                                                     std::span<const RowRange> wanted) const {
  const Places& places = is_of_surfels(quantity) ? surfels_ : own_;
  const std::size_t width = width_of(quantity);
  std::vector<std::vector<Index>> numbers(wanted.size());
  std::vector<std::vector<double>> values(wanted.size());
  for (std::size_t r = 0; r < wanted.size(); ++r) {
    const Places::Range range = places.within(wanted[r]);
    for (std::size_t k = range.begin; k < range.end; ++k) {
      const auto value = here.subspan(width * static_cast<std::size_t>(places.here[k]), width);
      numbers[r].push_back(places.number[k]);
      values[r].insert(values[r].end(), value.begin(), value.end());
    }
  }
  numbers = ranks_.alltoallv(numbers);
  values = ranks_.alltoallv(values);
  const RowRange own = wanted[static_cast<std::size_t>(ranks_.rank())];
  std::vector<double> all(width * static_cast<std::size_t>(own.end - own.begin));
  for (std::size_t r = 0; r < numbers.size(); ++r) {
    for (std::size_t k = 0; k < numbers[r].size(); ++k) {
      const auto row = static_cast<std::size_t>(numbers[r][k] - own.begin);
      std::copy_n(values[r].data() + width * k, width, all.data() + width * row);
    }
  }
  return all;
}

std::vector<double> RowRedistribution::gathered(Quantity quantity, std::span<const double> here,
                                                RowRange wanted) const {
  std::vector<RowRange> of_ranks(static_cast<std::size_t>(ranks_.size()));
  of_ranks[0] = wanted;
  return redistributed(quantity, here, of_ranks);
}

State RowRedistribution::scattered(Index length,
                                   const std::function<State(Index begin, Index end)>& read) const {
  const Places places = places_of(share_.share->global_id, [](Index) { return true; });
  const Index all = share_.global_count();
  State state;
  state.displacement.resize(places.here.size());
  state.velocity.resize(places.here.size());
  state.history = virgin_history(share_);
  for (Index begin = 0; begin < all;) {
    const Index end = all - begin > length ? begin + length : all;
    State some;
    ranks_.collectively([&] {
      if (ranks_.rank() == 0) some = read(begin, end);
    });
    some.displacement = ranks_.broadcast(std::move(some.displacement));
    some.velocity = ranks_.broadcast(std::move(some.velocity));
    // The first rank's columns are those of a model of the same materials (`check_resumed`).
    auto columns = static_cast<std::size_t>(
        ranks_.broadcast(std::vector<Index>{static_cast<Index>(some.history.size())}).front());
    some.history.resize(columns);
    if (columns == 0) state.history.clear();
    for (HistoryColumn& column : some.history) {
      const std::vector<char> name =
          ranks_.broadcast(std::vector<char>(column.name.begin(), column.name.end()));
      column.name.assign(name.begin(), name.end());
      column.values = ranks_.broadcast(std::move(column.values));
    }
    const Places::Range range = places.within({begin, end});
    for (std::size_t k = range.begin; k < range.end; ++k) {
      const auto row = static_cast<std::size_t>(places.number[k] - begin);
      state.displacement[places.here[k]] = some.displacement[row];
      state.velocity[places.here[k]] = some.velocity[row];
      for (std::size_t c = 0; c < state.history.size(); ++c) {
        state.history[c].values[places.here[k]] = some.history[c].values[row];
      }
    }
    begin = end;
  }
  return state;
}

}  // namespace phyxel
