/// `StabilityWatch` stops runs that have become unstable.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/step_control.hpp"

namespace phyxel {
namespace {

/// Allowed ratio of a phyxel's speed to the driving speed, because free ends whip.
constexpr double whip = 10;

double largest_over_ranks(const Model& model, double value) {
  return model.share ? model.share->communicator->largest(value) : value;
}

/// Upper bound of the speeds that a motion prescribes [m/s]. Of a share: collective.
/// @param phyxels that it moves or touches
double largest_speed(const Model& model, const Motion& motion, std::span<const Index> phyxels) {
  double arm = 0;
  if (motion.rotation != Vec3d{}) {
    for (const Index i : phyxels) {
      arm = std::max(arm, norm(model.position[i] - motion.about));
    }
    arm = largest_over_ranks(model, arm);
  }
  double speed =
      norm(motion.velocity) + 2 * std::numbers::pi * motion.frequency * norm(motion.amplitude);
  if (motion.duration > 0) {
    // The largest slope of a smoothstep is 1.5, at its middle.
    speed += 1.5 * (norm(motion.displacement) + norm(motion.rotation) * arm) / motion.duration;
  }
  return speed;
}

/// Largest growth of an area on which a pressure that follows it is expected to act.
constexpr double most_growth = 25;  // five times as long and as wide

/// Largest acceleration of a single phyxel by a load [m/s²]. Of a share: collective.
double largest_acceleration(const Model& model, const Load& load) {
  double largest = 0;
  for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
    largest = std::max(largest, norm(load.force[k]) / model.mass[load.phyxels[k]]);
  }
  return (load.follows ? most_growth : 1) * load.curve.largest() *
         largest_over_ranks(model, largest);
}

}  // namespace

bool is_conservative(const Model& model) {
  for (const Part& part : model.parts) {
    if (part.material.damping > 0) return false;
  }
  for (const Load& load : model.loads) {
    if (!load.curve.is_constant() || load.follows) return false;
  }
  for (const Motion& motion : model.motions) {
    if (!motion.stands_still()) return false;
  }
  for (const Obstacle& obstacle : model.obstacles) {
    if (!obstacle.motion.stands_still()) return false;  // free bodies count among the energies
  }
  return true;
}

StabilityWatch::StabilityWatch(const Model& model, const Diagnostics& start,
                               const std::optional<Watched>& before)
    : model_(model),
      watched_(before.value_or(Watched{start.total_energy(), start.largest_speed})),
      conservative_(is_conservative(model)) {
  for (const Part& part : model.parts) {
    wave_speed_ = std::max(wave_speed_, pressure_wave_speed(part.material));
  }
  if (model.body_contact.acts()) {
    // Bodies that touch at the start may overlap by a hundredth of a support.
    constexpr double share = 1e-5;
    for (const Part& part : model.parts) contact_noise_ += share * part.mass;
    contact_noise_ *= wave_speed_ * wave_speed_;
  }
  acceleration_ = norm(model.gravity);
  for (const Load& load : model.loads) {
    acceleration_ += largest_acceleration(model, load);
  }
  if (std::isnan(watched_.start_speed)) watched_.start_speed = start.largest_speed;
  driving_speed_ = watched_.start_speed;
  for (const Motion& motion : model.motions) {
    driving_speed_ += largest_speed(model, motion, motion.phyxels);
  }
  for (const Obstacle& obstacle : model.obstacles) {
    driving_speed_ += largest_speed(model, obstacle.motion, model.contact.phyxels);
    if (obstacle.free) driving_speed_ += obstacle.largest_speed(obstacle.placed(obstacle.start));
  }
  check(start);
}

double StabilityWatch::speed_limit(double time) const {
  return std::max(3 * wave_speed_, whip * driving_speed_) + acceleration_ * time;
}

void StabilityWatch::check(const Diagnostics& now, const StepControl* control) {
  const std::string when = fmt::format("at t = {:g} s (step {})", now.time, now.step);
  const auto began = [&] {
    if (control) return control->where_it_began();
    if (!good_ || good_->fastest_phyxel < 0) return std::string("nothing moved before");
    return fmt::format("fastest at t = {:g} s, the last good state, was {}, at {:g} m/s",
                       good_->time, describe_phyxel(model_, good_->fastest_phyxel),
                       good_->largest_speed);
  };
  const char* advice = "; a smaller time.safety, damping, or a stiffer material may help";
  if (now.bad_phyxel >= 0) {
    throw DivergedError(fmt::format("the simulation diverged: the state is not finite {}; {}{}",
                                    when, began(), advice));
  }
  if (const double limit = speed_limit(now.time); now.largest_speed > limit) {
    throw DivergedError(fmt::format(
        "the simulation diverged: {}, moves at {:g} m/s {}, above the limit of {:g} m/s that wave "
        "speed, gravity, loads and motions set; {}{}",
        describe_phyxel(model_, now.fastest_phyxel), now.largest_speed, when, limit, began(),
        advice));
  }
  const double gained = now.total_energy() - watched_.start_energy;
  const double turnover =
      std::max({watched_.peak_energy, std::abs(now.gravity_energy + now.load_energy)});
  // The energy error of Verlet's method is bounded by a fraction of the energy in motion; a gain as
  // large as that energy is an instability.
  const double noise = 1e-6 * std::abs(watched_.start_energy) + contact_noise_;
  if (conservative_ && now.step > 0 && gained > turnover + noise) {
    throw DivergedError(fmt::format(
        "the simulation diverged: energy has run away, {:g} J gained {} where at most {:g} J were "
        "in motion; fastest is {}; {}{}",
        gained, when, turnover, describe_phyxel(model_, now.fastest_phyxel), began(), advice));
  }
  watched_.peak_energy = std::max(watched_.peak_energy, now.kinetic_and_elastic_energy());
  good_ = now;
}

}  // namespace phyxel
