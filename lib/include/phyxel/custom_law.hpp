/// Laws of the caller's own, elastic ones and such that remember.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "phyxel/types.hpp"

namespace phyxel {

/// A law that the library does not have, for `Material::custom_law`: the CPU backend
/// asks it for each phyxel's stress in every step, in double, whatever its precision, from all of
/// its threads at once. The step limit, energies, searches for rest and implicit steps follow from
/// it as from any other law. GPUs refuse it. What it throws reaches whoever asked for the step, the
/// forces or the energies; the state is then that before the step.
class CustomLaw {
 public:
  virtual ~CustomLaw();

  /// What tells it from another one in a checkpoint: its name, and the parameters in use.
  virtual std::string name() const = 0;
  /// ψ [J/m³ of the body at rest], zero at rest.
  /// @param grad_u ∇u = F - I
  virtual double energy(const Mat3d& grad_u) const = 0;
  /// First Piola–Kirchhoff stress P = ∂ψ/∂∇u [Pa], zero at rest; P(a, b) is the derivative by
  /// grad_u(a, b).
  /// @param grad_u ∇u = F - I
  virtual Mat3d first_piola_stress(const Mat3d& grad_u) const = 0;

  // A law that remembers overrides all that follow; the two above are then those of the virgin
  // material.

  /// The names of the numbers that each phyxel remembers, all zero in the virgin material.
  virtual std::vector<std::string> history() const { return {}; }
  /// The stored energy density [J/m³] with a history. @param numbers shape [history().size()]
  virtual double energy(const Mat3d& grad_u, std::span<const double> numbers) const;
  /// P [Pa] at the end of a step.
  /// @param numbers the history at its start; becomes that at its end, shape [history().size()]
  /// @param dt length of the step [s]; 0: no time has passed
  virtual Mat3d first_piola_stress(const Mat3d& grad_u, std::span<double> numbers, double dt) const;
  /// ∂ψ/∂∇u [Pa] while the history stays.
  virtual Mat3d elastic_stress(const Mat3d& grad_u, std::span<const double> numbers) const;
  /// Work that has been turned into heat since the virgin state [J/m³].
  virtual double plastic_work(std::span<const double> numbers) const;
};

/// Makes sure that a law can be stepped: energy and stress are zero at rest, and the stress is the
/// derivative of the energy, by differences at a few deformations of some percent. `build_model`
/// asks this of every law.
/// @param young of its material [Pa], which says what is small
/// @throws InputError naming the law, the entry of the stress, what it is and what the energy says
void check_custom_law(const CustomLaw& law, double young);

}  // namespace phyxel
