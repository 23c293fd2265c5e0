#include "phyxel/custom_law.hpp"

#include <fmt/format.h>

#include <cmath>

#include "phyxel/error.hpp"

namespace phyxel {
namespace {

/// Test deformations ∇u: stretch, compression and shear of some percent, with a rotation.
const Mat3d deformations[] = {
    {{{0.05, 0.02, -0.01}, {0.0, -0.03, 0.02}, {0.01, -0.02, 0.04}}},
    {{{-0.06, -0.03, 0.02}, {0.05, 0.02, 0.0}, {-0.01, 0.03, -0.02}}},
};

void check_rest(const CustomLaw& law, double young) {
  const double energy = law.energy({});
  if (!(std::abs(energy) <= 1e-9 * young)) {
    throw InputError(fmt::format("law \"{}\": its energy at rest is {:g} J/m^3, allowed is 0",
                                 law.name(), energy));
  }
  const Mat3d stress = law.first_piola_stress({});
  for (int e = 0; e < 9; ++e) {
    if (std::abs(stress(e / 3, e % 3)) <= 1e-9 * young) continue;
    throw InputError(fmt::format("law \"{}\": its stress ({}, {}) at rest is {:g} Pa, allowed is 0",
                                 law.name(), e / 3, e % 3, stress(e / 3, e % 3)));
  }
}

void check_derivative(const CustomLaw& law, double young, const Mat3d& grad_u) {
  // Step of central differences, whose error is the square of the step, and whose rounding error is
  // 1e-16 divided by it.
  constexpr double step = 1e-5;
  const Mat3d stress = law.first_piola_stress(grad_u);
  double size = 1e-3 * young;
  for (int e = 0; e < 9; ++e) size = std::max(size, std::abs(stress(e / 3, e % 3)));
  for (int e = 0; e < 9; ++e) {
    const int a = e / 3, b = e % 3;
    Mat3d ahead = grad_u, behind = grad_u;
    ahead(a, b) += step;
    behind(a, b) -= step;
    const double slope = (law.energy(ahead) - law.energy(behind)) / (2 * step);
    if (std::abs(stress(a, b) - slope) <= 1e-4 * size) continue;
    throw InputError(
        fmt::format("law \"{}\": its stress ({}, {}) is {:g} Pa where its energy grows by {:g} "
                    "J/m^3 per unit of "
                    "grad_u({}, {}): allowed is a stress that is the energy's derivative",
                    law.name(), a, b, stress(a, b), slope, a, b));
  }
}

}  // namespace

CustomLaw::~CustomLaw() = default;

double CustomLaw::energy(const Mat3d& grad_u, std::span<const double>) const {
  return energy(grad_u);
}
Mat3d CustomLaw::first_piola_stress(const Mat3d& grad_u, std::span<double>, double) const {
  return first_piola_stress(grad_u);
}
Mat3d CustomLaw::elastic_stress(const Mat3d& grad_u, std::span<const double>) const {
  return first_piola_stress(grad_u);
}
double CustomLaw::plastic_work(std::span<const double>) const { return 0; }

void check_custom_law(const CustomLaw& law, double young) {
  check_rest(law, young);
  for (const Mat3d& grad_u : deformations) check_derivative(law, young, grad_u);
}

}  // namespace phyxel
