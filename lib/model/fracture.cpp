#include "model/fracture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "model/notch.hpp"
#include "model/parts.hpp"
#include "model/selection.hpp"
#include "phyxel/custom_law.hpp"
#include "phyxel/error.hpp"
#include "phyxel/history.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/physics/fracture.hpp"
#include "scene/scene_error.hpp"

namespace phyxel {
namespace {

// C by `scripts/calibrate_fracture.py`.
constexpr std::array supports{1.8, 1.95, 2.1, 2.2};  // h/s
constexpr std::array poissons{0.0, 0.1, 0.2, 0.25, 0.3, 0.35};
constexpr double constants[poissons.size()][supports.size()] = {
    {0.9209, 0.9579, 1.0207, 1.0774}, {0.8993, 0.9354, 0.9979, 1.0548},
    {0.8636, 0.8979, 0.9600, 1.0180}, {0.8374, 0.8699, 0.9315, 0.9904},
    {0.8025, 0.8323, 0.8927, 0.9526}, {0.7551, 0.7801, 0.8378, 0.8984}};

// Strengths of hourglass control for which C is known: it changes by 3% in this range.
constexpr double least_hourglass = 0.05, most_hourglass = 0.2;

/// The mean distance from a phyxel of a cubic lattice to the ten nearest, over the distance between
/// neighbours.
constexpr double distance_to_ten = (6 + 4 * std::numbers::sqrt2) / 10;

/// A place between two entries of an ascending table: the entry before it, and the share of the way
/// to the next.
struct TablePlace {
  std::size_t entry;
  double share;
};

template <std::size_t n>
TablePlace place_in(const std::array<double, n>& table, double value) {
  const auto after = std::upper_bound(table.begin() + 1, table.end() - 1, value);
  const auto entry = static_cast<std::size_t>(after - table.begin()) - 1;
  return {entry, (value - table[entry]) / (table[entry + 1] - table[entry])};
}

/// The distances between the phyxels of a body, in its lattice, or in a lattice as dense.
struct Spacings {
  double relative_support = 0;                                            ///< h/s
  double of(double support) const { return support / relative_support; }  ///< s [m]
};

/// @param part any part of the body
Spacings spacings_of(const Model& model, const Part& part, const NeighbourhoodRule& rule) {
  if (!rule.radius) return {rule.factor * distance_to_ten};
  double volume = 0, size = 0;
  for (const Part& other : model.parts_of_body(part)) {
    volume += other.volume;
    size += other.size;
  }
  return {*rule.radius / std::cbrt(volume / size)};
}

/// A number between 0 and 1, both excluded, that depends on a phyxel and a seed alone (the mixing
/// function of splitmix64, Steele, Lea and Flood 2014).
double random_number(Index id, std::uint64_t seed) {
  std::uint64_t z = seed * 0x9e3779b97f4a7c15u + static_cast<std::uint64_t>(id) + 1;
  for (int round = 0; round < 2; ++round) {
    z += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    z ^= z >> 31;
  }
  return (static_cast<double>(z >> 11) + 0.5) * 0x1p-53;
}

/// The factor of a phyxel's critical stretch. The smaller one of two phyxels decides on a pair, so
/// that the factors of pairs have Weibull's distribution exp(-f^m): that of the smaller of two is
/// exp(-2 (f / 2^(1/m))^m).
double scatter_of(Index id, double modulus, std::uint64_t seed) {
  return std::pow(-2 * std::log(random_number(id, seed)), 1 / modulus);
}

[[noreturn]] void refuse(const std::string& where, const BodyRequest& request,
                         const std::string& problem) {
  throw InputError(
      fmt::format("{}{}body \"{}\": {}", where, where.empty() ? "" : ": ", request.name, problem));
}

/// The critical stretch of the phyxels of a part, with the strength that a scene asks for.
double stretch_of(const BodyRequest& request, const Part& part, double spacing,
                  double relative_support, std::vector<std::string>& warnings) {
  const FractureRequest& fracture = *request.fracture;
  const Material& m = part.material;
  double stretch = 0;
  try {
    stretch = critical_stretch(fracture.energy_release_rate, m.young, m.poisson, spacing,
                               relative_support);
  } catch (const InputError& error) {
    refuse(fracture.where, request, error.what());
  }
  if (!fracture.strength) return stretch;
  const double modulus = m.young / (1 - m.poisson * m.poisson);
  const double bears = modulus * stretch, ratio = bears / *fracture.strength;
  // s_c² s is the same at all spacings.
  const double fitting = spacing * ratio * ratio;
  constexpr double tolerance = 0.02;
  if (ratio > 1 + tolerance) {
    refuse(fracture.where, request,
           fmt::format("key body.fracture.strength: {:g} Pa found, which phyxels {:.3g} m apart "
                       "cannot resolve: they bear {:.3g} Pa with an energy release rate of {:g} "
                       "J/m^2; allowed: at least that, or phyxels {:.3g} m apart",
                       *fracture.strength, spacing, bears, fracture.energy_release_rate, fitting));
  }
  if (ratio < 1 - tolerance) {
    warnings.push_back(
        fmt::format("body \"{}\": a strength of {:g} Pa of phyxels {:.3g} m apart lets cracks take "
                    "{:.3g} times "
                    "the energy release rate of {:g} J/m^2; phyxels {:.3g} m apart have both",
                    request.name, *fracture.strength, spacing, 1 / (ratio * ratio),
                    fracture.energy_release_rate, fitting));
  }
  return std::max(stretch, *fracture.strength / modulus);
}

}  // namespace

double fracture_constant(double poisson, double relative_support) {
  const auto check = [](const char* name, double value, double low, double high) {
    if (value >= low && value <= high) return;
    throw InputError(fmt::format(
        "{} = {:g} found, for which no critical stretch is known; allowed with fracture: {:g} to "
        "{:g}",
        name, value, low, high));
  };
  check("poisson", poisson, poissons.front(), poissons.back());
  check("support over distance between phyxels", relative_support, supports.front(),
        supports.back());
  const TablePlace row = place_in(poissons, poisson), column = place_in(supports, relative_support);
  const auto in_row = [&](std::size_t r) {
    return std::lerp(constants[r][column.entry], constants[r][column.entry + 1], column.share);
  };
  return std::lerp(in_row(row.entry), in_row(row.entry + 1), row.share);
}

double critical_stretch(double energy_release_rate, double young, double poisson, double spacing,
                        double relative_support) {
  const double modulus = young / (1 - poisson * poisson);
  return fracture_constant(poisson, relative_support) *
         std::sqrt(energy_release_rate / (modulus * spacing));
}

void check_fracture(const BodyRequest& request) {
  if (!request.fracture && request.notches.empty()) return;
  const std::string key = request.fracture ? "body.fracture" : "body.notch";
  const std::string& where =
      request.fracture ? request.fracture->where : request.notches.front().where;
  const auto refuse_key = [&](const char* other, const std::string& value, const char* allowed) {
    refuse(where, request,
           fmt::format("{} found together with {} = {}; allowed: {}", key, other, value, allowed));
  };
  if (request.neighbourhood.one_sided()) {
    refuse_key("body.neighbours", "one-sided lists",
               "neighbours.support = \"uniform\" or \"pairwise\" without max_neighbours");
  }
  const auto check_material = [&](const char* section, const Material& material) {
    const std::string law = law_of(request, material);
    const auto refuse_material = [&](const char* name, const std::string& value,
                                     const char* allowed) {
      refuse_key(fmt::format("{}.{}", section, name).c_str(), value, allowed);
    };
    Material complete = material;
    complete.law = law;
    if (material.custom_law) refuse_material("law", "a caller's law", "a law of the library");
    if (!history_names(complete).empty()) {
      if (material.viscosity > 0) {
        refuse_material("viscosity", fmt::format("{:g}", material.viscosity),
                        "0, as the rate of a gradient that jumps where a pair breaks has no sense");
      }
      refuse_material("law", fmt::format("\"{}\"", law),
                      "an elastic law, as the stretch of what has yielded is no measure of stress");
    }
    if (!request.fracture) return;
    if (!has_parameter(law, "young") || !has_parameter(law, "poisson")) {
      refuse_material("law", fmt::format("\"{}\"", law), "a law with young and poisson");
    }
    if (material.volume_stiffness > 0) {
      refuse_material("volume_stiffness", fmt::format("{:g}", material.volume_stiffness),
                      "0, as critical stretches follow from young and poisson");
    }
  };
  const NeighbourhoodRule& rule = request.neighbourhood;
  const double lowest = supports.front() / distance_to_ten,
               most = supports.back() / distance_to_ten;
  if (request.fracture && !rule.radius && (rule.factor < lowest || rule.factor > most)) {
    refuse_key("body.neighbours.factor", fmt::format("{:g}", rule.factor),
               fmt::format("{:.3g} to {:.3g}, for which critical stretches are known", lowest, most)
                   .c_str());
  }
  check_material("body.material", request.material);
  for (const InclusionRequest& inclusion : request.inclusions) {
    check_material("body.inclusion", inclusion.material);
  }
  if (!request.fracture) return;
  const double hourglass = request.material.hourglass.value_or(default_hourglass(request));
  if (hourglass < least_hourglass || hourglass > most_hourglass) {
    refuse_key("body.material.hourglass", fmt::format("{:g}", hourglass),
               fmt::format("{:g} to {:g}, for which critical stretches are known", least_hourglass,
                           most_hourglass)
                   .c_str());
  }
  for (const Selection& selection : request.fracture->unbreakable) {
    if (region_of(selection)) continue;
    refuse(selection.where, request,
           "body.fracture.unbreakable selects neither by box nor by ball; allowed: either");
  }
}

namespace {

/// True if a phyxel lies in a region, or on its faces.
bool holds(const SpaceRegion& region, const Model& model, Index i) {
  constexpr double digits = 1e-9;  // of positions, which faces share with boxes
  const Vec3d x = model.position[i];
  return region.distance(x) <= digits * (norm(x) + model.neighbourhood.support[i]);
}

/// The distance of the farthest neighbour of a phyxel [m].
double reach_of(const Model& model, Index i) {
  double square = 0;
  for (const Index j : model.neighbourhood.neighbours.row(i)) {
    const Vec3d x = model.position[j] - model.position[i];
    square = std::max(square, dot(x, x));
  }
  return (1 + 1e-9) * std::sqrt(square);  // with the rounding of what lies at the end of a way
}

/// What a message says of a notch.
std::string described(const NotchRequest& notch) {
  if (!notch.mesh.empty()) return fmt::format("mesh = \"{}\"", notch.mesh.string());
  const Vec3d c = notch.centre, n = notch.normal;
  return fmt::format("centre = [{:g}, {:g}, {:g}], normal = [{:g}, {:g}, {:g}], radius = {:g}", c.x,
                     c.y, c.z, n.x, n.y, n.z, notch.radius);
}

/// Refuses a body on all ranks, which have come to the same verdict.
[[noreturn]] void refuse_on_all(const Model& model, const std::string& where,
                                const BodyRequest& body, const std::string& problem) {
  if (!model.share) refuse(where, body, problem);
  throw AgreedError(
      ExitCode::bad_input,
      fmt::format("{}{}body \"{}\": {}", where, where.empty() ? "" : ": ", body.name, problem));
}

}  // namespace

void find_fracture(Model& model, const Scene& scene) {
  for (const BodyRequest& body : scene.bodies) model.fracture.notched |= !body.notches.empty();
  for (const BodyRequest& body : scene.bodies) model.fracture.breaks |= body.fracture.has_value();
  if (!model.fracture.breaks) return;
  for (const BodyRequest& body : scene.bodies) {
    if (!body.fracture || !scene.contact) continue;
    refuse(body.fracture->where, body,
           "body.fracture found with [contact], for which the surface of a body would have to "
           "break, too; allowed: one of both, and obstacles");
  }
  model.fracture.growth.assign(static_cast<std::size_t>(model.size()), unbreakable_growth);
  for (const Part& part : model.parts) {
    const BodyRequest& request = scene.bodies[static_cast<std::size_t>(part.body)];
    if (!request.fracture || part.begin == part.end) continue;
    const FractureRequest& fracture = *request.fracture;
    NeighbourhoodRule rule = request.neighbourhood;
    const Spacings spacings = spacings_of(model, part, rule);
    std::vector<SpaceRegion> kept;
    for (const Selection& selection : fracture.unbreakable) kept.push_back(*region_of(selection));
    const std::vector<double>& support = model.neighbourhood.support;
    double stretch = 0, of_support = 0;
    for (Index i = part.begin; i < part.end; ++i) {
      if (support[i] != of_support) {
        std::vector<std::string> again;
        of_support = support[i];
        stretch = stretch_of(request, part, spacings.of(of_support), spacings.relative_support,
                             i == part.begin ? model.warnings : again);
      }
      const auto keeps = [&](const SpaceRegion& region) { return holds(region, model, i); };
      if (std::any_of(kept.begin(), kept.end(), keeps)) continue;
      const double factor =
          fracture.scatter ? scatter_of(model.global_id(i), *fracture.scatter, fracture.seed) : 1;
      model.fracture.growth[i] = critical_growth(factor * stretch);
    }
  }
}

void check_unbreakable(const Model& model, const Scene& scene) {
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const BodyRequest& body = scene.bodies[b];
    if (!body.fracture) continue;
    for (const Selection& selection : body.fracture->unbreakable) {
      const SpaceRegion region = *region_of(selection);
      bool any = false;
      for (const Part& part : model.parts) {
        if (part.body != static_cast<Index>(b)) continue;
        for (Index i = part.begin; i < part.owned_end() && !any; ++i) any = holds(region, model, i);
      }
      if (model.share) any = model.share->communicator->largest(any ? 1.0 : 0.0) > 0;
      if (any) continue;
      refuse_on_all(model, selection.where, body,
                    "body.fracture.unbreakable holds no phyxel of the body; allowed: a region with "
                    "phyxels, once the body is in place");
    }
  }
}

std::vector<PhyxelPair> notched_pairs(const Model& model, const Scene& scene) {
  std::vector<PhyxelPair> pairs;
  if (!model.fracture.notched) return pairs;
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    for (std::size_t k = 0; k < scene.bodies[b].notches.size(); ++k) {
      const NotchRequest& request = scene.bodies[b].notches[k];
      const Notch notch(request, scene.bodies[b]);
      std::int64_t cut = 0;
      for (const Part& part : model.parts) {
        if (part.body != static_cast<Index>(b)) continue;
        for (Index i = part.begin; i < part.owned_end(); ++i) {
          const Vec3d x = model.position[i];
          const std::vector<std::size_t> near = notch.near(x, reach_of(model, i));
          if (near.empty()) continue;
          for (const Index j : model.neighbourhood.neighbours.row(i)) {
            // Both ends ask about the same way, so that ranks agree.
            const Index c = model.global_id(i), d = model.global_id(j);
            const Vec3d y = model.position[j];
            if (!(c < d ? notch.cuts(x, y, near) : notch.cuts(y, x, near))) continue;
            pairs.push_back({std::min(c, d), std::max(c, d)});
            ++cut;
          }
        }
      }
      if (model.share) cut = model.share->communicator->largest(static_cast<double>(cut)) > 0;
      if (cut > 0) continue;
      refuse_on_all(model, request.where, scene.bodies[b],
                    fmt::format("body.notch {} ({}) cuts no pair of phyxels; allowed: a disc or "
                                "surface between phyxels of the body, once it is in place; a "
                                "phyxel in its plane lies above it, where the normal points",
                                k + 1, described(request)));
    }
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace phyxel
