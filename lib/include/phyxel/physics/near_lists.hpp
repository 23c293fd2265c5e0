/// Lists of phyxels near a point of a surface, and the threads that share the work on them.
#pragma once

#include <cstdint>

#include "phyxel/types.hpp"

namespace phyxel {

/// The larger of two ranges, up to which phyxels of two surfaces know of each other [m].
PHYXEL_HD double common_range(double a, double b) { return a > b ? a : b; }

/// Lists of the passes of contact are dealt out among so many threads of a device, by the numbers
/// that phyxels have in the whole model: sums then do not depend on what else is in a list.
inline constexpr int contact_threads = 4;

/// The squared distance of a phyxel that is not there [m²].
inline constexpr double no_square = 1e300;

/// The nearest of the phyxels that a thread has looked at.
struct NearestPhyxel {
  double square = no_square;  ///< Of its distance [m²]; `no_square` if there is none.
  Vec3<double> rest;          ///< [m]
};

/// The work on a list by one thread. A group of threads of a device may share it instead, each with
/// one part of the list, all with the same sums.
struct OneThread {
  /// Calls each(k) for the entries of this thread's parts of a list.
  /// @param start of the list's parts, and the end of the last one; shape [contact_threads + 1]
  template <class Each>
  PHYXEL_HD void each(const Offset* start, Each&& each) const {
    for (Offset k = start[0]; k < start[contact_threads]; ++k) each(k);
  }
  /// The first part of lists that this thread has.
  PHYXEL_HD int part() const { return 0; }
  /// The first entry of this thread's parts of a list.
  PHYXEL_HD Offset first_of(const Offset* start) const { return start[0]; }
  /// The end of the last of these parts.
  PHYXEL_HD Offset end_of(const Offset* start) const { return start[contact_threads]; }
  /// The sum of what the threads have.
  template <class T>
  PHYXEL_HD T sum(const T& part) const {
    return part;
  }
  /// The nearest of what the threads have found; of equal ones, the first in the list.
  PHYXEL_HD NearestPhyxel nearest(const NearestPhyxel& own) const { return own; }
  /// The least of what the threads have.
  PHYXEL_HD double least(double own) const { return own; }
  /// True of the thread that writes what all have found.
  PHYXEL_HD bool is_first() const { return true; }
};

/// The number of the lowest bit that is set, of at least one.
PHYXEL_HD int lowest_bit(std::uint64_t bits) {
#ifdef __CUDA_ARCH__
  return __ffsll(static_cast<long long>(bits)) - 1;
#else
  return __builtin_ctzll(bits);
#endif
}

/// The threads of a pass, which look at the entries of one list within range of a point alone.
/// The places of phyxels tell these entries once; entries beyond the range have no weight.
/// @tparam Threads as `OneThread`
template <class Threads>
class WithinRange {
 public:
  /// @param point the point's motion, as of `SurfaceMotion`. @param list as of `OneThread::each`
  /// @param motion_of returns the motion of an entry
  template <class Motion, class MotionOf>
  PHYXEL_HD WithinRange(const Threads& threads, const Motion& point, const Offset* list,
                        MotionOf&& motion_of)
      : threads_(threads), first_(threads.first_of(list)) {
    threads.each(list, [&](Offset k) {
      if (k - first_ >= marked) return;
      const Motion& other = motion_of(k);
      const Vec3<double> apart = other.after - point.after;
      const double range = common_range(point.range, other.range);
      // Rounding decides of none that has a weight.
      constexpr double more = 1 + 1e-12;
      if (dot(apart, apart) < more * range * range) near_ |= std::uint64_t{1} << (k - first_);
    });
  }

  /// Takes entries that these threads have found before. @param near result of their `bits`
  PHYXEL_HD WithinRange(const Threads& threads, const Offset* list, std::uint64_t near)
      : threads_(threads), first_(threads.first_of(list)), near_(near) {}

  /// A bit of each entry within range, of the first 64 of a thread.
  PHYXEL_HD std::uint64_t bits() const { return near_; }
  /// As of `OneThread`, for the entries within range. @param start that of the list
  template <class Each>
  PHYXEL_HD void each(const Offset* start, Each&& each) const {
    for (std::uint64_t left = near_; left != 0; left &= left - 1) each(first_ + lowest_bit(left));
    if (threads_.end_of(start) - first_ <= marked) return;
    threads_.each(start, [&](Offset k) {
      if (k - first_ >= marked) each(k);
    });
  }
  /// As of `OneThread`.
  template <class T>
  PHYXEL_HD T sum(const T& part) const {
    return threads_.sum(part);
  }
  /// As of `OneThread`.
  PHYXEL_HD NearestPhyxel nearest(const NearestPhyxel& own) const { return threads_.nearest(own); }

 private:
  static constexpr Offset marked = 64;  // entries of a thread; those after them are all looked at

  const Threads& threads_;
  Offset first_;
  std::uint64_t near_ = 0;  // a bit of each entry within range
};

}  // namespace phyxel
