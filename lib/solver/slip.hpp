/// Slip of points that rub, in searches by Newton's method.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "phyxel/physics/friction_penalty.hpp"

namespace phyxel {

/// Gap up to which a point counts as touching, as a share of its support.
inline constexpr double rounding_reach = 1e-6;
/// Gap up to which a point rubs by a normal force that is held, likewise.
inline constexpr double held_reach = 0.1;

/// What slip is in a search: motions along surfaces since the start of the stage.
struct SlipMeasure {
  /// Displacements at the start of the stage [m], shape [n]; empty in scenes without friction.
  std::vector<Vec3d> from;
  /// Slip at which friction is whole, over the depth at which the penalty is the normal force; 0
  /// where slips are not known, and friction is none.
  double share = 0;
  /// Displacements that the velocities before a stage of an implicit step lead to at its end [m],
  /// from which a search starts; empty if all points are at rest before it.
  std::vector<Vec3d> ahead;
  /// True of a search for rest, where contact alone may hold a body.
  bool rests = false;

  /// True if points are not at rest before the stage.
  bool starts_moving() const { return !ahead.empty(); }
};

/// Update of contact before a step of Newton's method: of all, or of the motion of points alone,
/// with gaps between bodies by their linear form. Gaps depend on deformation gradients in ways that
/// the stiffness does not contain: while their linear form is kept, Newton's method converges fast.
enum class Renewal { all, motion };

/// A contact that rubs, as it was at the last `linearise`.
struct RubbingContact {
  Vec3d normal;         ///< Away from what the point touches.
  FrictionLimit limit;  ///< No force and no stiffness: it does not rub.
  Vec3d slip;           ///< [m]
  Vec3d way;            ///< As of `friction_penalty`.
  Mat3d stiffness{};    ///< [N/m]

  bool acts() const { return limit.stiffness > 0; }
  /// True if the slip is so large that the kinetic friction acts from then on.
  bool has_slid() const { return limit.force > 0 && norm(slip) > limit.width(); }
  /// Sets the limit, and the stiffness at the present slip.
  /// @param push normal force [N]. @param of_penalty stiffness of the penalty [N/m]
  void set_limit(double friction, double push, double of_penalty, double share) {
    limit = {friction * push, 2 * friction * of_penalty / share};
    stiffness = friction_penalty(limit, normal, slip, way).stiffness;
  }
};

/// What a search has seen of the contacts that rub. A point feels the kinetic friction until the
/// search ends if the search finds it sliding: in an implicit step as it first touches, with the
/// velocity before the stage, and where forces balance with the static one.
///
/// Friction has an energy only while normal forces do not change: a search may hold them, and
/// renews them where it has found a balance.
class RubbingRecord {
 public:
  /// A point, and what it touches.
  using Key = std::pair<Index, Index>;

  /// Begins a search.
  void forget() {
    seen_.clear();
    is_first_ = true;
    holds_ = false;
  }
  /// True if the normal forces of friction are held.
  bool holds() const { return holds_; }
  /// Holds the normal forces of friction where they are, or moves them by a share of the way to the
  /// present ones from where they are held.
  void renew(double share) {
    for (auto& [key, contact] : seen_) {
      contact.held = holds_ ? contact.held + share * (contact.push - contact.held) : contact.push;
    }
    holds_ = true;
  }
  /// The held normal force of a contact [N]; 0 if it has none.
  double held(Key key) const {
    const auto at = seen_.find(key);
    return at != seen_.end() ? at->second.held : 0;
  }
  /// True if a contact rubs. While normal forces are held, a contact with one rubs even where it
  /// has opened; a contact without one that presses is noted, and rubs from the next renewal on.
  /// @param push normal force [N]
  bool rubs(Key key, bool touches, double push) {
    if (!holds_) return touches;
    if (held(key) > 0) return true;
    if (push > 0) seen_[key].push = push;
    return false;
  }
  /// Forgets the present normal forces, which `rubs` and `set_friction` note anew.
  void begin_linearise() {
    for (auto& [key, contact] : seen_) contact.push = 0;
  }
  /// The largest change of a normal force since they are held, and the largest of them [N].
  std::pair<double, double> unrest() const {
    double change = 0, most = 0;
    for (const auto& [key, contact] : seen_) {
      change = std::max(change, std::abs(contact.push - contact.held));
      most = std::max(most, contact.push);
    }
    return {change, most};
  }
  void end_linearise() { is_first_ = false; }
  /// Notes that a contact slides. @returns true if that is new
  bool note_sliding(Key key) { return !std::exchange(seen_[key].slides, true); }
  /// The normal force of friction, where the present one is `push` [N].
  double counted(Key key, double push) {
    Contact& seen = seen_[key];
    seen.push = push;
    return holds_ ? seen.held : push;
  }
  /// Sets the friction of a contact whose normal and slip have been found, and notes the slip.
  /// @param ahead its slip by the velocities before the stage [m]. @param push normal force [N].
  /// @param of_penalty stiffness of the penalty [N/m]
  void set_friction(Key key, const ContactLaw& law, double push, double of_penalty,
                    const SlipMeasure& measure, Vec3d ahead, RubbingContact& contact) {
    const auto [at, is_new] = seen_.try_emplace(key);
    Contact& seen = at->second;
    // The direction belongs to the last step, also where contact is found again after it.
    if (!(contact.slip == seen.slip)) {
      seen.way = next_way(seen.slip, seen.way, seen.width, contact.slip);
    }
    contact.way = along(contact.normal, seen.way);
    const double counts = counted(key, push);
    contact.set_limit(friction(key, law), counts, of_penalty, measure.share);
    if (is_new && norm(ahead) > contact.limit.width()) {
      note_sliding(key);
      contact.set_limit(law.kinetic_friction, counts, of_penalty, measure.share);
    }
    seen.slip = contact.slip;
    seen.width = contact.limit.width();
  }
  /// The gap of contacts that rub, as a share of the support [1]: what lies on something as a
  /// search for rest begins sticks to it, or a pull would lead anywhere before there are normal
  /// forces.
  double reach(const SlipMeasure& measure) const {
    if (holds_) return held_reach;
    return is_first_ && !measure.starts_moving() ? rounding_reach : 0;
  }
  /// The coefficient of friction of a contact.
  double friction(Key key, const ContactLaw& law) const {
    const auto at = seen_.find(key);
    return at != seen_.end() && at->second.slides ? law.kinetic_friction : law.static_friction;
  }

 private:
  struct Contact {
    Vec3d slip, way;
    double width = 0;  // ε [m]
    bool slides = false;
    double push = 0, held = 0;  // normal forces: the present one, and that of friction [N]
  };
  std::map<Key, Contact> seen_;
  bool is_first_ = true, holds_ = false;
};

/// True if points that slide have another friction than those that stick.
inline bool has_two_frictions(const ContactLaw& law) {
  return law.kinetic_friction < law.static_friction;
}

}  // namespace phyxel
