/// Every value of a scene by its key: the one list behind checks of scenes made in code and behind
/// what checkpoints compare.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <type_traits>

#include "phyxel/custom_law.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/scene.hpp"

namespace phyxel {

/// Which body of a scene a value belongs to, and which entry of one of its lists.
struct ParameterOwner {
  const BodyRequest* body = nullptr;   ///< Null: the scene itself, or one of its obstacles.
  std::size_t number = 0;              ///< Of the body, counted from 1.
  const char* list = "";               ///< "motion", "load", ...; "": the body itself.
  std::size_t entry = 0;               ///< In that list, counted from 1.
  const std::string* where = nullptr;  ///< The place in the scene file, for messages.
};

/// The word of a choice: its index in the key's list of words.
struct Word {
  std::size_t index;
};
template <class Enum>
Word word(Enum value) {
  return {static_cast<std::size_t>(value)};
}

/// Why a resumed run may have another value for a key, or null if it may not.
const char* free_on_resume(std::string_view section, std::string_view key);

/// "x", "xz", "xyz": axes as scenes write them.
std::string axes_in_words(const Axes& axes);

namespace detail {

/// `visit(section, key, value)` for the keys of a selection that are set.
template <class Visit>
void visit_selection(const Selection& select, Visit&& visit) {
  if (select.region) visit("selection", "region", *select.region);
  if (select.indices) visit("selection", "indices", *select.indices);
  if (select.box) {
    visit("selection", "box", select.box->low);
    visit("selection", "box", select.box->high);
  }
  if (select.ball) {
    visit("selection.ball", "centre", select.ball->centre);
    visit("selection.ball", "radius", select.ball->radius);
  }
  if (!select.mesh.empty()) visit("selection", "mesh", select.mesh.string());
  if (select.all) visit("selection", "all", true);
}

template <class Visit>
void visit_source(const BodySource& source, Visit&& visit) {
  const ShapeRequest& shape = source.shape;
  const auto if_set = [&](const char* key, const auto& value) {
    if (value != std::decay_t<decltype(value)>{}) visit("body", key, value);
  };
  if_set("shape", shape.name);
  if_set("mesh", source.mesh.string());
  if_set("file", source.file.string());
  if_set("cloud", source.cloud);
  if_set("phyxels", source.phyxels);
  if_set("spacing", shape.spacing);
  if_set("size", shape.size);
  if_set("radius", shape.radius);
  if_set("length", shape.length);
  visit("body", "lattice", word(shape.placement));
  visit("body", "jitter", shape.jitter);
  visit("body", "seed", source.seed);
  visit("body", "relaxations", source.relaxations);
  if (source.on_surface) visit("body", "on_surface", *source.on_surface);
  if (source.grading) {
    const Grading& grading = *source.grading;
    visit("body.grading", "ratio", grading.ratio);
    visit("body.grading", "growth", grading.growth);
    if (grading.per_radius) visit("body.grading", "per_radius", *grading.per_radius);
    if (grading.across) visit("body.grading", "across", *grading.across);
  }
  visit("body", "surfels", shape.surface);
}

template <class Visit>
void visit_material(const char* section, const BodyRequest& body, const Material& m,
                    Visit&& visit) {
  const std::string law = law_of(body, m);
  if (m.custom_law || has_parameter(law, "young")) visit(section, "young", m.young);
  if (m.custom_law || has_parameter(law, "poisson")) visit(section, "poisson", m.poisson);
  visit(section, "density", m.density);
  visit(section, "law", law);
  for (const auto& [name, value] : m.parameters) {
    if (value.is_curve()) {
      visit(section, name.c_str(), value.curve());
    } else if (value.is_vector()) {
      visit(section, name.c_str(), value.vector());
    } else {
      visit(section, name.c_str(), value.number());
    }
  }
  visit(section, "volume_stiffness", m.volume_stiffness);
  visit(section, "damping", m.damping);
  visit(section, "viscosity", m.viscosity);
}

/// Visits the keys of a path, in the section of what moves along it.
template <class Visit>
void visit_path(const char* section, const MotionRequest& motion, Visit&& visit) {
  visit(section, "displacement", motion.displacement);
  visit(section, "rotation", motion.rotation);
  visit(section, "about", motion.about);
  if (motion.duration != 0) visit(section, "duration", motion.duration);
  visit(section, "velocity", motion.velocity);
  visit(section, "amplitude", motion.amplitude);
  if (motion.frequency != 0) visit(section, "frequency", motion.frequency);
}

template <class Visit>
void visit_motion(const MotionRequest& motion, Visit&& visit) {
  visit_path("body.motion", motion, visit);
  visit("body.motion", "axes", axes_in_words(motion.axes));
}

template <class Visit>
void visit_obstacle(const ObstacleRequest& obstacle, Visit&& visit) {
  visit("obstacle", "name", obstacle.name);
  visit("obstacle", "shape", obstacle.shape);
  if (obstacle.size != Vec3d{}) visit("obstacle", "size", obstacle.size);
  if (obstacle.radius != 0) visit("obstacle", "radius", obstacle.radius);
  if (obstacle.length != 0) visit("obstacle", "length", obstacle.length);
  if (!obstacle.mesh.empty()) visit("obstacle", "mesh", obstacle.mesh.string());
  visit("obstacle", "scale", obstacle.scale);
  if (obstacle.normal) visit("obstacle", "normal", *obstacle.normal);
  visit("obstacle", "hollow", obstacle.hollow);
  visit("obstacle", "rotation", obstacle.rotation);
  visit("obstacle", "translation", obstacle.translation);
  visit("obstacle", "friction", obstacle.friction);
  if (obstacle.kinetic_friction) {
    visit("obstacle", "kinetic_friction", *obstacle.kinetic_friction);
  }
  visit("obstacle", "restitution", obstacle.restitution);
  if (obstacle.method) {
    visit("obstacle", "method",
          std::string(*obstacle.method == ContactMethod::penalty ? "penalty" : "projected"));
  }
  if (obstacle.stiffness) visit("obstacle", "stiffness", *obstacle.stiffness);
  visit_path("obstacle.motion", obstacle.motion, visit);
  if (obstacle.density) {
    visit("obstacle", "density", *obstacle.density);
    visit("obstacle", "velocity", obstacle.velocity);
    visit("obstacle", "spin", obstacle.spin);
  }
}

template <class Visit>
void visit_body(const BodyRequest& body, Visit&& visit) {
  visit("body", "name", body.name);
  visit_source(body.source, visit);
  visit("body", "scale", body.scale);
  visit("body", "rotation", body.rotation);
  visit("body", "translation", body.translation);
  visit("body", "velocity", body.velocity);
  visit("body", "spin", body.spin);
  visit("body", "volumes", word(body.volume_rule));
  if (body.closure) {
    visit("body", "closure", *body.closure);
  } else {
    visit("body", "closure", std::string("auto"));
  }
  visit_material("body.material", body, body.material, visit);
  visit("body.material", "hourglass", body.material.hourglass.value_or(default_hourglass(body)));
  const NeighbourhoodRule& rule = body.neighbourhood;
  // An automatic rule is recorded as "uniform", which it was before there were graded clouds, so
  // that earlier runs can be resumed; the digest of the model tells supports apart.
  using Support = NeighbourhoodRule::Support;
  const bool automatic = rule.support == Support::automatic;
  visit("body.neighbours", "support", word(automatic ? Support::uniform : rule.support));
  visit("body.neighbours", "nearest", rule.nearest);
  visit("body.neighbours", "factor", rule.factor);
  if (rule.radius) visit("body.neighbours", "radius", *rule.radius);
  if (rule.max_neighbours) visit("body.neighbours", "max_neighbours", *rule.max_neighbours);
}

/// Visits how a body breaks, but for its regions.
template <class Visit>
void visit_fracture(const FractureRequest& fracture, Visit&& visit) {
  visit("body.fracture", "energy_release_rate", fracture.energy_release_rate);
  if (fracture.strength) visit("body.fracture", "strength", *fracture.strength);
  if (!fracture.scatter) return;
  visit("body.fracture", "scatter", *fracture.scatter);
  visit("body.fracture", "seed", fracture.seed);
}

/// `visit(entry, notch, values)` for each notch of a body, as `visit_lists`.
template <class Visit>
void visit_notches(const BodyRequest& body, Visit&& visit) {
  for (std::size_t k = 0; k < body.notches.size(); ++k) {
    const NotchRequest& notch = body.notches[k];
    visit(k + 1, notch, [&](auto&& inner) {
      if (!notch.mesh.empty()) return inner("body.notch", "mesh", notch.mesh.string());
      inner("body.notch", "centre", notch.centre);
      inner("body.notch", "normal", notch.normal);
      inner("body.notch", "radius", notch.radius);
    });
  }
}

/// `visit(entry, list, select, values)` for each entry of a body's lists, where `values(visit)`
/// visits what the entry has beside its selection.
template <class Visit>
void visit_lists(const BodyRequest& body, Visit&& visit) {
  const auto each = [&](const auto& list, const char* name, auto&& values) {
    for (std::size_t k = 0; k < list.size(); ++k) {
      visit(k + 1, name, list[k].select, [&](auto&& inner) { values(list[k], inner); });
    }
  };
  each(body.inclusions, "inclusion", [&](const InclusionRequest& inclusion, auto&& inner) {
    visit_material("body.inclusion", body, inclusion.material, inner);
  });
  each(body.finer, "grading.finer", [](const FinerRequest& finer, auto&& inner) {
    inner("body.grading.finer", "by", finer.by);
  });
  each(body.fixed, "fixed", [](const FixRequest& fix, auto&& inner) {
    inner("body.fixed", "axes", axes_in_words(fix.axes));
  });
  for (std::size_t k = 0; body.fracture && k < body.fracture->unbreakable.size(); ++k) {
    visit(k + 1, "fracture.unbreakable", body.fracture->unbreakable[k], [](auto&&) {});
  }
  each(body.motions, "motion",
       [](const MotionRequest& motion, auto&& inner) { visit_motion(motion, inner); });
  each(body.loads, "load", [](const LoadRequest& load, auto&& inner) {
    inner("body.load", "force", load.force);
    inner("body.load", "force_density", load.force_density);
    inner("body.load", "ramp", load.ramp);
    if (!load.curve.empty()) inner("body.load", "curve", load.curve);
  });
  each(body.tractions, "traction", [](const TractionRequest& traction, auto&& inner) {
    inner("body.traction", "traction", traction.traction);
    inner("body.traction", "pressure", traction.pressure);
    inner("body.traction", "follower", traction.follower);
    if (traction.gas) inner("body.traction", "gas", *traction.gas);
    inner("body.traction", "normal", traction.normal);
    inner("body.traction", "angle", traction.angle);
    inner("body.traction", "ramp", traction.ramp);
    if (!traction.curve.empty()) inner("body.traction", "curve", traction.curve);
  });
}

/// `visit(entry, plane, values)` for each plane of symmetry of a body, as `visit_lists`.
template <class Visit>
void visit_symmetries(const BodyRequest& body, Visit&& visit) {
  for (std::size_t k = 0; k < body.symmetries.size(); ++k) {
    const SymmetryRequest& plane = body.symmetries[k];
    visit(k + 1, plane, [&](auto&& inner) {
      inner("body.symmetry", "normal", word(plane.normal));
      inner("body.symmetry", "at", plane.at);
    });
  }
}

/// `visit(entry, probe, values)` for each probe of a body, as `visit_lists`.
template <class Visit>
void visit_probes(const BodyRequest& body, Visit&& visit) {
  for (std::size_t k = 0; k < body.probes.size(); ++k) {
    const ProbeRequest& probe = body.probes[k];
    visit(k + 1, probe, [&](auto&& inner) {
      inner("probe", "name", probe.name);
      for (const Vec3d& point : probe.points) inner("probe", "point", point);
      if (probe.select) visit_selection(*probe.select, inner);
    });
  }
}

template <class Visit>
void visit_run(const Scene& scene, Visit&& visit) {
  visit("", "gravity", scene.gravity);
  if (scene.time.end != 0) visit("time", "end", scene.time.end);
  if (scene.time.step) visit("time", "step", *scene.time.step);
  visit("time", "safety", scene.time.safety);
  visit("solver", "method", word(scene.solver.method));
  visit("solver", "precision", word(scene.solver.precision));
  visit("solver", "threads", scene.solver.threads);
  visit("output", "frames_per_second", scene.output.frames_per_second);
  visit("output", "phyxels", scene.output.phyxels);
  visit("output", "surface", scene.output.surface);
  visit("output", "fields", scene.output.fields);
  if (!scene.output.recovery) visit("output", "recovery", false);
  visit("output", "checkpoint_every", scene.output.checkpoint_every);
}

template <class Visit>
void visit_contact(const ContactRequest& contact, Visit&& visit) {
  visit("contact", "friction", contact.friction);
  if (contact.kinetic_friction) visit("contact", "kinetic_friction", *contact.kinetic_friction);
  visit("contact", "restitution", contact.restitution);
  visit("contact", "self", contact.self);
  visit("contact", "sweeps", contact.sweeps);
  // Checkpoints of before have no such keys.
  if (contact.method == ContactMethod::penalty) {
    visit("contact", "method", std::string("penalty"));
  }
  if (contact.stiffness != default_contact_stiffness) {
    visit("contact", "stiffness", contact.stiffness);
  }
  if (contact.all) visit("contact", "all", *contact.all);
}

template <class Visit>
void visit_pair(const ContactPairRequest& pair, Visit&& visit) {
  visit("contact.pair", "first", pair.first);
  visit("contact.pair", "second", pair.second);
  if (pair.friction) visit("contact.pair", "friction", *pair.friction);
  if (pair.kinetic_friction) visit("contact.pair", "kinetic_friction", *pair.kinetic_friction);
  if (pair.restitution) visit("contact.pair", "restitution", *pair.restitution);
}

}  // namespace detail

/// Calls `visit(owner, section, key, value)` for every value of a scene that is set. Values are
/// numbers, `Vec3d`, text, lists, curves or a `Word`.
template <class Visit>
void for_each_parameter(const Scene& scene, Visit&& visit) {
  const auto of = [&](ParameterOwner owner) {
    return [&visit, owner](const char* section, const char* key, const auto& value) {
      visit(owner, section, key, value);
    };
  };
  detail::visit_run(scene, of({}));
  for (std::size_t k = 0; k < scene.obstacles.size(); ++k) {
    const ObstacleRequest& obstacle = scene.obstacles[k];
    detail::visit_obstacle(obstacle, of({nullptr, 0, "obstacle", k + 1, &obstacle.where}));
  }
  if (scene.contact) {
    const ContactRequest& contact = *scene.contact;
    detail::visit_contact(contact, of({nullptr, 0, "", 0, &contact.where}));
    for (std::size_t k = 0; k < contact.pairs.size(); ++k) {
      const ContactPairRequest& pair = contact.pairs[k];
      detail::visit_pair(pair, of({nullptr, 0, "pair", k + 1, &pair.where}));
    }
  }
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const BodyRequest& body = scene.bodies[b];
    detail::visit_body(body, of({&body, b + 1, "", 0, &body.where}));
    if (body.fracture) {
      detail::visit_fracture(*body.fracture,
                             of({&body, b + 1, "fracture", 1, &body.fracture->where}));
    }
    detail::visit_notches(body, [&](std::size_t entry, const NotchRequest& notch, auto&& values) {
      values(of({&body, b + 1, "notch", entry, &notch.where}));
    });
    detail::visit_lists(
        body, [&](std::size_t entry, const char* list, const Selection& select, auto&& values) {
          const auto inner = of({&body, b + 1, list, entry, &select.where});
          detail::visit_selection(select, inner);
          values(inner);
        });
    detail::visit_symmetries(body,
                             [&](std::size_t entry, const SymmetryRequest& plane, auto&& values) {
                               values(of({&body, b + 1, "symmetry", entry, &plane.where}));
                             });
    detail::visit_probes(body, [&](std::size_t entry, const ProbeRequest& probe, auto&& values) {
      values(of({&body, b + 1, "probe", entry, &probe.where}));
    });
  }
}

}  // namespace phyxel
