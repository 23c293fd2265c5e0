/// Materials of every law, and a caller's law with known results.
#pragma once

#include <algorithm>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "phyxel/custom_law.hpp"
#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/material.hpp"
#include "support/clouds.hpp"

namespace phyxel::testing {

/// `rubber` with any law. Parameters other than E and ν are a tenth of their `typical` values where
/// these are in Pa, since E of rubber is a tenth of the E that those belong to.
inline Material rubber_of(const std::string& law) {
  Material material = rubber();
  material.law = law;
  for (const LawEntry& entry : law_table()) {
    if (law != entry.name) continue;
    for (const LawParameter& p : entry.parameters) {
      if (!p.required() || !is_own_parameter(p)) continue;
      const bool is_modulus = p.unit == std::string("Pa");
      material.parameters[p.name] = typical_value(p, is_modulus ? 0.1 : 1);
    }
  }
  return material;
}

/// True if the law of a part of a model relaxes: its heat is viscous work, too.
inline bool relaxes(const Model& model) {
  return std::any_of(model.parts.begin(), model.parts.end(),
                     [](const Part& part) { return part.material.law == Maxwell<double>::name; });
}

/// A law of the list with the parameters of a material.
template <class Law>
Law law_of(Material material) {
  material.law = Law::name;
  using Real = std::remove_cvref_t<decltype(Law{}.wave_stiffness({1, 1, 1}))>;
  return make_law<Law, Real>(chosen_law(material).constants.data());
}

/// Adapter of any law to the interface of an elastic law, by the elastic response of its virgin
/// material.
template <class Law>
struct Virgin {
  Law law;
  template <class Real>
  Mat3<Real> first_piola_stress(const Mat3<Real>& grad_u) const {
    return elastic_stress(law, grad_u, HistoryOf<Law>{});
  }
  template <class Real>
  Real energy(const Mat3<Real>& grad_u) const {
    return stored_energy(law, grad_u, HistoryOf<Law>{});
  }
};

/// Returns the message with which a material is refused; "" if it is accepted.
inline std::string law_refusal(const Material& material) {
  try {
    chosen_law(material);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

/// The library's neo-Hookean law as a caller's law, with its stiffness multiplied by a factor.
class Repeated final : public CustomLaw {
 public:
  explicit Repeated(const Material& m, double factor = 1)
      : law_{{m.lame_lambda(), m.lame_mu()}}, factor_(factor) {}
  std::string name() const override { return "repeated " + std::to_string(factor_); }
  double energy(const Mat3d& grad_u) const override { return factor_ * law_.energy(grad_u); }
  Mat3d first_piola_stress(const Mat3d& grad_u) const override {
    return factor_ * law_.first_piola_stress(grad_u);
  }

 private:
  NeoHookean<double> law_;
  double factor_;
};

/// The library's J2 plasticity as a caller's law, with its history.
class Borrowed final : public CustomLaw {
 public:
  explicit Borrowed(const Material& m) : law_(law_of<J2<double>>(m)) {}
  std::string name() const override { return "borrowed"; }
  double energy(const Mat3d& g) const override { return law_.energy(g, {}); }
  Mat3d first_piola_stress(const Mat3d& g) const override { return law_.elastic_stress(g, {}); }
  std::vector<std::string> history() const override {
    Material j2;
    j2.law = "j2";
    return history_names(j2);
  }
  double energy(const Mat3d& g, std::span<const double> numbers) const override {
    return law_.energy(g, state_of(numbers));
  }
  Mat3d first_piola_stress(const Mat3d& g, std::span<double> numbers, double dt) const override {
    J2<double>::State state = state_of(numbers);
    const Mat3d p = law_.first_piola_stress(g, state, dt);
    std::memcpy(numbers.data(), &state, sizeof(state));
    return p;
  }
  Mat3d elastic_stress(const Mat3d& g, std::span<const double> numbers) const override {
    return law_.elastic_stress(g, state_of(numbers));
  }
  double plastic_work(std::span<const double> numbers) const override {
    return law_.plastic_work(state_of(numbers));
  }

 private:
  static J2<double>::State state_of(std::span<const double> numbers) {
    J2<double>::State state;
    std::memcpy(static_cast<void*>(&state), numbers.data(), sizeof(state));
    return state;
  }
  J2<double> law_;
};

}  // namespace phyxel::testing
