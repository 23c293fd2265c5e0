/// Searches for points by the grid cells that they lie in. Shared by the tables on the CPU and on
/// the GPU.
#pragma once

#include <cmath>
#include <cstdint>

#include "model/cell_grid.hpp"

namespace phyxel {

/// The searches of a table of points, in one order of visits for all tables.
/// @tparam Table derived from this. It has grid(), high() (the upper corner of the points [m]),
///   cell_size() [m], points() (their number), visit_all(visit) and visit_cell(cell, visit), and
///   entries with a position [m] and an index
template <class Table>
class CellSearch {
 public:
  /// Calls visit(entry) once for (at least) every point nearer to `place` than `rings` cells. Where
  /// that would be more cells than there are points, it visits the points.
  template <class Visit>
  PHYXEL_HD void visit_near(Vec3d place, int rings, Visit&& visit) const {
    const double width = 2.0 * rings + 1;
    if (rings > 3 && width * width * width > static_cast<double>(table().points())) {
      table().visit_all(visit);
      return;
    }
    const Cell c = table().grid().cell_of(place);
    for (std::int64_t z = c.z - rings; z <= c.z + rings; ++z) {
      for (std::int64_t y = c.y - rings; y <= c.y + rings; ++y) {
        for (std::int64_t x = c.x - rings; x <= c.x + rings; ++x) {
          table().visit_cell({x, y, z}, visit);
        }
      }
    }
  }

  /// Calls visit(entry) once for every point within `radius` [m] of `place`, and for others in
  /// cells that the ball cuts, in the order of `visit_near`.
  template <class Visit>
  PHYXEL_HD void visit_ball(Vec3d place, double radius, Visit&& visit) const {
    using std::ceil;
    const auto rings = static_cast<int>(ceil(radius / table().cell_size()));
    if (rings > 3) {
      visit_near(place, rings, visit);
      return;
    }
    const Cell c = table().grid().cell_of(place);
    const Vec3d within = within_cell(place, c);
    const double most = radius * table().grid().inverse_cell_size * (1 + 1e-6) + 1e-6;
    for (std::int64_t z = -rings; z <= rings; ++z) {
      const double z2 = gap2(z, within.z);
      if (z2 > most * most) continue;
      for (std::int64_t y = -rings; y <= rings; ++y) {
        const double yz2 = z2 + gap2(y, within.y);
        if (yz2 > most * most) continue;
        for (std::int64_t x = -rings; x <= rings; ++x) {
          if (yz2 + gap2(x, within.x) > most * most) continue;
          table().visit_cell({c.x + x, c.y + y, c.z + z}, visit);
        }
      }
    }
  }

  /// Calls visit(entry) once for every point of the cells exactly `ring` cells away.
  template <class Visit>
  PHYXEL_HD void visit_ring(Vec3d place, int ring, Visit&& visit) const {
    const double unlimited = HUGE_VAL;
    visit_ring(place, ring, unlimited, visit);
  }

  /// The point of the table nearest to a place.
  struct Nearest {
    Vec3d apart;                  ///< The vector from the place to the point [m].
    double distance2 = HUGE_VAL;  ///< [m^2]
    Index index = -1;             ///< -1 if no point was found.
  };

  /// Finds the point nearest to `place` but for the one with the index `except`. Of points at the
  /// same distance, the first visited is found. Points beyond `limit` [m] may be left out.
  PHYXEL_HD Nearest nearest(Vec3d place, double limit = HUGE_VAL, Index except = -1) const {
    Nearest found;
    const auto compare = [&](const auto& entry) {
      if (entry.index == except) return;
      const Vec3d d = entry.position - place;
      const double distance2 = dot(d, d);
      if (distance2 >= found.distance2) return;
      found = {d, distance2, entry.index};
    };
    const double cell_size = table().cell_size();
    const int farthest = farthest_ring(place);
    for (int ring = 0; ring <= farthest && (ring - 1) * cell_size <= limit; ++ring) {
      if (ring > 4 && limit == HUGE_VAL) {  // rare: the place is far from every point
        table().visit_all(compare);
        break;
      }
      visit_ring(place, ring, found.distance2, compare);
      // After rings 0 to r, each point nearer than r cells has been visited.
      if (found.distance2 <= ring * cell_size * ring * cell_size) break;
    }
    return found;
  }

  /// Rings of cells around `place` beyond which there is no point.
  PHYXEL_HD int farthest_ring(Vec3d place) const {
    return table().grid().farthest_ring(place, table().high());
  }

 private:
  using Cell = CellGrid::Cell;

  PHYXEL_HD const Table& table() const { return static_cast<const Table&>(*this); }

  /// A place from the corner of its cell, in cells.
  PHYXEL_HD Vec3d within_cell(Vec3d place, Cell c) const {
    const CellGrid& grid = table().grid();
    return grid.inverse_cell_size * (place - grid.low) -
           Vec3d{double(c.x), double(c.y), double(c.z)};
  }
  /// The square of the distance along one axis from a place to the cell d cells away, in cells.
  /// @param at the place within its cell, in cells
  PHYXEL_HD static double gap2(std::int64_t d, double at) {
    const double gap = d > 0   ? static_cast<double>(d) - at
                       : d < 0 ? at - static_cast<double>(d + 1)
                               : 0;
    return gap * gap;
  }

  /// Visits the points of the cells exactly `ring` cells away, but for cells that are farther away
  /// than the root of `limit2` [m²], which a visit may make smaller.
  template <class Visit>
  PHYXEL_HD void visit_ring(Vec3d place, int ring, const double& limit2, Visit&& visit) const {
    const CellGrid& grid = table().grid();
    const Cell c = grid.cell_of(place);
    const Vec3d within = within_cell(place, c);
    const double cells2 = grid.inverse_cell_size * grid.inverse_cell_size * (1 + 1e-6);
    const auto is_beyond = [&](double gaps2) { return gaps2 > limit2 * cells2 + 1e-6; };
    for (std::int64_t dz = -ring; dz <= ring; ++dz) {
      const double z2 = gap2(dz, within.z);
      if (is_beyond(z2)) continue;
      for (std::int64_t dy = -ring; dy <= ring; ++dy) {
        const double yz2 = z2 + gap2(dy, within.y);
        if (is_beyond(yz2)) continue;
        const bool face = dz == ring || dz == -ring || dy == ring || dy == -ring;
        const std::int64_t stride = face || ring == 0 ? 1 : 2 * ring;
        for (std::int64_t dx = -ring; dx <= ring; dx += stride) {
          if (is_beyond(yz2 + gap2(dx, within.x))) continue;
          table().visit_cell({c.x + dx, c.y + dy, c.z + dz}, visit);
        }
      }
    }
  }
};

}  // namespace phyxel
