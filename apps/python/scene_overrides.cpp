#include "scene_overrides.hpp"

#include <fmt/format.h>

#include <cmath>

#include "phyxel/device.hpp"
#include "phyxel/error.hpp"

namespace phyxel::python {

void check_positive(const char* name, double value) {
  if (value > 0 && std::isfinite(value)) return;
  throw InputError(fmt::format("{}: {} found; allowed: > 0 s", name, value));
}

Scene with_overrides(Scene scene, const SceneOverrides& o) {
  if (o.device) {
    check_device_name(*o.device, "device");
    scene.solver.device = *o.device;
  }
  if (o.method) {
    const auto method = method_named(*o.method);
    if (!method) {
      throw InputError(
          fmt::format("method: \"{}\" found; allowed: verlet, implicit, equilibrium", *o.method));
    }
    scene.solver.method = *method;
    if (*method != Method::verlet) scene.solver.precision = Precision::double_;
  }
  if (o.precision) {
    const auto precision = precision_named(*o.precision);
    if (!precision) {
      throw InputError(
          fmt::format("precision: \"{}\" found; allowed: float, double, mixed", *o.precision));
    }
    scene.solver.precision = *precision;
  }
  if (scene.solver.method != Method::verlet && scene.solver.precision != Precision::double_) {
    throw InputError(fmt::format("precision: \"{}\" found; allowed with method = \"{}\": double",
                                 precision_name(scene.solver.precision),
                                 method_name(scene.solver.method)));
  }
  if (o.threads) {
    if (*o.threads < 1 || *o.threads > 4096) {
      throw InputError(fmt::format("threads: {} found; allowed: 1 to 4096", *o.threads));
    }
    scene.solver.threads = *o.threads;
  }
  if (o.step) {
    check_positive("step", *o.step);
    scene.time.step = *o.step;
  }
  if (o.end) {
    check_positive("end", *o.end);
    scene.time.end = *o.end;
  }
  if (scene.solver.method != Method::equilibrium && !(scene.time.end > 0)) {
    throw InputError(
        fmt::format("end: missing, and so is the scene's [time]; needed with method = "
                    "\"{}\"",
                    method_name(scene.solver.method)));
  }
  return scene;
}

}  // namespace phyxel::python
