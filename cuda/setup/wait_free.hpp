/// The order of entries in which eight lanes never wait for shared memory. Shared by the set-up on
/// the host and on the device.
#pragma once

#include <cstdint>

#include "phyxel/types.hpp"

namespace phyxel::cuda {

/// Lanes that shared memory answers together, and the 16-byte columns it has for them.
inline constexpr int team = 8, columns = 8;

/// The order in which `order_wait_free` takes a lane's slots: column by column, ascending.
PHYXEL_HD bool earlier_slot(std::uint16_t a, std::uint16_t b) {
  return a % columns != b % columns ? a % columns < b % columns : a < b;
}

/// Puts the slots of eight lanes into an order in which each step's slots are the same or in
/// different columns; a lane for which there is none takes a far slot. Lanes end up equally long.
///
/// Step by step, the lane with the most left to do chooses first: a slot that another lane has just
/// chosen if it has that too, otherwise one from the column with the most left.
/// @param slots of lane l: slots[l * stride + k], k < length[l], by `earlier_slot`; used up
/// @param first_far the far point of column c is slot `first_far` + c
/// @param ordered of lane l: ordered[l * capacity + step]
/// @returns the number of steps, or -1 if they are more than `capacity`; eight times the longest
///   list always is enough.
PHYXEL_HD int order_wait_free(std::uint16_t* slots, int stride, const int* length,
                              std::uint16_t first_far, std::uint16_t* ordered, int capacity) {
  std::uint16_t begin[team][columns], end[team][columns];  // of each lane's entries in each column
  int waiting[columns] = {};                               // entries left in each column
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
    unsigned taken = 0, idle = 0;  // lanes
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
