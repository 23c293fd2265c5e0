/// The order of list entries in which eight lanes have no bank conflicts in shared memory. Host and
/// device share this code.
#pragma once

#include <cstdint>

#include "phyxel/types.hpp"

namespace phyxel::cuda {

/// Number of lanes that shared memory serves together, and of its 16-byte columns.
inline constexpr int team = 8, columns = 8;

/// The order of a lane's slots that `order_wait_free` expects: by column, then ascending.
PHYXEL_HD bool earlier_slot(std::uint16_t a, std::uint16_t b) {
  return a % columns != b % columns ? a % columns < b % columns : a < b;
}

/// Orders the slots of eight lanes so that the slots of a step are equal or in different columns; a
/// lane without such a slot takes a null point. All lanes get the same number of steps.
///
/// In each step, lanes choose in the order of their remaining slots, most first: a slot that
/// another lane has chosen in this step if they share it, otherwise one from the fullest column.
/// @param slots lists of the lanes, slots[l * stride + k] with k < length[l], sorted by
///   `earlier_slot`; overwritten
/// @param first_far slot of the null point of column 0; that of column c is `first_far` + c
/// @param ordered receives the slots, ordered[l * capacity + step]
/// @returns the number of steps, or -1 if `capacity` is too small; eight times the longest list is
///   always enough
PHYXEL_HD int order_wait_free(std::uint16_t* slots, int stride, const int* length,
                              std::uint16_t first_far, std::uint16_t* ordered, int capacity) {
  std::uint16_t begin[team][columns], end[team][columns];  // each lane's entries in each column
  int waiting[columns] = {};                               // remaining entries of each column
  int left_of[team], left = 0;
  for (int lane = 0; lane < team; ++lane) {
    int k = 0;
    for (int c = 0; c < columns; ++c) {
      begin[lane][c] = static_cast<std::uint16_t>(k);
      while (k < length[lane] && slots[lane * stride + k] % columns == c) ++k;
      end[lane][c] = static_cast<std::uint16_t>(k);
      waiting[c] += end[lane][c] - begin[lane][c];
    }
    left_of[lane] = length[lane];
    left += length[lane];
  }
  int steps = 0;
  for (; left > 0; ++steps) {
    if (steps == capacity) return -1;
    int chosen[columns];
    for (int c = 0; c < columns; ++c) chosen[c] = -1;
    unsigned taken = 0, idle = 0;  // bit masks of lanes
    for (int turn = 0; turn < team; ++turn) {
      int lane = -1;
      for (int l = 0; l < team; ++l) {
        if (!(taken >> l & 1) && (lane < 0 || left_of[l] > left_of[lane])) lane = l;
      }
      taken |= 1U << lane;
      std::uint16_t* list = slots + lane * stride;
      int best = -1, best_worth = -1, best_slot = 0;
      for (int c = 0; c < columns; ++c) {
        int at = begin[lane][c];
        const int last = end[lane][c];
        int worth = waiting[c];
        if (chosen[c] >= 0) {
          while (at < last && list[at] < chosen[c]) ++at;
          if (at < last && list[at] != chosen[c]) continue;
          worth += 1 << 20;
        }
        if (at == last) continue;
        if (worth > best_worth || (worth == best_worth && list[at] < best_slot)) {
          best = at;
          best_worth = worth;
          best_slot = list[at];
        }
      }
      if (best < 0) {
        idle |= 1U << lane;
        continue;
      }
      const int c = best_slot % columns;
      for (int k = best; k > begin[lane][c]; --k) list[k] = list[k - 1];
      ++begin[lane][c];
      chosen[c] = best_slot;
      ordered[lane * capacity + steps] = static_cast<std::uint16_t>(best_slot);
      --waiting[c];
      --left_of[lane];
      --left;
    }
    int free_column = 0;
    for (int c = columns - 1; c >= 0; --c) {
      if (chosen[c] < 0) free_column = c;
    }
    for (int lane = 0; lane < team; ++lane) {
      if (idle >> lane & 1) {
        ordered[lane * capacity + steps] = static_cast<std::uint16_t>(first_far + free_column);
      }
    }
  }
  return steps;
}

}  // namespace phyxel::cuda
