/// The interface of a constitutive law. A law is a struct in a file of its own under
/// `physics/laws/`, a template on the scalar (`float`, `double` or a SIMD pack), named once in the
/// list of `physics/laws.hpp`. It has
///
///   static constexpr const char* name, *meaning;    its name in scenes, and one sentence for users
///   static constexpr LawParameter parameters[];     the parameters that a user gives
///   static std::array<double, N> constants(std::span<const double> values);
///   its N constants [mostly Pa] as the only data members, each a `Real`
///   energy(grad_u)               the strain energy density ψ [J/m³ of the body at rest]
///   first_piola_stress(grad_u)   its derivative ∂ψ/∂∇u [Pa]
///   wave_stiffness(stretches)    an upper bound of ρc² over all plane waves [Pa]
///   at_rest(volume_stiffness)    its linearisation at rest
///
/// All but `constants` run on GPUs too. A law whose stress depends on the past (plasticity) has a
/// history:
///
///   struct State                 the numbers of one phyxel, each a `Real`; all zero if virgin
///   static constexpr HistoryNumber history[];       their names, in the order of the members
///   energy(grad_u, state)        the energy density that is stored [J/m³]
///   first_piola_stress(grad_u, state&, dt)          the stress [Pa] after a step of dt [s], from
///                                0, no time at all, to `endless_time`; updates `state`
///   elastic_stress(grad_u, state)                   ∂ψ/∂∇u [Pa] at a fixed history
///   plastic_work(state)          work turned into heat since the virgin state [J/m³], or
///   viscous_work(state)          the same of laws that relax
///
/// in place of `energy` and `first_piola_stress` of ∇u alone. A law may have
///
///   static constexpr bool is_linear = true;         its stiffness never changes
///   static double hourglass_modulus(std::span<const double> values);
///   the modulus [Pa] that scales hourglass control; without it, the parameter `young_modulus`
///   static constexpr bool work_is_potential = false;
///   stored energy and plastic work after a step are not a potential of the stress after it
///   static double shortest_time(std::span<const double> values);
///   the shortest time [s] in which its history follows a deformation, which steps have to resolve
///   static double longest_time(std::span<const double> values);
///   the longest time [s] in which its history follows a deformation (creep, relaxation)
///   static const char* unmet(std::span<const double> values);
///   the condition that parameters, each within its range, violate together, as the error message
///   states it, e.g. "a > 2 b"; "" if there is none
///
/// On `wave_stiffness`: a plane wave of direction b (at rest) and polarisation a has the
/// displacement gradient a bᵀ and the stiffness a bᵀ : ∂P/∂F : a bᵀ, the quadratic form of the
/// acoustic tensor, geometric stiffness included. On a lattice of phyxels the fastest mode is such
/// a wave, so the largest eigenvalue of M⁻¹K grows in proportion to the largest stiffness of all
/// waves. (The largest eigenvalue of ∂P/∂F itself does not serve: at rest it is 3λ + 2μ, of a
/// change of volume, and grows more slowly.)
#pragma once

#include <array>
#include <cstring>
#include <limits>
#include <span>
#include <type_traits>

#include "phyxel/physics/stretches.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// One parameter of a law as users give it. The entry defines the key in scenes, the keyword in
/// Python, the line on the reference page and a part of the digest.
struct LawParameter {
  const char* name;     ///< The key in scenes, e.g. "yield_stress".
  const char* unit;     ///< In SI, e.g. "Pa"; "" for a pure number.
  double low, high;     ///< The allowed range.
  bool open;            ///< True if `low` and `high` themselves are excluded.
  const char* meaning;  ///< One sentence for the reference of scenes.
  /// The value of a parameter that the user leaves out; NaN: the parameter is required.
  double fallback = std::numeric_limits<double>::quiet_NaN();
  /// A required parameter's value in measurements of speed, where E = 1e6 Pa, and in tests.
  double typical = 0;
  /// 1 for a number, 3 for a vector whose components are each within the range. `constants` takes
  /// the components one after the other. A vector uses `vector_fallback` in place of `fallback` and
  /// `typical`.
  int count = 1;
  double vector_fallback[3] = {0, 0, 0};
  /// The largest number of points of a curve [[x, y], ...]; 0: the parameter is no curve. Its x
  /// ascend from 0, which is the first, and each y is within the range. `constants` takes this
  /// number of points x, y one after the other, the last point repeated.
  int points = 0;
  bool starts_above_zero = false;         ///< True for a curve whose first x is above 0.
  const char* argument = "";              ///< What x is, in the reference, e.g. "plastic strain".
  double typical_curve[2][2] = {{0, 0}};  ///< Takes the place of `typical`.

  /// True for a curve.
  constexpr bool is_curve() const { return points > 0; }
  /// True if the user has to give it.
  constexpr bool required() const { return count == 1 && fallback != fallback; }
};

/// One number of a law's history, as named in checkpoints, frames and NumPy. Numbers of the same
/// name have the same meaning in all laws.
struct HistoryNumber {
  const char* name;  ///< E.g. "equivalent_plastic_strain".
  const char* unit;  ///< In SI; "" for a pure number.
};

/// Young's modulus, a parameter of most laws.
inline constexpr LawParameter young_modulus{
    "young", "Pa", 1e-12, 1e18, false, "Young's modulus E: rubber 1e6, jelly 1e4."};
/// Poisson's ratio, a parameter of most laws.
inline constexpr LawParameter poisson_ratio{
    "poisson", "",   -1,
    0.5,       true, "Poisson's ratio; 0.3 for most solids, near 0.5 for what keeps its volume."};
/// The material's density, a parameter of laws that heat: they take it with their own parameters,
/// but a material has it beside its law.
inline constexpr LawParameter material_density{
    "density", "kg/m^3", 0, 1e18, true, "Density, that of the material."};

/// The number of constants of a law.
template <class Law, class Real>
inline constexpr int constants_of_law = static_cast<int>(sizeof(Law) / sizeof(Real));

/// Makes a law from its constants, given in the order of its members. `Real` is the scalar of the
/// law.
template <class Law, class Real, class Constant>
PHYXEL_HD Law make_law(const Constant* constants) {
  static_assert(std::is_trivially_copyable_v<Law> && sizeof(Law) % sizeof(Real) == 0);
  Real values[constants_of_law<Law, Real>];
  for (int k = 0; k < constants_of_law<Law, Real>; ++k) values[k] = static_cast<Real>(constants[k]);
  Law law;
  memcpy(&law, values, sizeof(Law));
  return law;
}

/// True for a law whose stress needs so many registers that register pressure limits the occupancy
/// of a GPU's multiprocessor. Such a law declares `static constexpr bool many_registers = true`.
template <class Law>
inline constexpr bool needs_many_registers = [] {
  if constexpr (requires { Law::many_registers; }) return Law::many_registers;
  return false;
}();

/// The time [s] that passes from a history to a state of rest: whatever creeps or relaxes has done
/// so, nothing has a rate, and heat is gone. An interval of 0 is no time at all: nothing creeps,
/// relaxes or flows at a finite rate.
inline constexpr double endless_time = 1e30;

/// The history of a law without one: an empty type, which costs no argument, array, load or store.
struct NoHistory {};

namespace detail {
template <class Law>
struct HistoryOf {
  using type = NoHistory;
};
template <class Law>
requires requires { typename Law::State; }
struct HistoryOf<Law> {
  using type = typename Law::State;
};
}  // namespace detail

/// The history of one phyxel under a law; `NoHistory` for an elastic one.
template <class Law>
using HistoryOf = typename detail::HistoryOf<Law>::type;

/// True for a law with a history.
template <class Law>
inline constexpr bool has_history = !std::is_empty_v<HistoryOf<Law>>;

/// The number of scalars in a phyxel's history. `Real` is the scalar of the law.
template <class Law, class Real>
inline constexpr int history_numbers = has_history<Law>
                                           ? static_cast<int>(sizeof(HistoryOf<Law>) / sizeof(Real))
                                           : 0;

/// How an evaluation of stresses treats histories.
enum class HistoryUse {
  commit,  ///< The stress at the end of a step; the history is advanced to it.
  trial,   ///< The stress at the end of a step; the history is not changed.
  frozen   ///< The elastic stress ∂ψ/∂∇u at the present history, which is not changed.
};

/// First Piola stress [Pa] of a law with or without a history, at the end of a step of `dt` [s].
/// @param history at the start of the step; advanced to its end
template <class Law, class Real>
PHYXEL_HD Mat3<Real> stress_after_step(const Law& law, const Mat3<Real>& grad_u,
                                       [[maybe_unused]] HistoryOf<Law>& history,
                                       [[maybe_unused]] Real dt) {
  if constexpr (has_history<Law>) {
    return law.first_piola_stress(grad_u, history, dt);
  } else {
    return law.first_piola_stress(grad_u);
  }
}
/// The elastic stress ∂ψ/∂∇u [Pa] of a law with or without a history, at a fixed history.
template <class Law, class Real>
PHYXEL_HD Mat3<Real> elastic_stress(const Law& law, const Mat3<Real>& grad_u,
                                    [[maybe_unused]] const HistoryOf<Law>& history) {
  if constexpr (has_history<Law>) {
    return law.elastic_stress(grad_u, history);
  } else {
    return law.first_piola_stress(grad_u);
  }
}
/// The stored energy density [J/m³] of a law with or without a history.
template <class Law, class Real>
PHYXEL_HD Real stored_energy(const Law& law, const Mat3<Real>& grad_u,
                             [[maybe_unused]] const HistoryOf<Law>& history) {
  if constexpr (has_history<Law>) {
    return law.energy(grad_u, history);
  } else {
    return law.energy(grad_u);
  }
}
/// Plastic work since the virgin state [J/m³]; 0 for a law without plasticity.
template <class Real, class Law>
PHYXEL_HD Real plastic_work(const Law& law, [[maybe_unused]] const HistoryOf<Law>& history) {
  if constexpr (requires { law.plastic_work(history); }) {
    return law.plastic_work(history);
  } else {
    return Real(0);
  }
}
/// Work of viscosity since the start [J/m³]; 0 for a law without viscosity.
template <class Real, class Law>
PHYXEL_HD Real viscous_work(const Law& law, [[maybe_unused]] const HistoryOf<Law>& history) {
  if constexpr (requires { law.viscous_work(history); }) {
    return law.viscous_work(history);
  } else {
    return Real(0);
  }
}

/// Two laws that act side by side: energies, stresses and stiffnesses add. The second has no
/// history.
template <class First, class Second>
struct SumOf {
  static constexpr bool many_registers = needs_many_registers<First>;
  /// The history of the first law.
  using State = HistoryOf<First>;

  First first;
  Second second;

  /// ψ of both [J/m³].
  template <class Real>
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u) const {
    return first.energy(grad_u) + second.energy(grad_u);
  }
  /// ψ of both [J/m³], of a first law with a history.
  template <class Real>
  PHYXEL_HD Real energy(const Mat3<Real>& grad_u, const State& state) const {
    return first.energy(grad_u, state) + second.energy(grad_u);
  }
  /// P of both [Pa].
  template <class Real>
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    return first.first_piola_stress(grad_u) + second.first_piola_stress(grad_u);
  }
  /// P of both [Pa], of a first law with a history.
  template <class Real>
  PHYXEL_HD Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u, State& state, Real dt) const {
    return first.first_piola_stress(grad_u, state, dt) + second.first_piola_stress(grad_u);
  }
  /// ∂ψ/∂∇u of both [Pa] at a fixed history.
  template <class Real>
  PHYXEL_HD Mat3<Real> elastic_stress(const Mat3<Real>& grad_u, const State& state) const {
    return first.elastic_stress(grad_u, state) + second.first_piola_stress(grad_u);
  }
  /// Plastic work of the first law [J/m³].
  PHYXEL_HD auto plastic_work(const State& state) const requires requires(const First& law) {
    law.plastic_work(state);
  }
  { return first.plastic_work(state); }
  /// Heat of relaxation of the first law [J/m³].
  PHYXEL_HD auto viscous_work(const State& state) const requires requires(const First& law) {
    law.viscous_work(state);
  }
  { return first.viscous_work(state); }
  /// The linearisation of both laws at rest; the second is `VolumeConservation`.
  PHYXEL_HD auto at_rest() const { return first.at_rest(second.stiffness); }
  /// An upper bound of ρc² [Pa].
  template <class Real>
  PHYXEL_HD Real wave_stiffness(const PrincipalStretches<Real>& s) const {
    return first.wave_stiffness(s) + second.wave_stiffness(s);
  }
};

/// A list of laws, which defines the dispatch of every device. A law chosen at run time is
/// identified by its index in the list.
template <template <class> class... Law>
struct LawList {
  static constexpr int size = sizeof...(Law);
  /// The index of a law.
  template <template <class> class Wanted>
  static constexpr int index_of = [] {
    int index = 0, found = -1;
    ((found = std::is_same_v<Law<double>, Wanted<double>> ? index : found, ++index), ...);
    return found;
  }();
  /// The largest number of constants of any law.
  static constexpr int most_constants = [] {
    int most = 0;
    ((most = most < constants_of_law<Law<double>, double> ? constants_of_law<Law<double>, double>
                                                          : most),
     ...);
    return most;
  }();

  /// Calls apply(law) with the law at an index, made from `constants`.
  template <class Real, class Constant, class Apply>
  PHYXEL_HD static auto with(int index, const Constant* constants, Apply&& apply) {
    return with_from<0, Real, Law...>(index, constants, apply);
  }
  /// Calls apply(std::type_identity<Law<Real>>) with the type of the law at an index.
  template <class Real, class Apply>
  static auto with_type(int index, Apply&& apply) {
    return with_type_from<0, Real, Law...>(index, apply);
  }
  /// Calls apply(std::type_identity<Law<Real>>) for every law.
  template <class Real, class Apply>
  static void for_each(Apply&& apply) {
    (apply(std::type_identity<Law<Real>>{}), ...);
  }

 private:
  template <int first, class Real, template <class> class Here, template <class> class... Rest,
            class Constant, class Apply>
  PHYXEL_HD static auto with_from(int index, const Constant* constants, Apply& apply) {
    if constexpr (sizeof...(Rest) > 0) {
      if (index != first) return with_from<first + 1, Real, Rest...>(index, constants, apply);
    }
    return apply(make_law<Here<Real>, Real>(constants));
  }
  template <int first, class Real, template <class> class Here, template <class> class... Rest,
            class Apply>
  static auto with_type_from(int index, Apply& apply) {
    if constexpr (sizeof...(Rest) > 0) {
      if (index != first) return with_type_from<first + 1, Real, Rest...>(index, apply);
    }
    return apply(std::type_identity<Here<Real>>{});
  }
};

}  // namespace phyxel
