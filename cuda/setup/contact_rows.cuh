/// Rows of points that may touch, found on the device: the search among candidates that all ranks
/// know, as `find_rows` on the host.
#pragma once

#include <cstdint>

#include "setup/primitives.cuh"
#include "setup/search_facts.hpp"
#include "solver/contact_search.hpp"

namespace phyxel::cuda {

/// Name of the arrays of contact in messages about memory.
inline constexpr const char* contact_arrays = "contact";

/// The layer and the bodies as kernels see them.
struct LayerView {
  const Vec3d* position;
  const SurfaceSite* site;
  const double* gain;
  const Index *id, *body;
  const Box* box;  ///< Of bodies.
  const Offset* partner_start;
  const Index* partner;
  const ContactLaw* law;  ///< Of partners.
  const double* skins;    ///< Of bodies [m].
  double most_skin;       ///< The largest one [m].
  int rank;

  /// The number of a body among the partners of all; -1 if two do not touch.
  __device__ Offset partner_of(Index body, Index other) const {
    for (Offset k = partner_start[body]; k < partner_start[body + 1]; ++k) {
      if (partner[k] == other) return k;
    }
    return -1;
  }
  __device__ bool is_near_others(Index k) const {
    for (Offset p = partner_start[body[k]]; p < partner_start[body[k] + 1]; ++p) {
      const double skin = skin_of(skins, body[k], partner[p]);
      if (may_be_near(position[k], site[k].range, skin, box[partner[p]])) return true;
    }
    return false;
  }
};

using Candidates = DeviceArray<ContactCandidate>;
using Numbers = DeviceArray<Index>;

/// Rows and their entries, in terms of candidates.
struct FoundRows {
  /// By point and body, ascending, for each patch; as of `entries_among`.
  DeviceArray<std::uint64_t> keys;
  Numbers near;  ///< Of each entry: its candidate.
  Numbers row_of_entry;
  DeviceArray<ContactRow> rows;  ///< Their points are numbers of candidates.
  bool have_patches = false;     ///< True if a point is beside several patches of a body.
};

inline std::int64_t count_of(std::size_t size) { return static_cast<std::int64_t>(size); }

template <class T>
DeviceArray<T> cleared(std::size_t count) {
  DeviceArray<T> array(count, contact_arrays);
  array.clear();
  return array;
}

/// Entries of an array. @param numbers of these entries
template <class T>
DeviceArray<T> gathered(const DeviceArray<T>& values, const Numbers& numbers) {
  DeviceArray<T> some(numbers.size(), contact_arrays);
  for_each("gather", count_of(numbers.size()),
           [all = values.data(), some = some.data(),
            numbers = numbers.data()] __device__(std::int64_t p) { some[p] = all[numbers[p]]; });
  return some;
}

/// The candidates of this rank. Sets their extent among the facts.
/// @param count phyxels of the layer
Candidates candidates_of(const LayerView& layer, std::size_t count, FactsOnDevice& facts);
/// The candidates in the order that lists have. @param bodies number of bodies of the scene
Numbers in_list_order(const Candidates& points, std::size_t bodies);
/// The entries of the lists of all candidates: the number of the point times the number of
/// candidates, plus the place in `by_list` of the candidate near it; ascending.
/// @param extent of the candidates. @param room number of entries that memory is asked for, 0 at
/// the first search; receives that of the next one
DeviceArray<std::uint64_t> entries_among(const Candidates& points, const LayerView& layer,
                                         const Numbers& by_list, const Extent& extent,
                                         FactsOnDevice& facts, std::size_t& room);
/// The rows of entries.
FoundRows rows_of(DeviceArray<std::uint64_t> keys, const Candidates& points, const LayerView& layer,
                  const Numbers& by_list, FactsOnDevice& facts);

}  // namespace phyxel::cuda
