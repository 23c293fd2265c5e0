/// The laws that a material may have, by name: the run-time face of the list in physics/laws.hpp.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "phyxel/material.hpp"
#include "phyxel/physics/laws.hpp"

namespace phyxel {

/// A law as scenes, Python and the reference know it.
struct LawEntry {
  const char* name;                          ///< Its word in scenes, e.g. "neo-hookean".
  const char* meaning;                       ///< One sentence about it.
  std::span<const LawParameter> parameters;  ///< In the order in which `constants` takes them.
  bool is_linear;                            ///< True if it never stiffens.
  std::span<const HistoryNumber> history;    ///< The numbers that it remembers of a phyxel.
};

/// All laws, in the order of `Laws`.
std::span<const LawEntry> law_table();

/// True for a parameter with a place of its own in `Material::parameters`: all but `young` and
/// `poisson`.
bool is_own_parameter(const LawParameter& parameter);

/// True if there is a law of this name and it has this parameter.
bool has_parameter(std::string_view law, std::string_view parameter);

/// A material's law, ready for a kernel.
struct ChosenLaw {
  int index = 0;  ///< In `Laws`.
  /// The law's constants, then the stiffness of volume conservation [Pa], then the relaxation time
  /// of viscosity [s].
  std::array<double, Laws::most_constants + 2> constants{};
  bool operator==(const ChosenLaw&) const = default;
};

/// The law of a material that has no `custom_law`, with its constants.
/// @throws InputError for a law that does not exist, and for parameters that it does not have,
/// lacks
///   or does not allow
ChosenLaw chosen_law(const Material& material);

/// The names of the numbers that a phyxel of a material remembers, in the order in which its law
/// holds them: those of the law, then those of viscosity. Empty for an elastic material without
/// viscosity.
/// @throws InputError as `chosen_law`
std::vector<std::string> history_names(const Material& material);

/// The modulus [Pa] that the strength of hourglass control is a share of: Young's, unless the law
/// names another (`hourglass_modulus` in its file), as one that has no Young's modulus does.
/// @throws InputError as `chosen_law`
double hourglass_modulus(const Material& material);

/// The stiffness of pressure waves at rest [Pa], the largest of all plane waves: λ + 2μ of Hooke's
/// law, and volume conservation. A custom law has that of `young` and `poisson`.
/// @throws InputError as `chosen_law`
double wave_stiffness_at_rest(const Material& material);

}  // namespace phyxel
