/// The table of laws by name, made at run time from the list in physics/laws.hpp.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "phyxel/material.hpp"
#include "phyxel/physics/laws.hpp"

namespace phyxel {

/// An entry of the table, for scenes, Python and the reference page.
struct LawEntry {
  const char* name;                          ///< Name in scenes, e.g. "neo-hookean".
  const char* meaning;                       ///< Description in a sentence.
  std::span<const LawParameter> parameters;  ///< Parameters in the order of `constants`.
  bool is_linear;                            ///< True if the law does not stiffen.
  std::span<const HistoryNumber> history;    ///< History numbers of a phyxel.
  /// True if stored energy and plastic work after a step are a potential of the stress after it, as
  /// where the flow stress depends on the plastic strain alone: its minimum is then the balance of
  /// an implicit step.
  bool work_is_potential;
};

/// The law of materials that name none: it wins on first scenes, speed and accuracy (docs/laws.md).
/// The bodies of Farias et al. 2008 have another (`default_law`).
inline constexpr const char* usual_law = NeoHookean<double>::name;

/// All laws, in the order of `Laws`.
std::span<const LawEntry> law_table();

/// True for a parameter in `Material::parameters`: those other than `young`, `poisson` and
/// `density`.
bool is_own_parameter(const LawParameter& parameter);

/// The value of a required parameter in measurements of speed and in tests. @param scale factor of
/// the number, or of each y of a curve
ParameterValue typical_value(const LawParameter& parameter, double scale = 1);

/// True if there is a law of this name and it has this parameter; "" is `usual_law`.
bool has_parameter(std::string_view law, std::string_view parameter);

/// The laws that have a parameter, in words: "j2" or "clay", in quotes.
std::string laws_with(std::string_view parameter);

/// A material's law, ready for a kernel.
struct ChosenLaw {
  int index = 0;  ///< Index in `Laws`.
  /// The law's constants, then the stiffness of volume conservation [Pa], then the relaxation time
  /// of viscosity [s].
  std::array<double, Laws::most_constants + 2> constants{};
  bool operator==(const ChosenLaw&) const = default;
};

/// The law of a material that has no `custom_law`, with its constants; `usual_law` if it names
/// none.
/// @throws InputError for a law that does not exist, and for parameters that it does not have,
/// lacks
///   or does not allow
ChosenLaw chosen_law(const Material& material);

/// The names of a material's history numbers: those of the law, then those of viscosity. Empty for
/// an elastic material without viscosity.
/// @throws InputError as `chosen_law`
std::vector<std::string> history_names(const Material& material);

/// The modulus to which the strength of hourglass control is relative [Pa]: Young's modulus, unless
/// the law defines another (`hourglass_modulus` in its file).
/// @throws InputError as `chosen_law`
double hourglass_modulus(const Material& material);

/// The shortest time in which the history of a material follows a deformation by itself, which
/// steps have to resolve [s]; 0 without such a time.
/// @throws InputError as `chosen_law`
double shortest_time(const Material& material);

/// The longest time in which the history of a material follows a deformation by itself, as in creep
/// and relaxation [s]; 0 without such a time.
/// @throws InputError as `chosen_law`
double longest_time(const Material& material);

/// The most steps that `longest_time` may take in single precision: what a step changes of a
/// history is then a hundred times its rounding or more.
inline constexpr double most_steps_of_history = 1e5;

/// The stiffness of pressure waves at rest [Pa], the largest of all plane waves: λ + 2μ for Hooke's
/// law, plus volume conservation. For a custom law it follows from `young` and `poisson`.
/// @throws InputError as `chosen_law`
double wave_stiffness_at_rest(const Material& material);

}  // namespace phyxel
