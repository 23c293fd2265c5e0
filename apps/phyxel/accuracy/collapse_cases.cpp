/// Plastic collapse: a tube and a hollow sphere under inner pressure.
#include <cmath>
#include <numbers>
#include <utility>

#include "accuracy/accuracy.hpp"
#include "accuracy/bar.hpp"
#include "accuracy/round_bodies.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/physics/laws.hpp"
#include "stopwatch.hpp"

namespace phyxel::app {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double inner_radius = 0.1, outer_radius = 0.2;               // [m]
constexpr double young = 210e9, poisson = 0.3, yield_stress = 0.24e9;  // [Pa], -

/// Closed forms for a tube in plane strain, or a hollow sphere, of perfectly plastic material under
/// growing inner pressure.
struct Shape {
  bool sphere = false;

  Vec3d radial(Vec3d x) const { return sphere ? x : Vec3d{x.x, x.y, 0}; }
  /// The pressure [Pa] at which a wall between two radii is plastic throughout (Hill 1950, The
  /// mathematical theory of plasticity, chapter 5).
  double collapse(double inner, double outer) const {
    const double yield = sphere ? 2 * yield_stress : 2 / std::sqrt(3.0) * yield_stress;
    return yield * std::log(outer / inner);
  }
  /// The pressure [Pa] at which a wall is plastic up to a radius.
  double plastic_to(double radius) const {
    const double a = inner_radius, b = outer_radius;
    return sphere ? collapse(a, radius) + 2.0 / 3 * yield_stress * (1 - std::pow(radius / b, 3))
                  : collapse(a, radius) +
                        yield_stress / std::sqrt(3.0) * (1 - std::pow(radius / b, 2));
  }
  /// The radius [m] up to which the wall is plastic at a pressure [Pa].
  double plastic_radius(double pressure) const {
    double low = inner_radius, high = outer_radius;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (plastic_to(middle) < pressure ? low : high) = middle;
    }
    return low;
  }
  /// The same radius [m], from the outward displacement of the outer surface [m]: the wall beyond
  /// the radius is elastic.
  double plastic_radius_moved(double outward) const {
    const double b = outer_radius;
    if (sphere) return std::cbrt(outward * young * b * b / ((1 - poisson) * yield_stress));
    return std::sqrt(outward * young * b * std::sqrt(3.0) /
                     (2 * (1 - poisson * poisson) * yield_stress));
  }
};

/// A body whose inner surface is pushed outwards by prescribed displacements, since there are no
/// loads by pressure.
class Wall {
 public:
  Wall(const Discretisation& d, Shape shape) : shape_(shape) {
    const auto begin = Clock::now();
    Cloud cloud = shape.sphere ? eighth_of_shell(d, inner_radius, outer_radius)
                               : quarter_tube(d, inner_radius, outer_radius);
    const double spacing = (outer_radius - inner_radius) / d.across;
    thickness_ = 2 * spacing;
    BodyRequest body;
    body.name = "wall";
    body.where = "phyxel accuracy";
    body.material = {.young = young,
                     .poisson = poisson,
                     .density = 7850,
                     .law = J2<double>::name,
                     .parameters = {{"yield_stress", yield_stress}},
                     .hourglass = d.hourglass};
    body.neighbourhood.factor = d.factor;
    body.closure = d.closure;
    Scene scene;
    scene.bodies.push_back(body);
    model_ = build_model(scene, std::span(&cloud, 1));
    const double near = 1e-6 * spacing;
    Motion plane[3];
    plane[0].axes = {.x = true, .y = false, .z = false};
    plane[1].axes = {.x = false, .y = true, .z = false};
    plane[2].axes = {.x = false, .y = false, .z = true};
    for (Index i = 0; i < model_.size(); ++i) {
      const Vec3d& x = model_.position[i];
      if (x.x < near) plane[0].phyxels.push_back(i);
      if (x.y < near) plane[1].phyxels.push_back(i);
      if (x.z < near || !shape.sphere) plane[2].phyxels.push_back(i);
      const double r = norm(shape.radial(x));
      // Those of a mesh lie on its facets.
      if (r < inner_radius + 0.1 * spacing) inner_.push_back(i);
      if (r > outer_radius - 0.1 * spacing) outer_.push_back(i);
    }
    for (Motion& held : plane) model_.motions.push_back(std::move(held));
    first_ = model_.motions.size();
    for (const Index i : inner_) model_.motions.push_back({.phyxels = {i}, .duration = 1});
    backend_ = make_cpu_backend(model_, Precision::double_);
    solution_ = {.phyxels = model_.size(),
                 .neighbours = static_cast<double>(model_.pairs()) / model_.size(),
                 .setup_seconds = seconds_since(begin)};
  }

  /// Pushes the inner surface to a displacement [m], in `parts` equal increments, each brought to
  /// rest by Newton's method.
  void push_to(double outward, int parts) {
    const auto start = Clock::now();
    const double from = pushed_;
    for (int k = 1; k <= parts; ++k) {
      pushed_ = from + (outward - from) * k / parts;
      for (std::size_t n = 0; n < inner_.size(); ++n) {
        model_.motions[first_ + n].displacement = pushed_ * direction(inner_[n]);
      }
      const std::vector<Vec3d> before = state_.displacement;
      const Equilibrium found = find_equilibrium(
          model_, *backend_, {.tolerance = 1e-5, .start = before.empty() ? nullptr : &before});
      state_ = found.state;
      solution_.evaluations += found.evaluations;
    }
    solution_.seconds += seconds_since(start);
  }
  /// Pressure [Pa]: the reactions of the inner surface over its present area.
  double pressure() {
    std::vector<Vec3d> force;
    backend_->internal_forces(force);
    double outwards = 0;
    for (const Index i : inner_) outwards -= dot(force[i], direction(i));
    const double r = inner_now();
    return outwards / (shape_.sphere ? 0.5 * pi * r * r : 0.5 * pi * r * thickness_);
  }
  double inner_now() const { return inner_radius + pushed_; }        ///< [m]
  double outer_now() const { return outer_radius + outer_moved(); }  ///< [m]
  /// Mean outward displacement of the outer surface [m].
  double outer_moved() const {
    double sum = 0, volume = 0;
    for (const Index i : outer_) {
      sum += model_.volume[i] * dot(state_.displacement[i], direction(i));
      volume += model_.volume[i];
    }
    return sum / volume;
  }
  Solution solution(std::vector<Quantity> found) {
    solution_.found = std::move(found);
    return solution_;
  }

 private:
  Vec3d direction(Index i) const { return normalised(shape_.radial(model_.position[i])); }

  Shape shape_;
  double thickness_ = 0, pushed_ = 0;
  Model model_;
  std::vector<Index> inner_, outer_;
  std::size_t first_ = 0;  ///< Motion of the inner surface.
  std::unique_ptr<Backend> backend_;
  State state_;
  Solution solution_;
};

/// @param partly displacement of the inner surface [m] at which the wall is plastic half-way
/// @param collapsed displacement [m] at which the wall is plastic throughout
Solution burst(const Discretisation& d, Shape shape, double partly, double collapsed) {
  Wall wall(d, shape);
  wall.push_to(partly, 4);
  const double known = shape.collapse(inner_radius, outer_radius);
  // The wall becomes thinner: its pressure is brought back to the radii at rest.
  const auto pressure = [&] {
    return wall.pressure() * known / shape.collapse(wall.inner_now(), wall.outer_now());
  };
  const double radius = shape.plastic_radius_moved(wall.outer_moved());
  const double expected = shape.plastic_radius(pressure());
  wall.push_to(collapsed, 4);
  const double found = pressure();
  return wall.solution({{"collapse pressure", found, known}, {"plastic radius", radius, expected}});
}

Solution tube(const Discretisation& d) { return burst(d, {.sphere = false}, 2.8e-4, 8e-4); }
Solution sphere(const Discretisation& d) { return burst(d, {.sphere = true}, 2.8e-4, 8e-4); }

const std::vector<Filling> fillings{Filling::nodes, Filling::mesh};

}  // namespace

std::vector<AccuracyCase> collapse_cases() {
  return {
      {.name = "tube",
       .what =
           "A quarter of a thick tube in plane strain, outer radius twice the inner one, of steel "
           "without hardening (E 210 GPa, ν 0.3, yield stress σ 0.24 GPa). Its inner surface is "
           "displaced outwards by 0.8% of its radius, in increments that Newton's method brings to "
           "equilibrium; the pressure is computed from the reactions of that surface. Reference: "
           "2/√3 σ ln(b/a) at collapse (Hill 1950; de Souza Neto, Perić and Owen 2008, 7.5.1); the "
           "pressure is scaled from the present radii b and a to those at rest. *Plastic radius*: "
           "the radius up to which the wall is plastic half-way to collapse, from the displacement "
           "of the outer surface; reference: Hill's radius at the same pressure. One-dimensional "
           "finite differences give 0.07% less than Hill's pressure.",
       .across = {4, 8, 12},
       .solve = tube,
       .jitters = {0},
       .hourglass = {0.1},
       .fillings = fillings},
      {.name = "sphere",
       .what = "An eighth of a hollow sphere with the same steel, radii and method. Reference: 2 σ "
               "ln(b/a) (Hill 1950; de Souza Neto, Perić and Owen 2008, 7.5.2); one-dimensional "
               "finite differences give the same to 0.01%.",
       .across = {4, 8},
       .solve = sphere,
       .jitters = {0},
       .hourglass = {0.1},
       .fillings = fillings}};
}

}  // namespace phyxel::app
