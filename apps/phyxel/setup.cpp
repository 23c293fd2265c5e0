#include "setup.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <limits>

#include "device_option.hpp"
#include "kind.hpp"
#include "phyxel/contacts.hpp"
#include "phyxel/custom_law.hpp"
#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/share.hpp"

namespace phyxel::app {
namespace {

/// The moduli of a material, e.g. "E = 1e+06 Pa, nu = 0.3, "; "" for laws without them.
std::string moduli_of(const Material& m) {
  std::string text;
  if (m.custom_law || has_parameter(m.law, "young")) text += fmt::format("E = {:g} Pa, ", m.young);
  if (m.custom_law || has_parameter(m.law, "poisson"))
    text += fmt::format("nu = {:g}, ", m.poisson);
  return text;
}

std::string terms_of(const Part& part) {
  const Material& m = part.material;
  std::string terms = m.custom_law ? m.custom_law->name() : m.law;
  for (const auto& [name, value] : m.parameters)
    terms += fmt::format(", {} = {}", name, value.text());
  if (m.volume_stiffness > 0)
    terms += fmt::format(", volume conservation ({:g} Pa)", m.volume_stiffness);
  if (m.hourglass.value_or(0) > 0) {
    terms += fmt::format(", hourglass control ({:g} E)", *m.hourglass);
  }
  if (part.closure > 0) terms += fmt::format(", closed gradients (to {:g})", part.closure);
  if (m.damping > 0) terms += fmt::format(", damping ({:g} 1/s)", m.damping);
  if (m.viscosity > 0) terms += fmt::format(", viscosity ({:g} s)", m.viscosity);
  return terms;
}

std::string neighbours_of(const Part& part) {
  return fmt::format("{:.1f} neighbours ({} to {})",
                     static_cast<double>(part.lists.pairs) / std::max(part.size, 1),
                     part.lists.fewest, part.lists.most);
}

}  // namespace

Precision precision_option(const std::string& name) {
  if (const auto precision = precision_named(name)) return *precision;
  throw InputError(fmt::format("--precision {}: unknown{}; allowed: float, double, mixed", name,
                               did_you_mean(name, {"float", "double", "mixed"})));
}

void add_overrides(CLI::App& command, Overrides& o) {
  command.add_option("scene", o.scene, "Scene file (TOML)")->required();
  command.add_option("--out", o.out, "Output folder, instead of the scene's");
  command.add_option("--device", o.device, device_help);
  command.add_option("--precision", o.precision, "Precision: float, double or mixed");
  command.add_option(
      "--method", o.method,
      "Method: verlet, implicit (needs --step or the scene's time.step) or equilibrium (finds the "
      "state at rest); the last two compute in double");
  command.add_option("--threads", o.threads, "Number of CPU threads (default: all)");
  command.add_option("--until", o.until, "Simulated time to stop at [s]");
  command.add_option("--step", o.step, "Time step [s], instead of the scene's");
  command.add_flag("--unsafe-step", o.unsafe_step, "Allow a time step above the stability limit");
}

Scene scene_with(const Overrides& o) {
  expect_kind(o.scene, {Kind::scene});
  Scene scene = read_scene(o.scene);
  if (!o.out.empty()) scene.output.directory = o.out;
  if (!o.device.empty()) scene.solver.device = o.device;
  if (!o.device.empty()) check_device_name(o.device, "--device");
  if (!o.method.empty()) {
    const auto method = method_named(o.method);
    if (!method) {
      throw InputError(fmt::format("--method {}: unknown{}; allowed: verlet, implicit, equilibrium",
                                   o.method,
                                   did_you_mean(o.method, {"verlet", "implicit", "equilibrium"})));
    }
    scene.solver.method = *method;
    if (*method != Method::verlet) scene.solver.precision = Precision::double_;
  }
  if (!o.precision.empty()) scene.solver.precision = precision_option(o.precision);
  if (scene.solver.method != Method::verlet && scene.solver.precision != Precision::double_) {
    throw InputError(
        fmt::format("--precision {}: the method \"{}\" computes in double: allowed: "
                    "double",
                    o.precision, method_name(scene.solver.method)));
  }
  if (scene.solver.method != Method::equilibrium && !o.until && !(scene.time.end > 0)) {
    throw InputError(fmt::format("{}: section [time] is missing; needed with method = \"{}\"",
                                 scene.file.string(), method_name(scene.solver.method)));
  }
  if (o.threads) {
    if (*o.threads < 1 || *o.threads > 4096) {
      throw InputError(fmt::format("--threads {}: out of range: allowed 1 to 4096", *o.threads));
    }
    scene.solver.threads = *o.threads;
  }
  if (o.until) {
    if (!(*o.until > 0) || !std::isfinite(*o.until)) {
      throw InputError(fmt::format("--until {}: out of range: allowed > 0 s", *o.until));
    }
    scene.time.end = *o.until;
  }
  if (o.step) {
    if (!(*o.step > 0) || !std::isfinite(*o.step)) {
      throw InputError(fmt::format("--step {}: out of range: allowed > 0 s", *o.step));
    }
    scene.time.step = *o.step;
  }
  return scene;
}

BoundarySize boundary_size(const Model& model) {
  const auto own = [&](const std::vector<Index>& phyxels) {
    return std::count_if(phyxels.begin(), phyxels.end(), [&](Index i) { return model.owns(i); });
  };
  BoundarySize size;
  for (const Motion& motion : model.motions) size.moved += own(motion.phyxels);
  for (const Load& load : model.loads) size.loaded += own(load.phyxels);
  size.touching = std::ssize(model.contact.phyxels);
  size.touching_bodies = std::ssize(model.body_contact.layer.phyxels);
  return size;
}

std::vector<SupportRange> support_ranges(const Model& model) {
  std::vector<SupportRange> ranges;
  for (const Part& part : model.parts) {
    double least = std::numeric_limits<double>::infinity(), largest = 0;
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      least = std::min(least, model.neighbourhood.support[i]);
      largest = std::max(largest, model.neighbourhood.support[i]);
    }
    if (model.share) {
      least = model.share->communicator->smallest(least);
      largest = model.share->communicator->largest(largest);
    }
    ranges.push_back({std::min(least, largest), largest});
  }
  return ranges;
}

namespace {

/// The stiffness of penalties, in words; empty if projected.
std::string describe_penalty(double penalty) {
  return penalty > 0 ? fmt::format(", penalties of stiffness {:g}", penalty) : "";
}

/// Lines about obstacles and about contact of bodies, and how many phyxels may touch them.
std::string describe_contact(const Model& model, std::int64_t touching,
                             std::int64_t touching_bodies) {
  std::string text;
  constexpr std::size_t most = 8;
  for (std::size_t k = 0; k < std::min(model.obstacles.size(), most); ++k) {
    const Obstacle& o = model.obstacles[k];
    text += fmt::format(
        "  obstacle    {}: {}{}{} at [{:.4g}, {:.4g}, {:.4g}] m; friction {:g}{}{}{}\n", o.name,
        o.hollow ? "hollow " : "", shape_name(o),
        o.free                    ? ", free"
        : o.motion.stands_still() ? ""
                                  : ", moving",
        o.place.x, o.place.y, o.place.z, o.law.static_friction,
        o.law.kinetic_friction < o.law.static_friction
            ? fmt::format(", {:g} when sliding", o.law.kinetic_friction)
            : "",
        o.law.restitution > 0 ? fmt::format(", restitution {:g}", o.law.restitution) : "",
        describe_penalty(o.penalty));
  }
  if (model.obstacles.size() > most) {
    text += fmt::format("              and {} more obstacles\n", model.obstacles.size() - most);
  }
  if (!model.obstacles.empty()) {
    text += fmt::format("              {} phyxels of surfaces may touch {}\n", touching,
                        model.obstacles.size() > 1 ? "them" : "it");
  }
  if (model.body_contact.acts()) {
    const BodyContact& contact = model.body_contact;
    std::string which = contact.all ? "all bodies"
                                    : fmt::format("{} pair{} of bodies", contact.pairs.size(),
                                                  contact.pairs.size() == 1 ? "" : "s");
    if (contact.self) which += ", and each body itself";
    text += fmt::format("  contact     {}; friction {:g}{}{}{}; {} phyxels of surfaces may touch\n",
                        which, contact.law.static_friction,
                        contact.law.restitution > 0
                            ? fmt::format(", restitution {:g}", contact.law.restitution)
                            : "",
                        describe_penalty(contact.penalty),
                        contact.penalty > 0  ? ""
                        : contact.sweeps > 1 ? fmt::format("; {} sweeps a step", contact.sweeps)
                                             : "",
                        touching_bodies);
  }
  return text;
}

}  // namespace

std::string describe_model(const Scene& scene, const Model& model, const BoundarySize& boundary,
                           const std::vector<SupportRange>& supports) {
  std::string text;
  const std::size_t shown = std::min<std::size_t>(model.parts.size(), 12);
  for (std::size_t p = 0; p < shown; ++p) {
    const Part& part = model.parts[p];
    const Material& m = part.material;
    text += fmt::format(
        "  body        {}: {} phyxels, {} surfels, {:.4g} kg, {:.4g} m^3 ({} volumes)\n", part.name,
        part.size, part.surfels, part.mass, part.volume,
        part.kernel_volumes ? "kernel" : "geometric");
    text += fmt::format("              {}; {}\n", neighbours_of(part), part.neighbourhood);
    if (1.02 * supports[p].least < supports[p].largest) {
      text += fmt::format(
          "              supports from {:.4g} to {:.4g} m{}\n", supports[p].least,
          supports[p].largest,
          scene.solver.method == Method::verlet ? "; the time step follows from the smallest" : "");
    }
    text += fmt::format("              {}rho = {:g} kg/m^3; {}\n", moduli_of(m), m.density,
                        terms_of(part));
  }
  if (shown < model.parts.size()) {
    text += fmt::format("              and {} more bodies\n", model.parts.size() - shown);
  }
  text += fmt::format(
      "  boundary    {} phyxels fixed or moved, {} loaded; gravity [{:g}, {:g}, {:g}] m/s^2\n",
      boundary.moved, boundary.loaded, scene.gravity.x, scene.gravity.y, scene.gravity.z);
  constexpr std::size_t most_loads = 8;
  for (std::size_t k = 0; k < std::min(model.loads.size(), most_loads); ++k) {
    const Load& load = model.loads[k];
    const bool total = load.density == Vec3d{};
    const Vec3d f = total ? load.total : load.density, x = load.centroid;
    text += fmt::format(
        "  load        {}, {}: [{:.4g}, {:.4g}, {:.4g}] {} about [{:.4g}, {:.4g}, {:.4g}] m{}\n",
        load.body, load.set, f.x, f.y, f.z, total ? "N" : "N/m^3", x.x, x.y, x.z,
        load.follows ? " at rest, following the surface" : "");
  }
  if (model.loads.size() > most_loads) {
    text += fmt::format("              and {} more loads\n", model.loads.size() - most_loads);
  }
  text += describe_contact(model, boundary.touching, boundary.touching_bodies);
  for (const std::string& warning : model.warnings)
    text += fmt::format("  warning     {}\n", warning);
  return text;
}

}  // namespace phyxel::app
