/// The passes that keep bodies apart at the end of a step, as a device and the host run them: one
/// row or one point at a time, over arrays of the points that may touch.
#pragma once

#include "phyxel/physics/body_contact.hpp"

namespace phyxel {

/// A point of a surface beside another body.
struct ContactRow {
  Index point = 0;  ///< Number of the point.
  Index body = 0;   ///< The body that it may enter.
  ContactLaw law;
  Index begin = 0, end = 0;  ///< Range of the phyxels of that body's surface near it.
};

/// The forces of other bodies on a phyxel in a step [N], along normals and along surfaces.
struct PointForces {
  Vec3<double> normal, tangential;
  PHYXEL_HD Vec3<double> sum() const { return normal + tangential; }
};

/// The arrays of the passes. Whoever fills them runs `find_touch` for all rows, `find_share` for
/// all points, `find_force` for all rows, then `forces_on` for its own points.
struct ContactPasses {
  const SurfaceSite* site = nullptr;  ///< Shape [points], as all others of points.
  const SurfaceMotion* motion = nullptr;
  const ContactRow* row = nullptr;      ///< Shape [rows], as all others of rows.
  const Index* near = nullptr;          ///< Points of each row, in its range: its entries.
  const Index* row_of_entry = nullptr;  ///< Row of each entry.
  /// Entries that name each point p: from entries_of_start[p] to entries_of_start[p + 1].
  const Offset* entries_of_start = nullptr;
  const Index* entries_of = nullptr;
  /// Rows that belong to each point.
  const Offset* rows_from_start = nullptr;
  const Index* rows_from = nullptr;
  const DistanceField* field = nullptr;  ///< Of each body of the scene.
  SurfaceTouch* touch = nullptr;         ///< Of each row.
  SurfaceForce* force = nullptr;         ///< Of each row.
  SurfaceShare* carries = nullptr;       ///< Of each entry.
  double* share = nullptr;               ///< c of each point [m²].
  double dt = 0;                         ///< [s]

  PHYXEL_HD void find_touch(Index r) const {
    const ContactRow& here = row[r];
    touch[r] = surface_touch(
        site[here.point], motion[here.point], here.end - here.begin,
        [&](int k) -> const SurfaceSite& { return site[near[here.begin + k]]; },
        [&](int k) -> const SurfaceMotion& { return motion[near[here.begin + k]]; },
        field[here.body], carries + here.begin);
  }
  PHYXEL_HD void find_share(Index p) const {
    double sum = 0;
    for (Offset k = rows_from_start[p]; k < rows_from_start[p + 1]; ++k) {
      if (touch[rows_from[k]].is_inside) sum += site[p].area;
    }
    for (Offset k = entries_of_start[p]; k < entries_of_start[p + 1]; ++k) {
      const Index e = entries_of[k];
      const double part = carries[e].part;
      if (part != 0) sum += site[row[row_of_entry[e]].point].area * std::fabs(part);
    }
    share[p] = sum;
  }
  PHYXEL_HD void find_force(Index r) const {
    force[r] = {};
    if (!touch[r].is_inside) return;
    const ContactRow& here = row[r];
    const SurfaceMotion& point = motion[here.point];
    Vec3<double> velocity = point.velocity, earlier = point.earlier;
    for (Index e = here.begin; e < here.end; ++e) {
      const double part = carries[e].part;
      if (part == 0) continue;
      velocity += -part * motion[near[e]].velocity;
      earlier += -part * motion[near[e]].earlier;
    }
    const auto mobility_along = [&](Vec3<double> d) {
      double sum = split_mobility(here.point, d);
      for (Index e = here.begin; e < here.end; ++e) {
        const double part = carries[e].part;
        if (part != 0) sum += std::fabs(part) * split_mobility(near[e], d);
      }
      return sum / site[here.point].area;
    };
    force[r] = surface_force(touch[r], velocity, earlier, here.law, dt, mobility_along);
  }
  PHYXEL_HD PointForces forces_on(Index p) const {
    PointForces sum;
    for (Offset k = rows_from_start[p]; k < rows_from_start[p + 1]; ++k) {
      sum.normal += force[rows_from[k]].normal;
      sum.tangential += force[rows_from[k]].tangential;
    }
    for (Offset k = entries_of_start[p]; k < entries_of_start[p + 1]; ++k) {
      const Index e = entries_of[k];
      if (!(carries[e].weight > 0)) continue;
      const Index r = row_of_entry[e];
      sum.normal += force[r].normal_reaction(carries[e]);
      sum.tangential += force[r].tangential_reaction(touch[r], carries[e], motion[p].before);
    }
    return sum;
  }
  /// The change of velocity by forces [m/s].
  PHYXEL_HD Vec3<double> change_by(const PointForces& forces, Index p) const {
    const Vec3<double> m = site[p].mobility, f = forces.sum();
    return {m.x * f.x, m.y * f.y, m.z * f.z};
  }

 private:
  /// c d · M d of a point along a direction d.
  PHYXEL_HD double split_mobility(Index p, Vec3<double> d) const {
    const Vec3<double> m = site[p].mobility;
    return share[p] * (d.x * d.x * m.x + d.y * d.y * m.y + d.z * d.z * m.z);
  }
};

}  // namespace phyxel
