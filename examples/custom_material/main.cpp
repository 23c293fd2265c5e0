/// phyxel as a library: a custom law. A block of Mooney-Rivlin rubber is stretched by half its
/// length, and its force is compared with the law's exact answer.
#include <cmath>
#include <cstdio>
#include <phyxel/physics/laws.hpp>
#include <phyxel/phyxel.hpp>

namespace {

using phyxel::Mat3d;

/// The law of Mooney 1940 and Rivlin 1948, with a volume term (as in Holzapfel, Nonlinear Solid
/// Mechanics, section 6.5):
///   ψ = c1 (J^-2/3 I1 - 3) + c2 (J^-4/3 I2 - 3) + ½ κ (J - 1)²
/// with I1 = F:F and I2 = ½ (I1² - FᵀF:FᵀF).
class MooneyRivlin final : public phyxel::CustomLaw {
 public:
  MooneyRivlin(double c1, double c2, double kappa) : c1_(c1), c2_(c2), kappa_(kappa) {}

  std::string name() const override {
    return "Mooney-Rivlin " + std::to_string(c1_) + " " + std::to_string(c2_) + " " +
           std::to_string(kappa_);
  }
  double energy(const Mat3d& grad_u) const override {
    const Invariants i(grad_u);
    const double change = phyxel::volume_change(grad_u);
    return c1_ * (i.first * i.per_volume - 3) + c2_ * (i.second * i.per_volume * i.per_volume - 3) +
           0.5 * kappa_ * change * change;
  }
  Mat3d first_piola_stress(const Mat3d& grad_u) const override {
    const Invariants i(grad_u);
    const Mat3d cof = cofactor(i.f), inverse_transpose = (1 / determinant(i.f)) * cof;
    const Mat3d by_first = i.f - (i.first / 3) * inverse_transpose;
    const Mat3d by_second = i.first * i.f - i.f * i.c - (2 * i.second / 3) * inverse_transpose;
    return (2 * c1_ * i.per_volume) * by_first +
           (2 * c2_ * i.per_volume * i.per_volume) * by_second +
           (kappa_ * phyxel::volume_change(grad_u)) * cof;
  }

  double shear_modulus() const { return 2 * (c1_ + c2_); }
  /// Young's modulus [Pa] and Poisson's ratio at rest, for the material.
  double young() const { return 9 * kappa_ * shear_modulus() / (3 * kappa_ + shear_modulus()); }
  double poisson() const { return young() / (2 * shear_modulus()) - 1; }

 private:
  struct Invariants {
    explicit Invariants(const Mat3d& grad_u)
        : f(phyxel::identity<double>() + grad_u), c(transpose(f) * f) {
      double squares = 0;
      for (int e = 0; e < 9; ++e) squares += c(e / 3, e % 3) * c(e / 3, e % 3);
      first = c(0, 0) + c(1, 1) + c(2, 2);
      second = 0.5 * (first * first - squares);
      per_volume = std::pow(determinant(f), -2.0 / 3);
    }
    Mat3d f, c;
    double first, second, per_volume;
  };

  double c1_, c2_, kappa_;  ///< [Pa]
};

/// Nominal stress of a bar with the given stretch and stress-free sides [Pa].
double tension(const phyxel::CustomLaw& law, double stretch) {
  Mat3d grad_u;
  grad_u(0, 0) = stretch - 1;
  double thin = -0.9, thick = 0;  // bounds of the lateral strain; the sides pull if it is too thick
  for (int k = 0; k < 60; ++k) {
    const double middle = 0.5 * (thin + thick);
    grad_u(1, 1) = grad_u(2, 2) = middle;
    (law.first_piola_stress(grad_u)(1, 1) > 0 ? thick : thin) = middle;
  }
  return law.first_piola_stress(grad_u)(0, 0);
}

}  // namespace

int main() {
  constexpr double length = 0.4, width = 0.2;  // [m]
  constexpr double stretch = 1.5;

  const auto law = std::make_shared<const MooneyRivlin>(8e4, 4e4, 1e6);
  phyxel::Scene scene;
  scene.solver.method = phyxel::Method::equilibrium;
  phyxel::BodyRequest& block = scene.bodies.emplace_back();
  block.name = "block";
  block.material = {.young = law->young(), .poisson = law->poisson(), .density = 1100};
  block.material.custom_law = law;
  const auto smooth_wall = [&](const char* region, phyxel::Axes axis) {
    phyxel::FixRequest& wall = block.fixed.emplace_back();
    wall.select.region = region;
    wall.axes = axis;
  };
  smooth_wall("x-", {.x = true, .y = false, .z = false});
  smooth_wall("y-", {.x = false, .y = true, .z = false});
  smooth_wall("z-", {.x = false, .y = false, .z = true});
  phyxel::MotionRequest& pull = block.motions.emplace_back();
  pull.select.region = "x+";
  pull.axes = {.x = true, .y = false, .z = false};
  pull.displacement = {(stretch - 1) * length, 0, 0};
  pull.duration = 1;

  phyxel::ShapeRequest shape;
  shape.name = "block";
  shape.size = {length, width, width};
  shape.spacing = width / 6;
  shape.placement = phyxel::ShapeRequest::Placement::nodes;
  const phyxel::Cloud cloud = phyxel::make_shape(shape);
  const phyxel::Model model = phyxel::build_model(scene, {&cloud, 1});
  const auto backend = phyxel::make_cpu_backend(model, phyxel::Precision::double_);
  const phyxel::Equilibrium found = phyxel::find_equilibrium(model, *backend);

  std::vector<phyxel::Vec3d> force;
  backend->internal_forces(force);
  double pulling = 0;
  for (const phyxel::Index i : cloud.regions.at("x+")) pulling -= force[i].x;
  const phyxel::Diagnostics now = phyxel::diagnose(model, *backend, 0, 1);
  std::printf("%d phyxels of %s, largest step %.3g s, at rest after %d steps of Newton's method\n",
              model.size(), law->name().c_str(), phyxel::step_limit(model).largest_step,
              found.steps);
  std::printf("force: %.1f N; the law says %.1f N; Hooke would say %.1f N\n", pulling,
              tension(*law, stretch) * width * width,
              block.material.young * (stretch - 1) * width * width);
  std::printf("energy: %.2f J\n", now.strain_energy);
}
