/// Stresses of a tile's material: those of a law that a kernel is compiled for or that each tile
/// chooses, with volume conservation, viscosity and histories.
#pragma once

#include <algorithm>
#include <cstring>
#include <type_traits>

#include "phyxel/physics/laws.hpp"

namespace phyxel::cuda {

/// Number of constants in `ChosenLaw::constants`: those of any law, the stiffness of volume
/// conservation and the relaxation time of viscosity.
inline constexpr int law_numbers = Laws::most_constants + 2;

/// A law chosen at run time, per tile, among those without a history: for resident kernels that
/// serve bodies of several laws.
struct AnyLaw {};
/// A law chosen likewise among all laws, with viscosity.
struct AnyViscousLaw {
  static constexpr bool many_registers = true;
};
/// A law chosen likewise among all laws, with or without viscosity.
struct AnyLawWithHistory {
  static constexpr bool many_registers = true;
};

/// A law with volume conservation.
template <class Law, class Real>
using SolidLaw = SumOf<Law, VolumeConservation<Real>>;
/// A law with volume conservation and viscosity.
template <class Law, class Real>
using ViscousLaw = WithViscosity<SolidLaw<Law, Real>, Real>;

namespace detail {
template <class Real, class List>
struct MostHistory;
template <class Real, template <class> class... Law>
struct MostHistory<Real, LawList<Law...>> {
  static constexpr int value = std::max({history_numbers<ViscousLaw<Law<Real>, Real>, Real>...});
};
}  // namespace detail

/// The largest number of history values of a phyxel in a kernel for a law; 0 if the kernel has no
/// history.
template <class Law, class Real>
inline constexpr int kept_numbers =
    std::is_same_v<Law, AnyViscousLaw> || std::is_same_v<Law, AnyLawWithHistory>
        ? detail::MostHistory<Real, Laws>::value
        : history_numbers<Law, Real>;

/// The history of a phyxel in global memory: number k is values[k * places + place].
template <class Real>
struct HistoryColumns {
  Real* values;
  std::size_t places, place;

  template <class State>
  __device__ State load() const {
    constexpr int numbers = sizeof(State) / sizeof(Real);
    Real kept[numbers];
    for (int k = 0; k < numbers; ++k) kept[k] = values[k * places + place];
    State state;
    memcpy(static_cast<void*>(&state), kept, sizeof(State));
    return state;
  }
  template <class State>
  __device__ void store(const State& state) const {
    constexpr int numbers = sizeof(State) / sizeof(Real);
    Real kept[numbers];
    memcpy(kept, static_cast<const void*>(&state), sizeof(State));
    for (int k = 0; k < numbers; ++k) values[k * places + place] = kept[k];
  }
};

/// The history of a phyxel in registers.
template <class Real, int most>
struct HistoryRegisters {
  Real values[most]{};

  /// Loads `numbers` numbers from global memory; `put` stores them.
  __device__ void fetch(const HistoryColumns<Real>& columns, int numbers) {
#pragma unroll
    for (int k = 0; k < most; ++k) {
      if (k < numbers) values[k] = columns.values[k * columns.places + columns.place];
    }
  }
  __device__ void put(const HistoryColumns<Real>& columns, int numbers) const {
#pragma unroll
    for (int k = 0; k < most; ++k) {
      if (k < numbers) columns.values[k * columns.places + columns.place] = values[k];
    }
  }
  template <class State>
  __device__ State load() const {
    static_assert(sizeof(State) <= sizeof(values));
    State state;
    memcpy(static_cast<void*>(&state), values, sizeof(State));
    return state;
  }
  template <class State>
  __device__ void store(const State& state) {
    memcpy(values, static_cast<const void*>(&state), sizeof(State));
  }
};
template <class Real>
struct HistoryRegisters<Real, 0> {
  __device__ void fetch(const HistoryColumns<Real>&, int) {}
  __device__ void put(const HistoryColumns<Real>&, int) const {}
};

/// Returns P of a law [Pa].
/// @param history history of the phyxel, treated as `use` says
/// @param interval time from the history to the present displacements [s]
template <class Law, class Real, class History>
__device__ Mat3<Real> stress_of_law(const Law& law, const Mat3<Real>& grad_u,
                                    [[maybe_unused]] History&& history,
                                    [[maybe_unused]] HistoryUse use,
                                    [[maybe_unused]] Real interval) {
  if constexpr (has_history<Law>) {
    auto state = history.template load<HistoryOf<Law>>();
    if (use == HistoryUse::frozen) return law.elastic_stress(grad_u, state);
    const Mat3<Real> stress = law.first_piola_stress(grad_u, state, interval);
    if (use == HistoryUse::commit) history.store(state);
    return stress;
  } else {
    return law.first_piola_stress(grad_u);
  }
}

/// Returns P of a tile's material [Pa]: its law, with volume conservation and viscosity if it has
/// them.
/// @tparam Law one of `Laws`, then without viscosity, or a law chosen at run time
template <class Law, class Real, class Constants, class History>
__device__ Mat3<Real> stress_of_material(const Constants& body, const Mat3<Real>& grad_u,
                                         History&& history, HistoryUse use, Real interval) {
  const auto stress = [&](const auto& law) {
    using Own = std::decay_t<decltype(law)>;
    const VolumeConservation<Real> volume{body.law[constants_of_law<Own, Real>]};
    if constexpr (std::is_same_v<Law, AnyViscousLaw> || std::is_same_v<Law, AnyLawWithHistory>) {
      const Real time = body.law[constants_of_law<Own, Real> + 1];
      if (std::is_same_v<Law, AnyViscousLaw> || time > Real(0)) {
        return stress_of_law(ViscousLaw<Own, Real>{{law, volume}, time}, grad_u, history, use,
                             interval);
      }
    }
    if constexpr (std::is_same_v<Law, AnyViscousLaw> ||
                  (std::is_same_v<Law, AnyLaw> && has_history<Own>)) {
      return Mat3<Real>{};  // no tile has such a law
    } else {
      if (!(volume.stiffness > Real(0))) {
        return stress_of_law(law, grad_u, history, use, interval);
      }
      return stress_of_law(SolidLaw<Own, Real>{law, volume}, grad_u, history, use, interval);
    }
  };
  if constexpr (std::is_same_v<Law, AnyLaw> || std::is_same_v<Law, AnyViscousLaw> ||
                std::is_same_v<Law, AnyLawWithHistory>) {
    return Laws::with<Real>(body.law_index, body.law, stress);
  } else {
    return stress(make_law<Law, Real>(body.law));
  }
}

}  // namespace phyxel::cuda
