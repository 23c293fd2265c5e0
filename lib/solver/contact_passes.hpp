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
  const ContactRow* row = nullptr;  ///< Shape [rows], as all others of rows.
  const Index* near = nullptr;      ///< Points of each row, in its range.
  /// Rows that each point is near to: those from rows_of_start[p] to rows_of_start[p + 1].
  const Offset* rows_of_start = nullptr;
  const Index* rows_of = nullptr;
  /// Rows of which it is the point.
  const Offset* rows_from_start = nullptr;
  const Index* rows_from = nullptr;
  const DistanceField* field = nullptr;  ///< Of each body of the scene.
  SurfaceTouch* touch = nullptr;         ///< Of each row.
  SurfaceForce* force = nullptr;         ///< Of each row.
  double* share = nullptr;               ///< c of each point [m²].
  double dt = 0;                         ///< [s]

  PHYXEL_HD void find_touch(Index r) const {
    const ContactRow& here = row[r];
    touch[r] = surface_touch(
        site[here.point], motion[here.point], here.end - here.begin,
        [&](int k) -> const SurfaceSite& { return site[near[here.begin + k]]; },
        [&](int k) -> const SurfaceMotion& { return motion[near[here.begin + k]]; },
        field[here.body]);
  }
  PHYXEL_HD void find_share(Index p) const {
    double sum = 0;
    for (Offset k = rows_from_start[p]; k < rows_from_start[p + 1]; ++k) {
      if (touch[rows_from[k]].is_inside) sum += site[p].area;
    }
    for_each_row_of(p, [&](Index r, double w) {
      sum += site[row[r].point].area * std::fabs(touch[r].share(w, motion[p].before));
    });
    share[p] = sum;
  }
  PHYXEL_HD void find_force(Index r) const {
    force[r] = {};
    if (!touch[r].is_inside) return;
    const SurfaceMotion& point = motion[row[r].point];
    Vec3<double> velocity = point.velocity, earlier = point.earlier;
    for_each_near(r, [&](Index k, double of_k) {
      velocity += -of_k * motion[k].velocity;
      earlier += -of_k * motion[k].earlier;
    });
    const auto mobility_along = [&](Vec3<double> d) {
      double sum = split_mobility(row[r].point, d);
      for_each_near(r,
                    [&](Index k, double of_k) { sum += std::fabs(of_k) * split_mobility(k, d); });
      return sum / site[row[r].point].area;
    };
    force[r] = surface_force(touch[r], velocity, earlier, row[r].law, dt, mobility_along);
  }
  PHYXEL_HD PointForces forces_on(Index p) const {
    PointForces sum;
    for (Offset k = rows_from_start[p]; k < rows_from_start[p + 1]; ++k) {
      sum.normal += force[rows_from[k]].normal;
      sum.tangential += force[rows_from[k]].tangential;
    }
    for_each_row_of(p, [&](Index r, double w) {
      sum.normal += force[r].normal_reaction(touch[r], w, motion[p].before);
      sum.tangential += force[r].tangential_reaction(touch[r], w, motion[p].before);
    });
    return sum;
  }
  /// The change of velocity by forces [m/s].
  PHYXEL_HD Vec3<double> change_by(const PointForces& forces, Index p) const {
    const Vec3<double> m = site[p].mobility, f = forces.sum();
    return {m.x * f.x, m.y * f.y, m.z * f.z};
  }

 private:
  /// The weight with which a phyxel carries the point of a row.
  PHYXEL_HD double weight(Index r, Index k) const {
    const Index p = row[r].point;
    const Vec3<double> apart = motion[k].after - motion[p].after;
    return carrying_weight(touch[r].normal, dot(apart, apart),
                           common_range(site[p].range, site[k].range), site[k], motion[k]);
  }
  /// Calls each(k, r_k) for the points near the point of a row.
  template <class Each>
  PHYXEL_HD void for_each_near(Index r, Each&& each) const {
    for (Index k = row[r].begin; k < row[r].end; ++k) {
      const double w = weight(r, near[k]);
      if (w > 0) each(near[k], touch[r].share(w, motion[near[k]].before));
    }
  }
  /// Calls each(r, w) for the rows that a point is near to and whose own point is inside.
  template <class Each>
  PHYXEL_HD void for_each_row_of(Index p, Each&& each) const {
    for (Offset k = rows_of_start[p]; k < rows_of_start[p + 1]; ++k) {
      const Index r = rows_of[k];
      if (!touch[r].is_inside) continue;
      const double w = weight(r, p);
      if (w > 0) each(r, w);
    }
  }
  /// c d · M d of a point along a direction d.
  PHYXEL_HD double split_mobility(Index p, Vec3<double> d) const {
    const Vec3<double> m = site[p].mobility;
    return share[p] * (d.x * d.x * m.x + d.y * d.y * m.y + d.z * d.z * m.z);
  }
};

}  // namespace phyxel
