/// Custom laws, with or without history.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// A law of the caller's, for `Material::custom_law`. The CPU backend calls it for the stress of
/// each phyxel in each step, in double whatever its precision, from several threads at once. The
/// step limit, energies, equilibria and implicit steps use it as any other law. GPUs refuse it. An
/// exception of the law reaches the caller of the step, the forces or the energies; the state is
/// then that before the step.
class CustomLaw {
 public:
  virtual ~CustomLaw();

  /// The law's name and parameters, by which checkpoints distinguish laws.
  virtual std::string name() const = 0;
  /// Energy density ψ [J/m³ at rest], zero at rest. @param grad_u ∇u = F - I
  virtual double energy(const Mat3d& grad_u) const = 0;
  /// First Piola–Kirchhoff stress P = ∂ψ/∂∇u [Pa], zero at rest; P(a, b) is the derivative by
  /// grad_u(a, b).
  /// @param grad_u ∇u = F - I
  virtual Mat3d first_piola_stress(const Mat3d& grad_u) const = 0;

  // A law with history overrides the following functions; the two above then apply to the virgin
  // material.

  /// The names of the history numbers of each phyxel, zero in the virgin material.
  virtual std::vector<std::string> history() const { return {}; }
  /// The stored energy density [J/m³] with a history. @param numbers shape [history().size()]
  virtual double energy(const Mat3d& grad_u, std::span<const double> numbers) const;
  /// Stress P at the end of a step [Pa].
  /// @param numbers history at the start of the step, updated to its end, shape [history().size()]
  /// @param dt length of the step [s]; 0 if no time has passed, `endless_time` in a search for rest
  virtual Mat3d first_piola_stress(const Mat3d& grad_u, std::span<double> numbers, double dt) const;
  /// The derivative ∂ψ/∂∇u at constant history [Pa].
  virtual Mat3d elastic_stress(const Mat3d& grad_u, std::span<const double> numbers) const;
  /// Work dissipated since the virgin state [J/m³].
  virtual double plastic_work(std::span<const double> numbers) const;
};

/// Checks that energy and stress of a law are zero at rest, and that the stress is the derivative
/// of the energy, by differences at some deformations of a few percent. `build_model` checks each
/// custom law.
/// @param young Young's modulus of its material [Pa], the scale of the tolerance
/// @throws InputError naming the law, the entry of the stress, its value and that of the difference
void check_custom_law(const CustomLaw& law, double young);

}  // namespace phyxel
