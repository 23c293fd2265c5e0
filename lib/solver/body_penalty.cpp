#include "solver/body_penalty.hpp"

#include <algorithm>
#include <cmath>

#include "mesh/distance_field.hpp"
#include "model/parts.hpp"
#include "phyxel/diagnostics.hpp"
#include "rank_sums.hpp"
#include "solver/contact_penalty.hpp"
#include "solver/contact_stiffness.hpp"

namespace phyxel {
namespace {

constexpr double reach = 0.25;  // gap of points that may touch before the next `linearise`

}  // namespace

BodyPenalty::BodyPenalty(const Model& model) : model_(model), layer_(model), points_(layer_) {
  if (empty()) return;
  for (const auto& distances : model.body_contact.distances) {
    fields_.push_back(distances ? distances.view() : PlacedDistances{});
  }
  rubs_ = has_body_friction(model.body_contact);
  const auto note = [&](const ContactLaw& law) {
    has_two_frictions_ = has_two_frictions_ || has_two_frictions(law);
  };
  note(model.body_contact.law);
  for (const BodyContact::Pair& pair : model.body_contact.pairs) note(pair.law);
}

void BodyPenalty::find_points(const Vector& u) {
  const std::vector<Index>& layer = model_.body_contact.layer.phyxels;
  std::vector<Vec3d> now(layer.size());
  double moved = knows_points_ ? 0 : HUGE_VAL;
  for (std::size_t k = 0; k < layer.size(); ++k) {
    now[k] = model_.position[layer[k]] + u[layer[k]];
    if (knows_points_) moved = std::max(moved, norm(now[k] - found_at_[k]));
  }
  if (model_.share) moved = model_.share->communicator->largest(moved);
  if (moved <= 0.5 * layer_.least_skin()) return;
  found_at_ = std::move(now);
  points_.find(found_at_, 1, layer_.skins(layer_.least_skin()));
  modulus_ = points_.wave_moduli();
  knows_points_ = true;
  knows_shapes_ = knows_expected_ = false;
  mixing_.forget();
}

/// Finds gaps anew, and normals and shares if points have moved far enough. These jump where a
/// point passes an edge, so that a search that asked for them at each step would not come to an
/// end.
void BodyPenalty::find_touches() {
  std::vector<SurfaceTouch> touches(points_.rows().size());
  std::vector<SurfaceShare> carries(points_.near().indices.size());
  std::vector<char> in_patch(points_.have_patches() ? carries.size() : 0, 1);
  const ContactPasses passes{.site = points_.sites().data(),
                             .motion = motion_.data(),
                             .row = points_.rows().data(),
                             .near_start = points_.near().offsets.data(),
                             .near = points_.near().indices.data(),
                             .field = fields_.data(),
                             .touch = touches.data(),
                             .carries = carries.data(),
                             .in_patch = in_patch.empty() ? nullptr : in_patch.data(),
                             .reach = reach};
  for (std::size_t r = 0; r < touches.size(); ++r) {
    passes.find_touch(OneThread{}, static_cast<Index>(r));
  }
  double moved = knows_shapes_ ? 0 : HUGE_VAL;  // as a share of ranges
  for (std::size_t p = 0; knows_shapes_ && p < count(); ++p) {
    moved = std::max(moved, norm(motion_[p].after - shaped_at_[p]) / points_.sites()[p].range);
  }
  if (model_.share) moved = model_.share->communicator->largest(moved);
  if (moved <= far_) {
    for (std::size_t r = 0; r < touches.size(); ++r) {
      if (touches[r].normal != Vec3d{}) {
        touches_[r].gap = touches[r].gap;
      } else {
        touches_[r].is_inside = false;  // nothing of the other surface faces it any more
      }
    }
    return;
  }
  if (knows_shapes_) far_ *= 1.2;
  touches_ = std::move(touches);
  carries_ = std::move(carries);
  knows_shapes_ = true;
  shaped_at_.clear();
  for (std::size_t p = 0; p < count(); ++p) shaped_at_.push_back(motion_[p].after);
  if (!rubs_) return;
  shape_place_.clear();
  for (const SurfaceMotion& motion : motion_) shape_place_.push_back(motion.after);
}

void BodyPenalty::linearise(const Vector& u, const SlipMeasure& slip,
                            const std::vector<Mat3d>& gradient) {
  if (empty()) return;
  knows_expected_ = knows_points_;
  if (knows_expected_) expected_ = gaps(u);
  find_points(u);
  const std::size_t points = points_.sites().size(), rows = points_.rows().size();
  stiff_reach_ = slip.rests && renewals_++ < 6 ? rounding_reach : 0;
  motion_.assign(points, {});
  for (std::size_t p = 0; p < count(); ++p) {
    const Index i = phyxel(p);
    motion_[p].before = motion_[p].after = model_.position[i] + u[i];
    set_gradient(motion_[p], points_.sites()[p], gradient[i]);
  }
  points_.refresh(motion_);
  start_ = renewed_at_ = of_points(u);
  find_touches();
  stiffness_.assign(rows, 0);
  for (std::size_t r = 0; r < rows; ++r) {
    if (!touches_[r].is_inside) continue;
    const Index point = points_.rows()[r].point;
    const SurfaceSite& site = points_.sites()[point];
    double of_surface = 0;
    for_each_carrier(r, [&](Index p, const SurfaceShare& carries) {
      of_surface += carries.weight * modulus_[p];
    });
    stiffness_[r] = surface_stiffness(share_of_stiffness, modulus_[point], of_surface, site);
  }
  gap_.resize(rows);
  for (std::size_t r = 0; r < rows; ++r) gap_[r] = touches_[r].gap;
  if (rubs_) find_rubbing(slip);
  find_blocks();
}

void BodyPenalty::move_to(const Vector& u, const SlipMeasure& slip) {
  if (empty()) return;
  gap_ = gaps(u);
  start_ = of_points(u);
  if (rubs_) find_rubbing(slip);
  find_blocks();
}

double BodyPenalty::way_to(const Vector& u) const {
  double farthest = 0;
  for (std::size_t p = 0; p < count(); ++p) {
    const double way = norm(u[phyxel(p)] - renewed_at_[p]);
    farthest = std::max(farthest, way / (far_ * points_.sites()[p].range));
  }
  return farthest;
}

bool BodyPenalty::mix(const Vector& u, double share) {
  if (empty() || !knows_expected_) return false;
  // The unknowns are what the gaps would be without displacements.
  const std::vector<Vec3d> moved = of_points(u);
  std::vector<double> way(gap_.size()), x(gap_.size()), f(gap_.size());
  for (std::size_t r = 0; r < gap_.size(); ++r) {
    if (!touches_[r].is_inside) continue;
    way[r] = along_normal(r, moved);
    x[r] = expected_[r] - way[r];
    f[r] = gap_[r] - expected_[r];
  }
  const auto product = [&](const std::vector<double>& a, const std::vector<double>& b) {
    ExactSum sum;
    for (std::size_t r = 0; r < a.size(); ++r) {
      if (is_own(r)) sum.add(a[r] * b[r]);
    }
    if (model_.share) add_over_ranks(*model_.share->communicator, {&sum});
    return sum.value();
  };
  const std::vector<double> next = mixing_.next(x, f, share, product);
  for (std::size_t r = 0; r < gap_.size(); ++r) {
    if (touches_[r].is_inside) gap_[r] = next[r] + way[r];
  }
  if (rubs_) mix_friction();
  return true;
}

std::vector<Vec3d> BodyPenalty::of_points(const Vector& of_phyxels) const {
  std::vector<Vec3d> all(points_.sites().size());
  for (std::size_t p = 0; p < count(); ++p) all[p] = of_phyxels[phyxel(p)];
  points_.refresh(all);
  return all;
}

double BodyPenalty::along_normal(std::size_t r, const std::vector<Vec3d>& of_points) const {
  Vec3d apart = of_points[points_.rows()[r].point];
  for_each_carrier(
      r, [&](Index p, const SurfaceShare& carries) { apart += -carries.part * of_points[p]; });
  return dot(touches_[r].normal, apart);
}

std::vector<Vec3d> BodyPenalty::spread(const std::vector<double>& push) const {
  std::vector<Vec3d> force(count());
  const Csr &from = points_.rows_from(), &of = points_.entries_of();
  for (std::size_t p = 0; p < count(); ++p) {
    for (Offset k = from.offsets[p]; k < from.offsets[p + 1]; ++k) {
      const Index r = from.indices[k];
      force[p] += push[r] * touches_[r].normal;
    }
    const Offset* start = of.offsets.data() + contact_threads * p;
    for (Offset k = start[0]; k < start[contact_threads]; ++k) {
      const Index e = of.indices[k], r = points_.rows_naming()[k];
      force[p] += -carries_[e].part * push[r] * touches_[r].normal;
    }
  }
  return force;
}

std::vector<double> BodyPenalty::gaps(const Vector& u) const {
  std::vector<Vec3d> moved = of_points(u);
  for (std::size_t p = 0; p < start_.size(); ++p) moved[p] = moved[p] - start_[p];
  std::vector<double> gap = gap_;
  for (std::size_t r = 0; r < gap.size(); ++r) {
    if (touches_[r].is_inside) gap[r] += along_normal(r, moved);
  }
  return gap;
}

std::vector<double> BodyPenalty::pushes(const Vector& u) const {
  std::vector<double> push = gaps(u);
  for (std::size_t r = 0; r < push.size(); ++r) push[r] = push_at(r, push[r]);
  return push;
}

double BodyPenalty::push_at(std::size_t r, double gap) const {
  return touches_[r].is_inside ? std::max(0.0, -stiffness_[r] * gap) : 0;
}

void BodyPenalty::add(const Vector& u, Vector& force) const {
  if (empty()) return;
  const std::vector<Vec3d> forces = spread(pushes(u));
  for (std::size_t p = 0; p < count(); ++p) force[phyxel(p)] += forces[p];
  if (!rubs_) return;
  const std::vector<Vec3d> along = friction(u);
  for (std::size_t p = 0; p < count(); ++p) force[phyxel(p)] += along[p];
}

void BodyPenalty::add_energy(const Vector& u, ExactSum& sum) const {
  if (empty()) return;
  const std::vector<double> push = pushes(u);
  for (std::size_t r = 0; r < push.size(); ++r) {
    if (is_own(r) && push[r] > 0) sum.add(0.5 * push[r] * push[r] / stiffness_[r]);
  }
  if (rubs_) add_friction_energy(u, sum);
}

void BodyPenalty::add_squares(ExactSum& sum) const {
  for (std::size_t r = 0; r < touches_.size(); ++r) {
    const double push = push_at(r, touches_[r].gap);
    if (is_own(r)) sum.add(push * push);
  }
}

void BodyPenalty::add_stiffness_times(const Vector& v, Vector& out) const {
  if (empty()) return;
  const std::vector<Vec3d> moved = of_points(v);
  std::vector<double> pull(touches_.size());
  for (std::size_t r = 0; r < pull.size(); ++r) {
    if (is_held(r)) pull[r] = stiffness_[r] * along_normal(r, moved);
  }
  std::vector<Vec3d> forces = spread(pull);
  if (rubs_) {
    std::vector<Vec3d> along(pull.size());
    for (std::size_t r = 0; r < along.size(); ++r) {
      if (rubbing_[r].acts()) along[r] = rubbing_[r].stiffness * slip(r, moved);
    }
    add_friction(along, forces);
  }
  for (std::size_t p = 0; p < count(); ++p) out[phyxel(p)] += forces[p];
}

bool BodyPenalty::is_held(std::size_t r) const {
  const double range = points_.sites()[points_.rows()[r].point].range;
  return touches_[r].is_inside && gap_[r] < stiff_reach_ * range;
}

void BodyPenalty::find_blocks() {
  blocks_.assign(count(), {});
  for (std::size_t r = 0; r < touches_.size(); ++r) {
    if (!is_held(r)) continue;
    const Mat3d whole = stiffness_[r] * outer(touches_[r].normal, touches_[r].normal);
    const auto add_to = [&](Index p, double share) {
      if (p < static_cast<Index>(count())) blocks_[p] += share * whole;
    };
    add_to(points_.rows()[r].point, 1);
    for_each_carrier(
        r, [&](Index p, const SurfaceShare& carries) { add_to(p, carries.part * carries.part); });
  }
  if (rubs_) add_friction_to_blocks();
}

BodyPenalty::Depths BodyPenalty::depths() const {
  Depths found{std::vector<double>(2 * fields_.size())};
  const std::vector<double>& ranges = layer_.ranges_of_bodies();
  for (std::size_t r = 0; r < touches_.size(); ++r) {
    if (!touches_[r].is_inside || !is_own(r)) continue;
    const Index p = points_.rows()[r].point;
    const Index body = points_.bodies()[p], other = points_.rows()[r].body;
    const double depth = -touches_[r].gap;
    const auto keep_deeper = [](double& kept, double now) { kept = std::max(kept, now); };
    keep_deeper(found.of_body[body], depth);
    keep_deeper(found.of_body[fields_.size() + static_cast<std::size_t>(body)],
                depth / std::min(ranges[body], ranges[other]));
    keep_deeper(found.share, depth / points_.sites()[p].range);
  }
  return found;
}

void BodyPenalty::add_to(const Vector& u, const Vector& velocity, double time,
                         std::span<ExactSum> sums) const {
  if (empty()) return;
  std::vector<double> push(touches_.size());
  for (std::size_t r = 0; r < push.size(); ++r) push[r] = push_at(r, touches_[r].gap);
  const std::vector<Vec3d> forces = spread(push);
  const std::vector<Vec3d> along = rubs_ ? friction(u) : std::vector<Vec3d>(count());
  for (std::size_t p = 0; p < count(); ++p) {
    if (forces[p] == Vec3d{} && along[p] == Vec3d{}) continue;
    const Part& part = part_of(model_, phyxel(p));
    const Vec3d v = velocity[phyxel(p)];
    ContactTerms terms;
    terms.set(time * forces[p], time * along[p], motion_[p].after - part.centre, v, v);
    terms.value[ContactTerms::impact_loss] = 0;  // an energy loses nothing
    for (int t = 0; t < ContactTerms::count; ++t) {
      sums[static_cast<std::size_t>(part.body) * ContactTerms::count + t].add(terms.value[t]);
    }
  }
}

}  // namespace phyxel
