/// Spatial hashes of a cloud in which distances between points vary.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "model/nearest_distances.hpp"
#include "model/spatial_hash.hpp"

namespace phyxel {

/// Points of a graded cloud, by octaves of a size that each point has, such as its support or the
/// distance to its neighbours. Each octave has hashes with cells about as large as its sizes and
/// larger, so that a search visits few cells and few points far away, however much sizes vary.
class GradedHash {
 public:
  using Entry = SpatialHash::Entry;
  using Nearest = SpatialHash::Nearest;

  /// @param size one for each point [m]: at least 0, finite
  GradedHash(std::span<const Vec3d> position, std::span<const double> size);

  /// Number of octaves that hold points.
  std::size_t octaves() const { return octaves_.size(); }

  /// Calls visit(entry) once for every point whose distance from `place` is at most
  /// radius_of(largest) [m], where `largest` is the largest size of the point's octave [m]; and for
  /// some points farther away.
  template <class RadiusOf, class Visit>
  void visit_ball(Vec3d place, RadiusOf&& radius_of, Visit&& visit) const {
    for (const Octave& octave : octaves_) {
      const double radius = radius_of(octave.largest);
      octave.level_for(radius).visit_ball(place, radius, [&](const Entry& entry) {
        visit(Entry{entry.position, entry.cell, octave.member[entry.index]});
      });
    }
  }

  /// Calls visit(entry) once for every point.
  template <class Visit>
  void visit_all(Visit&& visit) const {
    for (const Octave& octave : octaves_) {
      octave.levels.front().visit_all([&](const Entry& entry) {
        visit(Entry{entry.position, entry.cell, octave.member[entry.index]});
      });
    }
  }

  /// Finds the point nearest to `place` but for the one with the index `except`. Points beyond
  /// `limit` [m] may be left out.
  Nearest nearest(Vec3d place, double limit = HUGE_VAL, Index except = -1) const;

  /// A distance from `place` beyond which there is no point [m].
  double farthest(Vec3d place) const;

 private:
  /// Points whose sizes have the same power of two.
  struct Octave {
    double largest = 0;               ///< Largest of their sizes [m].
    std::vector<Index> member;        ///< Indices of the points in the cloud, ascending.
    std::vector<SpatialHash> levels;  ///< Hashes of the points, each with larger cells.

    /// The hash with the smallest cells of which a ball cuts few.
    const SpatialHash& level_for(double radius) const {
      constexpr double rings = 3;
      const auto found = std::find_if(levels.begin(), levels.end(), [&](const SpatialHash& hash) {
        return radius <= rings * hash.cell_size();
      });
      return found == levels.end() ? levels.back() : *found;
    }
  };

  Vec3d low_, high_;             // box around all points
  std::vector<Octave> octaves_;  // from small to large sizes
};

/// Sides of cubes that hold some ten points each around every point of a cloud [m]: of cells of an
/// octree, of which the smallest counts that holds a few of the points next to it along the curve.
std::vector<double> local_sizes(std::span<const Vec3d> position);

/// Offers points in balls of growing radius, until no nearer one can come. @param size a distance
/// within which there are some points [m]. @param offer offer(entry) offers to `found`
template <class Offer>
void search_nearest(NearestDistances& found, const GradedHash& hash, Vec3d place, double size,
                    Offer&& offer) {
  const double farthest = hash.farthest(place);
  for (double radius = std::max(0.75 * size, 1e-9 * farthest);; radius *= 1.5) {
    const double reach = std::min(radius, farthest);
    found.clear();
    hash.visit_ball(
        place, [&](double) { return reach; }, offer);
    if (reach == farthest || (found.full() && found.largest() <= reach * reach)) return;
  }
}

}  // namespace phyxel
