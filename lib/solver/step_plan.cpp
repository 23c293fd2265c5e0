/// The choice of a scene's time step.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/solver.hpp"
#include "scene/scene_error.hpp"

namespace phyxel {
namespace {

/// Rounds a step [s] down to three digits: limits computed on different devices differ in their
/// last digits, but the step must not.
double three_digits_below(double step) {
  const double unit = std::pow(10, std::floor(std::log10(step)) - 2);
  return std::floor(step / unit) * unit;
}

/// Above these limits, rounding in double exceeds the forces of the material, and steps become too
/// short to reach the end.
constexpr double most_volume_stiffness = 1e8;  // multiple of Young's modulus
constexpr double most_hourglass = 1e4;         // fraction of Young's modulus

void refuse_absurd_stiffness(const Model& model) {
  for (const Part& part : model.parts) {
    const Material& m = part.material;
    const double modulus = hourglass_modulus(m);
    if (m.volume_stiffness > most_volume_stiffness * modulus) {
      throw InputError(
          fmt::format("body \"{}\": volume_stiffness = {:g} Pa with a modulus of {:g} Pa: allowed "
                      "is at most {:g} "
                      "times that; stiffer bodies need steps too short to reach the end",
                      part.name, m.volume_stiffness, modulus, most_volume_stiffness));
    }
    if (m.hourglass.value_or(0) > most_hourglass) {
      throw InputError(
          fmt::format("body \"{}\": hourglass = {:g}: allowed is at most {:g}; more of it needs "
                      "steps too short to reach the end",
                      part.name, *m.hourglass, most_hourglass));
    }
  }
}

/// Chooses a step of about `wanted` [s] such that frames and the end fall on steps.
void divide_time(const Scene& scene, double wanted, StepPlan& plan) {
  const double interval = scene.output.frames_per_second > 0
                              ? std::min(1 / scene.output.frames_per_second, scene.time.end)
                              : scene.time.end;
  // The 1e-9 keeps a step that divides the interval from being split for a rounding error.
  const auto whole = [&](double count) {
    if (!(count < 1e15)) {
      throw InputError(
          fmt::format("time.end = {:g} s in steps of {:g} s: {:.3g} steps; allowed: "
                      "below 1e15",
                      scene.time.end, wanted, scene.time.end / wanted));
    }
    return static_cast<std::int64_t>(std::ceil(count - 1e-9));
  };
  plan.steps_per_frame = std::max<std::int64_t>(1, whole(interval / wanted));
  plan.dt = interval / static_cast<double>(plan.steps_per_frame);
  plan.steps = whole(scene.time.end / plan.dt);
}

/// The longest step [s] that resolves a motion or load, and the name of it.
struct Resolution {
  double step = std::numeric_limits<double>::infinity();
  std::string what;  ///< "body.motion.frequency = 50 Hz of body "beam""
  std::string where;
};

/// Fewest steps per period, duration, turn, ramp or rise of a curve of a motion or load, and of
/// Verlet's in a relaxation time. Leapfrog and the second-order implicit method follow a sine of
/// twenty steps per period to within 1%; relaxation is of first order in its step: within 2.5%.
constexpr double steps_per_period = 20;

/// Returns the resolution of the fastest motion or load of a scene. A load without a ramp or a
/// curve acts at once, on purpose, and is ignored.
Resolution finest_resolution(const Scene& scene) {
  Resolution finest;
  for (const BodyRequest& body : scene.bodies) {
    const auto add = [&](double period, const Selection& select, const std::string& what) {
      if (!(period / steps_per_period < finest.step)) return;
      const std::string& where = select.where.empty() ? body.where : select.where;
      finest = {period / steps_per_period, fmt::format("{} of body \"{}\"", what, body.name),
                where.empty() ? "" : where + ": "};
    };
    const auto add_material = [&](const Material& material, const Selection& select) {
      const double time = scene.solver.method == Method::verlet ? shortest_time(material) : 0;
      if (time > 0) add(time, select, fmt::format("the relaxation time {:g} s", time));
    };
    add_material(body.material, {});
    for (const InclusionRequest& inclusion : body.inclusions) {
      add_material(inclusion.material, inclusion.select);
    }
    for (const MotionRequest& motion : body.motions) {
      if (motion.amplitude != Vec3d{} && motion.frequency > 0) {
        add(1 / motion.frequency, motion.select,
            fmt::format("body.motion.frequency = {:g} Hz", motion.frequency));
      }
      if (!(motion.duration > 0)) continue;
      if (motion.displacement != Vec3d{} || motion.rotation != Vec3d{}) {
        add(motion.duration, motion.select,
            fmt::format("body.motion.duration = {:g} s", motion.duration));
      }
      // The rotation is fastest in the middle, by 1.5 times the mean.
      const double turns = 1.5 * norm(motion.rotation) / 360;
      if (turns > 1) {
        add(motion.duration / turns, motion.select,
            fmt::format("body.motion.rotation, {:g} degrees in {:g} s,", norm(motion.rotation),
                        motion.duration));
      }
    }
    const auto add_load = [&](const auto& load, const char* section) {
      const double rise = LoadCurve::of(load.ramp, load.curve).shortest_rise();
      add(rise, load.select,
          load.curve.empty()
              ? fmt::format("{}.ramp = {:g} s", section, rise)
              : fmt::format("{}.curve, whose steepest piece would cross its range in {:g} s,",
                            section, rise));
    };
    for (const LoadRequest& load : body.loads) add_load(load, "body.load");
    for (const TractionRequest& traction : body.tractions) add_load(traction, "body.traction");
  }
  return finest;
}

/// Checks that a step given in the scene resolves its motions and loads. @throws InputError if not
void check_resolves(const Scene& scene, const Resolution& finest) {
  if (!scene.time.step || *scene.time.step <= finest.step * (1 + 1e-9)) return;
  throw InputError(fmt::format(
      "{}time.step = {:g} s does not resolve {}: allowed at most {:g} s there, {:g} steps to a "
      "period, turn, duration, ramp, rise of a curve or relaxation",
      finest.where, *scene.time.step, finest.what, finest.step, steps_per_period));
}

/// The strongest damping of all bodies [1/s].
double strongest_damping(const Model& model) {
  double damping = 0;
  for (const Part& part : model.parts) damping = std::max(damping, part.material.damping);
  return damping;
}

/// Longest step under damping, times c: distances have a relative error of (c dt)²/24, which is 1%
/// at 0.5.
constexpr double damped_share = 0.5;

/// Checks a step given in the scene against its damping. @throws InputError if it is too long
void check_damped(const Scene& scene, double damping) {
  if (!scene.time.step || !(*scene.time.step * damping > 1)) return;
  throw InputError(fmt::format(
      "time.step = {:g} s is too long for body.material.damping = {:g} 1/s: distances would be "
      "more "
      "than 4% off; allowed at most {:g} s (1 / damping), or \"adaptive\", or --unsafe-step to try "
      "it "
      "all the same",
      *scene.time.step, damping, 1 / damping));
}

/// By how much the viscosity of a model's materials shortens its largest step; "" if by nothing.
std::string viscosity_in_words(double viscosity, double omega) {
  if (!(viscosity > 0)) return "";
  return fmt::format("; body.material.viscosity = {:g} s shortens it to {:.3g} x 2 / omega_max",
                     viscosity, viscous_step_share(viscosity, omega));
}

StepPlan plan_verlet_steps(const Scene& scene, const Model& model, Backend& backend,
                           bool unsafe_step) {
  StepPlan plan;
  plan.limit = step_limit(model, backend);
  plan.shortens = !unsafe_step;
  plan.lengthens = plan.shortens && !scene.time.step;
  const double largest = plan.limit.largest_step;
  const std::string viscous = viscosity_in_words(largest_viscosity(model), plan.limit.omega_max);
  if (scene.time.step && *scene.time.step >= largest && !unsafe_step) {
    throw InputError(fmt::format(
        "time.step = {:g} s is unstable: the largest stable step is {:g} s (2 / omega_max, "
        "omega_max = {:g} rad/s{}); allowed below that, or \"adaptive\", or --unsafe-step to try "
        "it "
        "all the same",
        *scene.time.step, largest, plan.limit.omega_max, viscous));
  }
  const Resolution finest = finest_resolution(scene);
  const double damping = strongest_damping(model);
  check_resolves(scene, finest);
  if (!unsafe_step) check_damped(scene, damping);
  const double stable = scene.time.safety * largest;
  const double damped = damping > 0 ? damped_share / damping : stable;
  divide_time(scene,
              scene.time.step ? *scene.time.step
                              : three_digits_below(std::min({stable, damped, finest.step})),
              plan);
  const std::string limit_words = fmt::format(
      "largest stable {:.4g} s, from omega_max = {:.4g} rad/s found by {} Lanczos iterations{}",
      largest, plan.limit.omega_max, plan.limit.iterations, viscous);
  if (scene.time.step) {
    plan.why = fmt::format("{:.6g} s, as the scene asks ({})", plan.dt, limit_words);
  } else if (finest.step < std::min(stable, damped)) {
    plan.why = fmt::format("{:.6g} s, {:g} steps for {} ({})", plan.dt, steps_per_period,
                           finest.what, limit_words);
  } else if (damped < stable) {
    plan.why = fmt::format("{:.6g} s, {:g} / damping of {:g} 1/s ({})", plan.dt, damped_share,
                           damping, limit_words);
  } else {
    plan.why = fmt::format("{:.6g} s = {:.3g} x the {}", plan.dt, plan.dt / largest, limit_words);
  }
  return plan;
}

}  // namespace

void StepPlan::halve(int times) {
  for (; times > 0; --times, ++halvings) {
    dt /= 2;
    steps *= 2;
    steps_per_frame *= 2;
  }
  for (; times < 0 && halvings > 0; ++times, --halvings) {
    dt *= 2;
    steps /= 2;
    steps_per_frame /= 2;
  }
}

namespace {

StepPlan plan_of(const Scene& scene, const Model& model, Backend& backend, bool unsafe_step) {
  refuse_absurd_stiffness(model);
  if (scene.solver.method == Method::verlet) {
    return plan_verlet_steps(scene, model, backend, unsafe_step);
  }
  StepPlan plan;
  if (scene.solver.method == Method::equilibrium) {
    plan.dt = 1;
    plan.steps = plan.steps_per_frame = 1;
    plan.why = "none: Newton's method finds where the scene comes to rest";
    return plan;
  }
  if (!scene.time.step) {
    throw InputError(
        "time.step = \"adaptive\": implicit steps are stable at any size: needed is one [s], short "
        "against the motions to be seen");
  }
  check_resolves(scene, finest_resolution(scene));
  divide_time(scene, *scene.time.step, plan);
  plan.why = fmt::format("{:.6g} s, implicit", plan.dt);
  return plan;
}

}  // namespace

StepPlan plan_steps(const Scene& scene, const Model& model, Backend& backend, bool unsafe_step) {
  return naming(scene, [&] { return plan_of(scene, model, backend, unsafe_step); });
}

}  // namespace phyxel
