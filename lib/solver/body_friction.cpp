/// Friction of bodies on each other in searches by Newton's method.
#include <algorithm>

#include "solver/body_penalty.hpp"

namespace phyxel {
namespace {

// Slips of bodies over those on obstacles at which friction is whole: blocks of single phyxels are
// no good preconditioner for springs between many, and conjugate gradients find stiff ones slowly.
constexpr double softness = 10;

}  // namespace

Vec3d BodyPenalty::slip(std::size_t r, const std::vector<Vec3d>& moved) const {
  const SurfaceTouch& touch = touches_[r];
  Vec3d all = along(touch.normal, moved[points_.rows()[r].point]);
  for_each_carrier(r, [&](Index p, const SurfaceShare& carries) {
    if (carries.weight > 0) all += slip_share(touch, carries, shape_place_[p]) * moved[p];
  });
  return all;
}

void BodyPenalty::find_rubbing(SlipMeasure measure) {
  rubbing_.assign(touches_.size(), {});
  slip_from_.assign(start_.size(), {});
  if (!(measure.share > 0)) return;  // it is not known how far points have slipped
  measure.share *= softness;
  slip_share_ = measure.share;
  slip_from_ = of_points(measure.from);
  std::vector<Vec3d> moved(start_.size()), ahead;
  for (std::size_t p = 0; p < moved.size(); ++p) moved[p] = start_[p] - slip_from_[p];
  if (measure.starts_moving()) {
    ahead = of_points(measure.ahead);
    for (std::size_t p = 0; p < ahead.size(); ++p) ahead[p] = ahead[p] - slip_from_[p];
  }
  record_.begin_linearise();
  const double reach = record_.reach(measure);
  for (std::size_t r = 0; r < rubbing_.size(); ++r) {
    const ContactRow& row = points_.rows()[r];
    const bool touches = gap_[r] < reach * points_.sites()[row.point].range;
    if (!touches_[r].is_inside || !(row.law.static_friction > 0)) continue;
    const double push = push_at(r, gap_[r]);
    if (!record_.rubs(key(r), touches, push)) continue;
    rubbing_[r].normal = touches_[r].normal;
    rubbing_[r].slip = slip(r, moved);
    record_.set_friction(key(r), row.law, push, stiffness_[r], measure,
                         ahead.empty() ? Vec3d{} : slip(r, ahead), rubbing_[r]);
  }
  record_.end_linearise();
}

void BodyPenalty::mix_friction() {
  for (std::size_t r = 0; r < rubbing_.size(); ++r) {
    if (!rubbing_[r].acts()) continue;
    rubbing_[r].set_limit(record_.friction(key(r), points_.rows()[r].law),
                          record_.counted(key(r), push_at(r, gap_[r])), stiffness_[r], slip_share_);
  }
}

bool BodyPenalty::begin_sliding() {
  if (!has_two_frictions_) return false;
  bool begins = false;
  for (std::size_t r = 0; r < rubbing_.size(); ++r) {
    if (!has_two_frictions(points_.rows()[r].law) || !rubbing_[r].has_slid()) continue;
    begins = record_.note_sliding(key(r)) || begins;
  }
  return model_.share ? model_.share->communicator->largest(begins ? 1.0 : 0.0) > 0 : begins;
}

template <class Each>
void BodyPenalty::for_each_friction(const Vector& u, Each&& each) const {
  std::vector<Vec3d> moved = of_points(u);
  for (std::size_t p = 0; p < moved.size(); ++p) moved[p] = moved[p] - slip_from_[p];
  for (std::size_t r = 0; r < rubbing_.size(); ++r) {
    const RubbingContact& contact = rubbing_[r];
    if (!contact.acts()) continue;
    each(r, friction_penalty(contact.limit, contact.normal, slip(r, moved), contact.way));
  }
}

void BodyPenalty::add_friction_energy(const Vector& u, ExactSum& sum) const {
  for_each_friction(u, [&](std::size_t r, const PenaltyForce& friction) {
    if (is_own(r)) sum.add(friction.energy);
  });
}

std::vector<Vec3d> BodyPenalty::friction(const Vector& u) const {
  std::vector<Vec3d> of_rows(rubbing_.size()), force(count());
  for_each_friction(
      u, [&](std::size_t r, const PenaltyForce& friction) { of_rows[r] = friction.force; });
  add_friction(of_rows, force);
  return force;
}

void BodyPenalty::add_friction(const std::vector<Vec3d>& of_rows, std::vector<Vec3d>& force) const {
  const Csr &from = points_.rows_from(), &of = points_.entries_of();
  for (std::size_t p = 0; p < count(); ++p) {
    for (Offset k = from.offsets[p]; k < from.offsets[p + 1]; ++k) {
      force[p] += of_rows[from.indices[k]];
    }
    const Offset* start = of.offsets.data() + contact_threads * p;
    for (Offset k = start[0]; k < start[contact_threads]; ++k) {
      const Index e = of.indices[k], r = points_.rows_naming()[k];
      if (!(carries_[e].weight > 0)) continue;
      SurfaceForce whole;
      whole.set_friction(touches_[r], of_rows[r]);
      force[p] += whole.tangential_reaction(touches_[r], carries_[e], shape_place_[p]);
    }
  }
}

void BodyPenalty::add_friction_to_blocks() {
  const auto own = static_cast<Index>(count());
  for (std::size_t r = 0; r < rubbing_.size(); ++r) {
    if (!rubbing_[r].acts()) continue;
    const Mat3d& whole = rubbing_[r].stiffness;
    if (const Index p = points_.rows()[r].point; p < own) blocks_[p] += whole;
    for_each_carrier(r, [&](Index p, const SurfaceShare& carries) {
      if (p >= own || !(carries.weight > 0)) return;
      const Mat3d share = slip_share(touches_[r], carries, shape_place_[p]);
      blocks_[p] += transpose(share) * whole * share;
    });
  }
}

}  // namespace phyxel
