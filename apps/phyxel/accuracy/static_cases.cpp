/// Problems of bodies at rest: affine motion of a surface, rotation, tension, cantilevers.
#include <cmath>
#include <numbers>
#include <random>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/physics/laws.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

/// A model and its equilibrium.
struct Rest {
  Cloud cloud;
  Model model;
  Equilibrium found;
  Solution solution;

  Vec3d moved(const std::string& region) const {
    return mean_of(model, cloud.regions.at(region), found.state.displacement);
  }
  Vec3d placed(const std::string& region) const {
    return mean_of(model, cloud.regions.at(region), model.position);
  }
};

/// Solves for the equilibrium of a scene.
/// @param begin begin of the set-up
/// @param change function applied to the model first
template <class Change>
Rest rest_of(Clock::time_point begin, const Scene& scene, Cloud cloud, Change&& change,
             const EquilibriumOptions& options = {}) {
  Rest rest;
  rest.cloud = std::move(cloud);
  rest.model = build_model(scene, std::span(&rest.cloud, 1));
  change(rest.model);
  const auto backend = make_cpu_backend(rest.model, Precision::double_);
  rest.solution.setup_seconds = seconds_since(begin);
  const auto start = Clock::now();
  rest.found = find_equilibrium(rest.model, *backend, options);
  rest.solution.seconds = seconds_since(start);
  rest.solution.evaluations = rest.found.evaluations;
  rest.solution.phyxels = rest.model.size();
  rest.solution.neighbours = static_cast<double>(rest.model.pairs()) / rest.model.size();
  return rest;
}
Rest rest_of(const Scene& scene, const Discretisation& d) {
  const auto begin = Clock::now();
  return rest_of(begin, scene, cloud_of(scene, d), [](Model&) {});
}

/// Adds the time and evaluations of a solution to those of a case.
void add_to(Solution& total, const Solution& one) {
  total.phyxels = one.phyxels;
  total.neighbours = one.neighbours;
  total.evaluations += one.evaluations;
  total.seconds += one.seconds;
  total.setup_seconds += one.setup_seconds;
}

Solution with(Rest&& rest, std::vector<Quantity> found) {
  rest.solution.found = std::move(found);
  return std::move(rest.solution);
}

// --- the cases -----------------------------------------------------------------------------------

/// Displacement gradient ∂u_a/∂X_b of an affine motion.
Mat3d affine(double size) {
  std::mt19937_64 engine(7);
  Mat3d g;
  for (int e = 0; e < 9; ++e) {
    g(e / 3, e % 3) = size * (static_cast<double>(engine() >> 11) * 0x1p-52 - 1);
  }
  return g;
}

Solution patch(const Discretisation& d) {
  const Mat3d g = affine(1e-3);
  Scene scene = bar(d, 1, 1);
  double largest = 0;
  const auto hold = [&](Model& model) {
    const double layer = (d.filling == Filling::cells ? 1.5 : 0.1) / d.across;
    Vec3d low = model.position[0], high = low;
    for (const Vec3d& x : model.position) {
      low = {std::min(low.x, x.x), std::min(low.y, x.y), std::min(low.z, x.z)};
      high = {std::max(high.x, x.x), std::max(high.y, x.y), std::max(high.z, x.z)};
    }
    for (Index i = 0; i < model.size(); ++i) {
      const Vec3d x = model.position[i];
      largest = std::max(largest, norm(g * x));
      const double inside = std::min(
          {x.x - low.x, x.y - low.y, x.z - low.z, high.x - x.x, high.y - x.y, high.z - x.z});
      if (inside < layer) model.motions.push_back({.phyxels = {i}, .displacement = g * x});
    }
  };
  const auto begin = Clock::now();
  Rest rest = rest_of(begin, scene, cloud_of(scene, d), hold, {.tolerance = 1e-11});
  double worst = 0;
  for (Index i = 0; i < rest.model.size(); ++i) {
    worst = std::max(worst, norm(rest.found.state.displacement[i] - g * rest.model.position[i]));
  }
  return with(std::move(rest),
              {{"largest error of a displacement by the largest one", worst / largest}});
}

Solution rotation(const Discretisation& d) {
  const auto begin = Clock::now();
  const Scene scene = bar(d, 1, 1);
  const Cloud cloud = cloud_of(scene, d);
  const Model model = build_model(scene, std::span(&cloud, 1));
  State state;
  for (const Vec3d& x : model.position) {
    state.displacement.push_back(Vec3d{x.y, x.z, x.x} - x);  // 120 degrees about the diagonal
  }
  state.velocity.resize(state.displacement.size());
  const auto backend = make_cpu_backend(model, Precision::double_);
  const double setup = seconds_since(begin);
  const auto start = Clock::now();
  backend->upload(state);
  const Diagnostics now = diagnose(model, *backend, 0, 1);
  Solution solution{.phyxels = model.size(),
                    .neighbours = static_cast<double>(model.pairs()) / model.size(),
                    .evaluations = 1,
                    .seconds = seconds_since(start),
                    .setup_seconds = setup};
  const double face = std::pow(model.parts[0].volume / model.size(), 2.0 / 3);  // [m²]
  solution.found = {
      {"mean force by E on a phyxel's face", now.force_scale / (model.size() * E * face)}};
  return solution;
}

/// A load along x with its line of action on the axis: distributed by volume and corrected by a
/// linear function, so that an irregular end does not cause a torque.
Load on_axis(const Model& model, const std::vector<Index>& end, double force) {
  double all = 0, yy = 0, yz = 0, zz = 0, y = 0, z = 0;
  for (const Index i : end) {
    const Vec3d& x = model.position[i];
    all += model.mass[i], y += model.mass[i] * x.y, z += model.mass[i] * x.z;
    yy += model.mass[i] * x.y * x.y, yz += model.mass[i] * x.y * x.z;
    zz += model.mass[i] * x.z * x.z;
  }
  // Weights (1 + a y + b z) m, with a and b such that the first moments vanish.
  const double det = yy * zz - yz * yz, a = -(y * zz - z * yz) / det, b = -(z * yy - y * yz) / det;
  const double sum = all + a * y + b * z;
  Load load;
  load.phyxels = end;
  for (const Index i : end) {
    const Vec3d& x = model.position[i];
    load.force.push_back({force * model.mass[i] * (1 + a * x.y + b * x.z) / sum, 0, 0});
  }
  return load;
}

constexpr double small_strain = 1e-6;

/// A bar, pulled at both ends by a stress of so much [Pa].
Rest pulled(const Scene& scene, const Discretisation& d, double side, double stress) {
  const double force = stress * side * side;
  const auto begin = Clock::now();
  const Cloud cloud = cloud_of(scene, d);
  return rest_of(begin, scene, cloud, [&](Model& model) {
    model.loads.push_back(on_axis(model, cloud.regions.at("x-"), -force));
    model.loads.push_back(on_axis(model, cloud.regions.at("x+"), force));
  });
}
/// By how much it has become longer, of its length.
double stretch_of(const Rest& rest) {
  return (rest.moved("x+").x - rest.moved("x-").x) / (rest.placed("x+").x - rest.placed("x-").x);
}

Solution tension(const Discretisation& d) {
  constexpr double length = 1, side = 0.2, strain = small_strain;
  Rest rest = pulled(bar(d, length, side), d, side, strain * E);
  const double stretch = stretch_of(rest);
  const double narrowing =
      (rest.moved("y+").y - rest.moved("y-").y) / (rest.placed("y+").y - rest.placed("y-").y);
  return with(std::move(rest), {{"E", strain * E / stretch, E}, {"ν", -narrowing / stretch, nu}});
}

/// Spruce (Forest Products Laboratory 2010, Wood handbook, tables 5-1 and 5-2: Sitka spruce),
/// longitudinal, radial and tangential, of E along the grain.
struct Spruce {
  static constexpr double young[] = {E, 0.078 * E, 0.043 * E};  // [Pa]
  static constexpr double poisson_lr = 0.372, poisson_lt = 0.467, poisson_rt = 0.435;
  static constexpr double shear_lr = 0.064 * E, shear_lt = 0.061 * E, shear_rt = 0.003 * E;  // [Pa]
};

/// Young's modulus along the bar of wood whose grain is turned out of its axis by an angle.
Quantity off_axis(const Discretisation& d, double degrees, Solution& total) {
  constexpr double length = 1, side = 0.2;
  const double angle = degrees * std::numbers::pi / 180, c = std::cos(angle), s = std::sin(angle);
  Scene scene = bar(d, length, side);
  Material& wood = scene.bodies[0].material;
  wood.law = Orthotropic<double>::name;
  wood.young = wood.poisson = 0;
  wood.parameters = {{"young1", Spruce::young[0]},      {"young2", Spruce::young[1]},
                     {"young3", Spruce::young[2]},      {"poisson12", Spruce::poisson_lr},
                     {"poisson13", Spruce::poisson_lt}, {"poisson23", Spruce::poisson_rt},
                     {"shear12", Spruce::shear_lr},     {"shear13", Spruce::shear_lt},
                     {"shear23", Spruce::shear_rt},     {"axis1", Vec3d{c, s, 0}},
                     {"axis2", Vec3d{-s, c, 0}}};
  const double known =
      1 / (std::pow(c, 4) / Spruce::young[0] + std::pow(s, 4) / Spruce::young[1] +
           c * c * s * s * (1 / Spruce::shear_lr - 2 * Spruce::poisson_lr / Spruce::young[0]));
  Rest rest = pulled(scene, d, side, small_strain * known);
  add_to(total, rest.solution);
  return {"E at " + std::to_string(static_cast<int>(degrees)) + "°",
          small_strain * known / stretch_of(rest), known};
}
Solution wood(const Discretisation& d) {
  Solution solution;
  for (const double degrees : {0.0, 15.0, 45.0, 90.0}) {
    const Quantity found = off_axis(d, degrees, solution);
    solution.found.push_back(found);
  }
  return solution;
}

/// Where the end goes, along -z [m].
double sag(const Rest& rest) { return -rest.moved("x+").z; }

Solution gravity(const Discretisation& d) {
  Scene scene = clamped(bar(d, 1, 0.2));
  scene.gravity = {0, 0, -0.1};
  Rest rest = rest_of(scene, d);
  const double found = sag(rest);
  return with(std::move(rest), {{"deflection", found, 3.83980e-03}});
}

Solution shear(const Discretisation& d) {
  Scene scene = clamped(bar(d, 1, 0.2));
  scene.bodies[0].loads.push_back({.select = {.region = "x+"}, .force = {0, 0, -1}});
  Rest rest = rest_of(scene, d);
  const double found = sag(rest);
  return with(std::move(rest), {{"deflection", found, 2.5440e-03}});
}

Solution elastica(const Discretisation& d) {
  constexpr double length = 2, side = 0.1;
  Scene scene = clamped(bar(d, length, side, 0));
  const double inertia = std::pow(side, 4) / 12;
  scene.bodies[0].loads.push_back(
      {.select = {.region = "x+"}, .force = {0, 0, -2 * E * inertia / (length * length)}});
  Rest rest = rest_of(scene, d);
  const double down = sag(rest) / length, back = -rest.moved("x+").x / length;
  return with(std::move(rest), {{"down", down, 0.49457}, {"back", back, 0.16133}});
}

/// Energy of a column whose end is rotated about its axis [J].
double energy_of_twist(const Discretisation& d, double degrees, Solution& total) {
  Scene scene = clamped(bar(d, 1, 0.2));
  scene.bodies[0].material.law = NeoHookean<double>::name;
  scene.bodies[0].motions.push_back(
      {.select = {.region = "x+"}, .rotation = {degrees, 0, 0}, .duration = 1});
  const Rest rest = rest_of(scene, d);
  const auto backend = make_cpu_backend(rest.model, Precision::double_);
  backend->upload(rest.found.state);
  add_to(total, rest.solution);
  return diagnose(rest.model, *backend, 0, 1).elastic_energy();
}
Solution twist(const Discretisation& d) {
  Solution solution;
  solution.found = {{"energy of a quarter turn", energy_of_twist(d, 90, solution), 107.5352},
                    {"energy of half a turn", energy_of_twist(d, 180, solution), 431.2161}};
  return solution;
}

/// Cook's membrane, 48 by 44 to 16, with three layers of phyxels between smooth walls. @returns the
///   displacements along y of the middle of the right side and of its upper corner, times E over
///   the force per unit of thickness
std::pair<double, double> cook_of(const Discretisation& d, double poisson, Solution& total) {
  constexpr double length = 48, left = 44, strain = 1e-5;
  const double spacing = left / d.across, thickness = 2 * spacing;
  Discretisation lattice = d;
  Scene scene = bar(lattice, length, left, poisson);
  BodyRequest& body = scene.bodies[0];
  body.source.shape.size.z = thickness;
  const auto begin = Clock::now();
  Cloud cloud = cloud_of(scene, d);
  const double shift = d.filling == Filling::cells ? 0.5 * spacing : 0;
  const auto height = [](double x) { return left - 28 * x / length; };
  const auto mapped = [&](Vec3d p) {
    const double x = p.x - shift;
    return Vec3d{x, left * x / length + (p.y / left + 0.5) * height(x), p.z};
  };
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    cloud.volume[i] *= height(cloud.position[i].x - shift) / left;
    cloud.position[i] = mapped(cloud.position[i]);
  }
  for (Vec3d& p : cloud.surface.position) p = mapped(p);
  body.fixed.push_back({.select = {.all = true}, .axes = {.x = false, .y = false, .z = true}});
  body.fixed.push_back({.select = {.region = "x-"}, .axes = {.x = true, .y = true, .z = false}});
  body.loads.push_back({.select = {.region = "x+"}, .force = {0, strain * E * thickness, 0}});
  Rest rest = rest_of(begin, scene, std::move(cloud), [](Model&) {});
  double highest = -1, corner = 0, at_corner = 0;
  for (const Index i : rest.cloud.regions.at("x+")) {
    const double y = rest.model.position[i].y, u = rest.found.state.displacement[i].y;
    if (y > highest + 1e-6) highest = y, corner = at_corner = 0;
    if (y > highest - 1e-6) corner += u, ++at_corner;
  }
  add_to(total, rest.solution);
  return {rest.moved("x+").y / strain, corner / at_corner / strain};
}

Solution cook(const Discretisation& d) {
  Solution solution;
  const auto [side, corner] = cook_of(d, 0.3, solution);
  const auto [soft_side, soft_corner] = cook_of(d, 0.499, solution);
  solution.found = {{"side at ν = 0.3", side, 22.01224},
                    {"corner at ν = 0.3", corner, 23.05673},
                    {"side at ν = 0.499", soft_side, 18.58810},
                    {"corner at ν = 0.499", soft_corner, 19.45008}};
  return solution;
}

}  // namespace

std::vector<AccuracyCase> static_cases() {
  return {
      {"patch",
       "A cube whose outer phyxels (the outer two layers, on cells) follow an affine motion of "
       "0.1%; the inner phyxels should follow it, too.",
       {6, 10},
       patch,
       {0, 1e-3, 1e-11}},
      {"rotation", "A cube is rotated by 120 degrees; no force should arise.", {6, 10}, rotation},
      {"tension",
       "A bar, five times as long as wide, is pulled at both ends by a stress of 10⁻⁶ E; its "
       "strains should give E and ν.",
       {4, 6, 8, 12},
       tension},
      {"wood",
       "The same bar made of spruce, which is 23 times as stiff along the grain as across it. The "
       "grain is inclined to the axis of the bar; the result is Young's modulus along the bar. "
       "Reference: 1/E = c⁴/E₁ + s⁴/E₂ + c² s² (1/G₁₂ - 2 ν₁₂/E₁), where c and s are the cosine "
       "and sine of the angle (Lekhnitskii 1963).",
       {4, 6, 8},
       wood},
      {"gravity",
       "A bar, five times as long as wide, is clamped at one end and bends under its weight. "
       "Reference: finite elements with quadratic displacements and linear pressure, graded "
       "towards the clamped edges and extrapolated; ± 0.0005%.",
       {4, 6, 8, 12},
       gravity},
      {"shear",
       "The same bar under a shear force at its free end. Reference: quadratic finite elements, "
       "graded towards the clamped edges and extrapolated; ± 0.005%.",
       {4, 6, 8, 12},
       shear},
      {"elastica",
       "A bar, twenty times as long as wide, ν = 0, is clamped at one end; an end load F with F L² "
       "= 2 E I bends it by half its length. Reference: plane quadratic finite elements, which are "
       "exact for ν = 0; ± 0.001%. The beam of Bisshopp and Drucker 1945, inextensible and rigid "
       "in shear, moves 0.2% less down and 0.4% less back.",
       {4, 6, 8},
       elastica},
      {"twist",
       "A neo-Hookean column, five times as long as wide, is fixed at one end and rotated at the "
       "other; both ends stay flat. Reference: finite elements of order 4 to 6 on graded "
       "hexahedra, extrapolated; ± 0.0001%.",
       {4, 6, 8},
       twist},
      {"cook",
       "Cook's membrane in plane strain: a panel that tapers from 44 to 16 over a length of 48, "
       "clamped at its left side, under a shear force on its right side. Displacements of the "
       "right side are in units of force per thickness over E. Reference: 128 × 128 finite "
       "elements with quadratic displacements and linear pressure, graded towards all corners and "
       "extrapolated; ± 0.0002%.",
       {11, 22},
       cook},
  };
}

}  // namespace phyxel::app
