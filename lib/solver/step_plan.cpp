/// Which steps a scene is taken in.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"

namespace phyxel {
namespace {

/// Limits found on different devices differ in their last digits, the steps taken shall not.
double three_digits_below(double step) {
  const double unit = std::pow(10, std::floor(std::log10(step)) - 2);
  return std::floor(step / unit) * unit;
}

/// Beyond these, double precision has lost the material itself, and a run would take for ever.
constexpr double most_volume_stiffness = 1e8;  // times Young's modulus
constexpr double most_hourglass = 1e4;         // of Young's modulus

void refuse_absurd_stiffness(const Model& model) {
  for (const Part& part : model.parts) {
    const Material& m = part.material;
    if (m.volume_stiffness > most_volume_stiffness * m.young) {
      throw InputError(fmt::format(
          "body \"{}\": volume_stiffness = {:g} Pa with young = {:g} Pa: allowed is at most {:g} "
          "times young; stiffer bodies need steps too short to reach the end",
          part.name, m.volume_stiffness, m.young, most_volume_stiffness));
    }
    if (m.hourglass > most_hourglass) {
      throw InputError(
          fmt::format("body \"{}\": hourglass = {:g}: allowed is at most {:g}; more of it needs "
                      "steps too short to reach the end",
                      part.name, m.hourglass, most_hourglass));
    }
  }
}

/// Steps of about `wanted` [s] that frames and the end fall on.
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

StepPlan plan_verlet_steps(const Scene& scene, const Model& model, Backend& backend,
                           bool unsafe_step) {
  StepPlan plan;
  plan.limit = step_limit(model, backend);
  plan.shortens = !unsafe_step;
  const double largest = plan.limit.largest_step;
  if (scene.time.step && *scene.time.step >= largest && !unsafe_step) {
    throw InputError(fmt::format(
        "time.step = {:g} s is unstable: the largest stable step is {:g} s (2 / omega_max, "
        "omega_max = {:g} rad/s); allowed below that, or \"auto\", or --unsafe-step to try it "
        "all the same",
        *scene.time.step, largest, plan.limit.omega_max));
  }
  divide_time(scene,
              scene.time.step ? *scene.time.step : three_digits_below(scene.time.safety * largest),
              plan);
  const std::string limit_words = fmt::format(
      "largest stable {:.4g} s, from omega_max = {:.4g} rad/s found by {} Lanczos iterations",
      largest, plan.limit.omega_max, plan.limit.iterations);
  plan.why = scene.time.step ? fmt::format("{:.6g} s, as the scene asks ({})", plan.dt, limit_words)
                             : fmt::format("{:.6g} s = {:.3g} x the {}", plan.dt, plan.dt / largest,
                                           limit_words);
  return plan;
}

}  // namespace

void StepPlan::halve(int times) {
  for (; times > 0; --times, ++halvings) {
    dt /= 2;
    steps *= 2;
    steps_per_frame *= 2;
  }
}

StepPlan plan_steps(const Scene& scene, const Model& model, Backend& backend, bool unsafe_step) {
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
        "time.step = \"auto\": implicit steps are stable at any size: needed is one [s], short "
        "against the motions to be seen");
  }
  divide_time(scene, *scene.time.step, plan);
  plan.why = fmt::format("{:.6g} s, implicit", plan.dt);
  return plan;
}

}  // namespace phyxel
