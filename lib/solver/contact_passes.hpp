/// The passes that keep bodies apart at the end of a step, as a device and the host run them: one
/// row or one point at a time, over arrays of the points that may touch.
#pragma once

#include "phyxel/physics/body_contact.hpp"
#include "phyxel/physics/contact_penalty.hpp"
#include "phyxel/physics/surface_patches.hpp"

namespace phyxel {

/// A point of a surface beside another body.
struct ContactRow {
  Index point = 0;    ///< Number of the point.
  Index body = 0;     ///< The body that it may enter.
  Index patch = 0;    ///< Number of the patch of that body's surface (`SurfacePatches`).
  Index patches = 1;  ///< Rows of the point and the body, one for each patch, with equal lists.
  ContactLaw law;
  double apart = 0;  ///< As of `surface_touch` [m].
};

/// The forces of other bodies on a phyxel in a step [N], along normals and along surfaces.
struct PointForces {
  Vec3<double> normal, tangential;
  PHYXEL_HD Vec3<double> sum() const { return normal + tangential; }
};

/// An entry that carries a force in this step.
struct SurfaceCarrier {
  Index entry = 0, row = 0;
};

/// How far points have moved since lists were found.
struct PointWay {
  double before = 0;   ///< The sum over earlier steps of the largest way of a point [m].
  double in_step = 0;  ///< The largest way in this step [m].

  PHYXEL_HD double sum() const { return before + in_step; }
};

/// The components of a vector along the axes on which a phyxel is free.
PHYXEL_HD Vec3<double> along_free_axes(const SurfaceSite& site, Vec3<double> v) {
  const Vec3<double> m = site.mobility;
  return {m.x > 0 ? v.x : 0.0, m.y > 0 ? v.y : 0.0, m.z > 0 ? v.z : 0.0};
}

/// The arrays of the passes. Whoever fills them runs `find_touch` for all rows,
/// `find_carriers` and `find_share` for all points on which forces may act, and `find_response` for
/// all rows; then, in each sweep, `find_force` for all rows and `forces_on` for its own points,
/// whose velocities it changes. Each is run by one thread (`OneThread`) or by a group that shares
/// the work.
struct ContactPasses {
  const SurfaceSite* site = nullptr;  ///< Shape [points], as all others of points.
  const SurfaceMotion* motion = nullptr;
  const Vec3<double>* velocity = nullptr;  ///< Over the step, so far [m/s].
  const ContactRow* row = nullptr;         ///< Shape [rows], as all others of rows.
  /// Entries of each row, the points near it: the parts of its list (`contact_threads`) start at
  /// near_start.
  const Offset* near_start = nullptr;
  const Index* near = nullptr;  ///< Of each entry: its point.
  /// Entries that name each point, in parts, too.
  const Offset* entries_of_start = nullptr;
  const Index* entries_of = nullptr;
  const Index* rows_naming = nullptr;  ///< Of each of these: its row.
  /// Rows that belong to each point, not in parts.
  const Offset* rows_from_start = nullptr;
  const Index* rows_from = nullptr;
  const PlacedDistances* field = nullptr;  ///< Of each body of the scene.
  SurfaceTouch* touch = nullptr;           ///< Of each row.
  SurfaceResponse* response = nullptr;     ///< Of each row.
  SurfaceForce* force = nullptr;           ///< Of each row.
  SurfaceShare* carries = nullptr;         ///< Of each entry.
  /// The entries of each point that carry a force, at the start of the place of each part of its
  /// `entries_of`, and the number of these entries.
  SurfaceCarrier* carriers = nullptr;
  Index* carrier_count = nullptr;  ///< Shape [contact_threads, points].
  /// Of each entry within range: true if it is of its row's patch; null if no point is beside
  /// several.
  char* in_patch = nullptr;
  double* share = nullptr;  ///< c of each point [m²].
  /// Of each row: the way of all points up to which none of its list can come within range [m]. A
  /// row is asleep until then: its point is outside. Null: rows do not sleep.
  double* wakes = nullptr;
  const PointWay* way = nullptr;  ///< If rows sleep.
  char* is_inside = nullptr;      ///< Of each row: receives true if its point is inside.
  /// Of each point: receives true if a force may act on it. Null: that is not asked.
  char* is_active = nullptr;
  double dt = 0;  ///< [s]
  /// As of `surface_touch`. By default a point has to be inside by more than rounding.
  double reach = -1e-9;

  /// The phyxels that entries name.
  PHYXEL_HD auto sites() const {
    return [this](Offset e) -> const SurfaceSite& { return site[near[e]]; };
  }
  PHYXEL_HD auto motions() const {
    return [this](Offset e) -> const SurfaceMotion& { return motion[near[e]]; };
  }
  /// The list of a row, as of `OneThread::each`.
  PHYXEL_HD const Offset* entries_of_row(Index r) const {
    return near_start + contact_threads * static_cast<Offset>(r);
  }
  /// True if a row sleeps in this step.
  PHYXEL_HD bool is_asleep(Index r) const { return wakes && way->sum() < wakes[r]; }

  /// Finds whether a row's point is inside the body, and who carries it.
  template <class Threads>
  PHYXEL_HD void find_touch(const Threads& threads, Index r) const {
    if (is_asleep(r)) return;
    const WithinRange in_range(threads, motion[row[r].point], entries_of_row(r), motions());
    if (!comes_near(threads, in_range, r)) return;
    find_patch(in_range, r);
    if (find_touch_within(threads, in_range, r)) find_carrying(threads, in_range, r);
  }
  /// Devices run `find_touch` in four parts. The first part returns true if a row's body is so near
  /// that the row's point may be inside, and else sets the row's touch.
  /// @param in_range the row's entries within range
  template <class Threads>
  PHYXEL_HD bool comes_near(const Threads& threads, const WithinRange<Threads>& in_range,
                            Index r) const {
    if (touch[r].is_inside) threads.each(entries_of_row(r), [&](Offset e) { carries[e] = {}; });
    const WeightsNear near_here =
        weights_near(in_range, motion[row[r].point], entries_of_row(r), motions());
    if (near_here.tell()) return true;
    SurfaceTouch found;
    found.is_alone = !(near_here.nearness > 0);
    set_touch(threads, r, found);
    return false;
  }
  /// The second part marks the entries of a row's patch, if the row's point is beside several.
  template <class Threads>
  PHYXEL_HD void find_patch(const WithinRange<Threads>& in_range, Index r) const {
    const ContactRow& here = row[r];
    if (here.patches == 1) return;
    const SurfacePatches patches(in_range, site[here.point], motion[here.point], entries_of_row(r),
                                 sites(), motions(), here.patches);
    in_range.each(entries_of_row(r), [&](Offset e) {
      in_patch[e] = here.patch < patches.count() && patches.of(site[near[e]].rest) == here.patch;
    });
  }
  /// The third part finds the touch of a near row, without the fields that `carry` sets.
  /// @returns true if its point is inside
  template <class Threads>
  PHYXEL_HD bool find_touch_within(const Threads& threads, const WithinRange<Threads>& in_range,
                                   Index r) const {
    const ContactRow& here = row[r];
    const SurfaceTouch found =
        surface_touch(of_patch(in_range, r), site[here.point], motion[here.point],
                      entries_of_row(r), sites(), motions(), field[here.body], here.apart, reach);
    set_touch(threads, r, found);
    return found.is_inside;
  }
  /// The fourth part finds the phyxels that carry the point of a row, which is inside.
  template <class Threads>
  PHYXEL_HD void find_carrying(const Threads& threads, const WithinRange<Threads>& in_range,
                               Index r) const {
    const Index p = row[r].point;
    SurfaceTouch found = touch[r];
    carry(of_patch(in_range, r), site[p], motion[p], entries_of_row(r), sites(), motions(), found,
          carries);
    if (is_active) {
      in_range.each(entries_of_row(r), [&](Offset e) {
        if (carries[e].weight > 0) is_active[near[e]] = 1;
      });
    }
    if (threads.is_first()) touch[r] = found;
  }
  /// Finds the entries by which other bodies act on a point.
  template <class Threads>
  PHYXEL_HD void find_carriers(const Threads& threads, Index p) const {
    if (is_active && !is_active[p]) return;
    SurfaceCarrier* const first = carriers + entries_of_point(p)[threads.part()];
    Index count = 0;
    threads.each(entries_of_point(p), [&](Offset k) {
      const Index e = entries_of[k], r = rows_naming[k];
      if (is_inside[r] && carries[e].weight > 0) first[count++] = {e, r};
    });
    carrier_count[contact_threads * static_cast<Offset>(p) + threads.part()] = count;
  }
  template <class Threads>
  PHYXEL_HD void find_share(const Threads& threads, Index p) const {
    if (is_active && !is_active[p]) return;
    double area = 0;
    each_carrier(threads, p, [&](Index e, Index) { area += carries[e].area; });
    area = threads.sum(area);
    if (!threads.is_first()) return;
    for (Offset k = rows_from_start[p]; k < rows_from_start[p + 1]; ++k) {
      if (touch[rows_from[k]].is_inside) area += site[p].area;
    }
    share[p] = area;
  }
  template <class Threads>
  PHYXEL_HD void find_response(const Threads& threads, Index r) const {
    if (!touch[r].is_inside) return;
    const ContactRow& here = row[r];
    const Vec3<double> n = touch[r].normal;
    Vec3<double> mobility{}, earlier{};
    double free = 0;  // Σ r_k n̄ · F_k n̄
    threads.each(entries_of_row(r), [&](Offset e) {
      const double part = carries[e].part;
      if (part == 0) return;
      mobility += std::fabs(part) * share[near[e]] * site[near[e]].mobility;
      earlier += part * motion[near[e]].earlier;
      free += part * dot(n, along_free_axes(site[near[e]], n));
    });
    SurfaceResponse found;
    found.mobility = (1 / site[here.point].area) *
                     (threads.sum(mobility) + share[here.point] * site[here.point].mobility);
    found.target = target_velocity(touch[r], relative_velocity(threads, r),
                                   motion[here.point].earlier - threads.sum(earlier), here.law,
                                   depth_recovery(site[here.point], dt), dt);
    free = dot(n, along_free_axes(site[here.point], n)) + threads.sum(free);  // 2: nothing is held
    constexpr double almost_one = 0.999;  // by rounding; 1 of a free point on a held surface
    if (free < almost_one) {
      found.free = free > 0 ? free : 0;
      found.target *= found.free * found.free;
    }
    if (threads.is_first()) response[r] = found;
  }
  template <class Threads>
  PHYXEL_HD void find_force(const Threads& threads, Index r) const {
    SurfaceForce found{};
    if (touch[r].is_inside) {
      found = surface_force(touch[r], response[r], velocity_of_free(threads, r), row[r].law);
    }
    if (threads.is_first()) force[r] = found;
  }
  template <class Threads>
  PHYXEL_HD PointForces forces_on(const Threads& threads, Index p) const {
    PointForces sum;
    each_carrier(threads, p, [&](Index e, Index r) {
      sum.normal += force[r].normal_reaction(touch[r], carries[e]);
      sum.tangential += force[r].tangential_reaction(touch[r], carries[e], motion[p].before);
    });
    sum = {threads.sum(sum.normal), threads.sum(sum.tangential)};
    for (Offset k = rows_from_start[p]; k < rows_from_start[p + 1]; ++k) {
      const Index r = rows_from[k];
      if (!touch[r].is_inside) continue;
      sum.normal += force[r].push * touch[r].normal;
      sum.tangential += force[r].tangential;
    }
    return sum;
  }
  /// The change of velocity by forces [m/s].
  PHYXEL_HD Vec3<double> change_by(const PointForces& forces, Index p) const {
    const Vec3<double> m = site[p].mobility, f = forces.sum();
    return {m.x * f.x, m.y * f.y, m.z * f.z};
  }

 protected:
  /// The entries of a row's patch within range.
  template <class Threads>
  PHYXEL_HD OfPatch<WithinRange<Threads>> of_patch(const WithinRange<Threads>& in_range,
                                                   Index r) const {
    return {in_range, row[r].patches == 1 ? nullptr : in_patch};
  }
  /// Sets the touch of a row, and the way at which the row wakes.
  template <class Threads>
  PHYXEL_HD void set_touch(const Threads& threads, Index r, const SurfaceTouch& found) const {
    const double wakes_at = wakes && found.is_alone ? waking_of(threads, r) : 0;
    if (!threads.is_first()) return;
    touch[r] = found;
    if (is_inside) is_inside[r] = found.is_inside;
    if (is_active && found.is_inside) is_active[row[r].point] = 1;
    if (wakes) wakes[r] = wakes_at;
  }
  /// The way of all points at which one of a row's list may come within range; they may move by as
  /// much as its point.
  template <class Threads>
  PHYXEL_HD double waking_of(const Threads& threads, Index r) const {
    const Index p = row[r].point;
    double least = no_square;
    threads.each(entries_of_row(r), [&](Offset e) {
      const Vec3<double> apart = motion[near[e]].after - motion[p].after;
      const double distance = std::sqrt(dot(apart, apart));
      const double left = distance - common_range(site[p].range, site[near[e]].range);
      if (left < least) least = left;
    });
    constexpr double almost_half = 0.499;  // by rounding
    return way->sum() + almost_half * threads.least(least);
  }
  PHYXEL_HD const Offset* entries_of_point(Index p) const {
    return entries_of_start + contact_threads * static_cast<Offset>(p);
  }
  /// Calls visit(entry, row) for what `find_carriers` has found of a point.
  template <class Threads, class Visit>
  PHYXEL_HD void each_carrier(const Threads& threads, Index p, Visit&& visit) const {
    const SurfaceCarrier* const first = carriers + entries_of_point(p)[threads.part()];
    const Index count = carrier_count[contact_threads * static_cast<Offset>(p) + threads.part()];
    for (Index k = 0; k < count; ++k) visit(first[k].entry, first[k].row);
  }
  /// The velocity of a row's point relative to those that carry it.
  template <class Threads>
  PHYXEL_HD Vec3<double> relative_velocity(const Threads& threads, Index r) const {
    Vec3<double> surface{};
    threads.each(entries_of_row(r), [&](Offset e) {
      const double part = carries[e].part;
      if (part != 0) surface += part * velocity[near[e]];
    });
    return velocity[row[r].point] - threads.sum(surface);
  }
  /// The velocity that the force of a row is to change. If only a share s < 1 of the row is free
  /// along its normal, s = n̄ · F_p n̄ + Σ r_k n̄ · F_k n̄ with 1 in F along free axes, that is
  ///
  ///   v' = s (F_p (v_p - Σ r_k v_k) + Σ r_k F_k (v_p - v_k)),
  ///
  /// so that the few phyxels that are free follow the point, and no faster, by a force that is no
  /// larger than one on a free point: they cannot make good what held ones would have to do.
  template <class Threads>
  PHYXEL_HD Vec3<double> velocity_of_free(const Threads& threads, Index r) const {
    const Vec3<double> whole = relative_velocity(threads, r);
    const double free = response[r].free;
    if (free == 1) return whole;
    const Index p = row[r].point;
    Vec3<double> surface{};
    threads.each(entries_of_row(r), [&](Offset e) {
      const double part = carries[e].part;
      const Index k = near[e];
      if (part != 0) surface += part * along_free_axes(site[k], velocity[p] - velocity[k]);
    });
    return free * (along_free_axes(site[p], whole) + threads.sum(surface));
  }
};

/// The passes of contact by penalties. At the start of a step, where points are both before and
/// after, `find_touch` and `find_push` for all rows give the normal forces; at its end, with
/// velocities as all other forces have led to, `find_share`, `find_response` and `find_rub` give
/// those along surfaces.
struct PenaltyPasses : ContactPasses {
  const double* modulus = nullptr;  ///< Of pressure waves, of each point [Pa].
  double stiffness = 0;             ///< Share of `surface_stiffness`.

  template <class Threads>
  PHYXEL_HD void find_push(const Threads& threads, Index r) const {
    SurfaceForce found{};
    if (touch[r].is_inside) found.push = -stiffness_of(threads, r) * touch[r].gap;
    if (threads.is_first()) force[r] = found;
  }
  template <class Threads>
  PHYXEL_HD void find_rub(const Threads& threads, Index r) const {
    if (!touch[r].is_inside) return;
    SurfaceForce found{.push = force[r].push};
    add_friction(touch[r], response[r], velocity_of_free(threads, r), row[r].law, found);
    if (threads.is_first()) force[r] = found;
  }
  /// The energy of a row whose `find_push` has been run [J].
  PHYXEL_HD double energy(Index r) const {
    return touch[r].is_inside ? -0.5 * force[r].push * touch[r].gap : 0;
  }

 private:
  template <class Threads>
  PHYXEL_HD double stiffness_of(const Threads& threads, Index r) const {
    double of_surface = 0;
    threads.each(entries_of_row(r),
                 [&](Offset e) { of_surface += carries[e].weight * modulus[near[e]]; });
    const Index p = row[r].point;
    return surface_stiffness(stiffness, modulus[p], threads.sum(of_surface), site[p]);
  }
};

}  // namespace phyxel
