/// Slip of points that rub, in searches by Newton's method.
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "phyxel/physics/friction_penalty.hpp"

namespace phyxel {

/// Gap up to which a point counts as touching, as a share of its support.
inline constexpr double rounding_reach = 1e-6;

/// What slip is in a search: motions along surfaces since the start of the stage.
struct SlipMeasure {
  /// Displacements at the start of the stage [m], shape [n]; empty in scenes without friction.
  std::vector<Vec3d> from;
  /// Slip at which friction is whole, over the depth at which the penalty is the normal force.
  double share = 0;
  /// Displacements that the velocities before a stage of an implicit step lead to at its end [m],
  /// from which a search starts; empty if all points are at rest before it.
  std::vector<Vec3d> ahead;

  /// True if points are not at rest before the stage.
  bool starts_moving() const { return !ahead.empty(); }
};

/// A contact that rubs, as it was at the last `linearise`.
struct RubbingContact {
  Vec3d normal;         ///< Away from what the point touches.
  FrictionLimit limit;  ///< No force and no stiffness: it does not rub.
  Vec3d slip;           ///< [m]
  Mat3d stiffness{};    ///< [N/m]
  bool is_careful = false;

  bool acts() const { return limit.stiffness > 0; }
  /// True if the slip is so large that the kinetic friction acts from then on.
  bool has_slid() const { return limit.force > 0 && norm(slip) > limit.width(); }
  /// Sets the limit, and the stiffness at the present slip.
  /// @param push normal force [N]. @param of_penalty stiffness of the penalty [N/m]
  void set_limit(double friction, double push, double of_penalty, double share) {
    limit = {friction * push, 2 * friction * of_penalty / share};
    stiffness = friction_penalty(limit, normal, slip, is_careful).stiffness;
  }
};

/// What a search has seen of the contacts that rub. A point feels the kinetic friction until the
/// search ends if the search finds it sliding: in an implicit step as it first touches, with the
/// velocity before the stage, and where forces balance with the static one.
class RubbingRecord {
 public:
  /// A point, and what it touches.
  using Key = std::pair<Index, Index>;

  /// Begins a search.
  void forget() {
    seen_.clear();
    is_first_ = is_careful_ = true;
  }
  void end_linearise() { is_first_ = false; }
  /// As of `ContactPenalty`.
  void be_careful(bool careful) { is_careful_ = careful; }
  /// Notes that a contact slides. @returns true if that is new
  bool note_sliding(Key key) { return !std::exchange(seen_[key].slides, true); }
  /// Sets the friction of a contact whose normal and slip have been found, and notes the slip.
  /// @param ahead its slip by the velocities before the stage [m]. @param push normal force [N].
  /// @param of_penalty stiffness of the penalty [N/m]
  void set_friction(Key key, const ContactLaw& law, double push, double of_penalty,
                    const SlipMeasure& measure, Vec3d ahead, RubbingContact& contact) {
    const auto [at, is_new] = seen_.try_emplace(key);
    contact.is_careful = is_new || dot(at->second.slip, contact.slip) < 0 ||
                         (is_careful_ && !measure.starts_moving());
    at->second.slip = contact.slip;
    contact.set_limit(friction(key, law), push, of_penalty, measure.share);
    if (is_new && norm(ahead) > contact.limit.width()) {
      note_sliding(key);
      contact.set_limit(law.kinetic_friction, push, of_penalty, measure.share);
    }
  }
  /// The gap of contacts that rub, as a share of the support [1]: what lies on something as a
  /// search for rest begins sticks to it, or a pull would lead anywhere before there are normal
  /// forces.
  double reach(const SlipMeasure& measure) const {
    return is_first_ && !measure.starts_moving() ? rounding_reach : 0;
  }
  /// The coefficient of friction of a contact.
  double friction(Key key, const ContactLaw& law) const {
    const auto at = seen_.find(key);
    return at != seen_.end() && at->second.slides ? law.kinetic_friction : law.static_friction;
  }

 private:
  struct Contact {
    Vec3d slip;
    bool slides = false;
  };
  std::map<Key, Contact> seen_;
  bool is_first_ = true, is_careful_ = true;
};

/// True if points that slide have another friction than those that stick.
inline bool has_two_frictions(const ContactLaw& law) {
  return law.kinetic_friction < law.static_friction;
}

}  // namespace phyxel
