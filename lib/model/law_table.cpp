#include "phyxel/law_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "phyxel/custom_law.hpp"
#include "phyxel/error.hpp"

namespace phyxel {
namespace {

template <class Law>
constexpr bool is_linear() {
  if constexpr (requires { Law::is_linear; }) return Law::is_linear;
  return false;
}

template <class Law>
constexpr bool has_young() {
  for (const LawParameter& p : Law::parameters) {
    if (std::string_view(p.name) == young_modulus.name) return true;
  }
  return false;
}

template <class Law>
constexpr std::span<const HistoryNumber> history_of_law() {
  if constexpr (has_history<Law>) {
    static_assert(std::size(Law::history) == history_numbers<Law, double>);
    return Law::history;
  } else {
    return {};
  }
}

std::vector<LawEntry> make_table() {
  std::vector<LawEntry> table;
  Laws::for_each<double>([&]<class Law>(std::type_identity<Law>) {
    table.push_back(
        {Law::name, Law::meaning, Law::parameters, is_linear<Law>(), history_of_law<Law>()});
  });
  return table;
}

int index_of(std::string name) {
  if (name.empty()) name = usual_law;
  const std::span<const LawEntry> table = law_table();
  const auto at =
      std::find_if(table.begin(), table.end(), [&](const LawEntry& e) { return name == e.name; });
  if (at != table.end()) return static_cast<int>(at - table.begin());
  std::vector<std::string> names;
  for (const LawEntry& entry : table) names.emplace_back(entry.name);
  throw InputError(fmt::format("law \"{}\" found{}; allowed: {}", name, did_you_mean(name, names),
                               fmt::join(names, ", ")));
}

bool is_allowed(const LawParameter& parameter, double value) {
  return parameter.open ? parameter.low < value && value < parameter.high
                        : parameter.low <= value && value <= parameter.high;
}

/// Refuses parameters that a law allows one by one, but not together (`unmet` in its file).
template <class Law>
void check_together(const std::vector<double>& values) {
  if constexpr (requires { Law::unmet(values); }) {
    const std::string needed = Law::unmet(values);
    if (needed.empty()) return;
    std::vector<std::string> found;
    for (std::size_t k = 0; const LawParameter& p : Law::parameters) {
      found.push_back(fmt::format(
          "{} = {}", p.name,
          p.count == 1 ? ParameterValue(values[k]).text()
                       : ParameterValue(Vec3d{values[k], values[k + 1], values[k + 2]}).text()));
      k += static_cast<std::size_t>(p.count);
    }
    throw InputError(fmt::format("{} found, which law \"{}\" does not allow together; allowed: {}",
                                 fmt::join(found, ", "), Law::name, needed));
  }
}

/// The parameters of a law in the order of its table, vectors component by component.
std::vector<double> values_of(const LawEntry& law, const Material& material) {
  std::vector<double> values;
  for (const auto& [name, value] : material.parameters) {
    const auto is_it = [&name = name](const LawParameter& p) { return name == p.name; };
    if (std::none_of(law.parameters.begin(), law.parameters.end(), is_it)) {
      std::vector<std::string> names;
      for (const LawParameter& p : law.parameters) names.emplace_back(p.name);
      throw InputError(fmt::format("{} = {} found, which law \"{}\" does not have; allowed: {}",
                                   name, value.text(), law.name, fmt::join(names, ", ")));
    }
  }
  for (const LawParameter& parameter : law.parameters) {
    const std::string name = parameter.name;
    ParameterValue value = parameter.fallback;
    if (parameter.count == 3) {
      const double* v = parameter.vector_fallback;
      value = Vec3d{v[0], v[1], v[2]};
    }
    if (name == "young") {
      value = material.young;
    } else if (name == "poisson") {
      value = material.poisson;
    } else if (const auto at = material.parameters.find(name); at != material.parameters.end()) {
      value = at->second;
    } else if (parameter.required()) {
      throw InputError(fmt::format("{} is missing, which law \"{}\" needs", name, law.name));
    }
    if (value.is_vector() != (parameter.count == 3)) {
      throw InputError(fmt::format("{} = {} found; allowed: {}", name, value.text(),
                                   parameter.count == 3 ? "a vector [x, y, z]" : "a number"));
    }
    for (const double number : value.numbers()) {
      if (is_allowed(parameter, number)) continue;
      const char* const less = parameter.open ? "<" : "<=";
      throw InputError(fmt::format("{} = {} found; allowed: {:g} {} {} {} {:g}{}{}{}", name,
                                   value.text(), parameter.low, less, name, less, parameter.high,
                                   *parameter.unit ? " [" : "", parameter.unit,
                                   *parameter.unit ? "]" : ""));
    }
    values.insert(values.end(), value.numbers().begin(), value.numbers().end());
  }
  return values;
}

}  // namespace

std::string ParameterValue::text() const {
  return is_vector() ? fmt::format("[{:g}, {:g}, {:g}]", numbers_[0], numbers_[1], numbers_[2])
                     : fmt::format("{:g}", numbers_[0]);
}

std::span<const LawEntry> law_table() {
  static const std::vector<LawEntry> table = make_table();
  return table;
}

bool is_own_parameter(const LawParameter& parameter) {
  return parameter.name != std::string_view(young_modulus.name) &&
         parameter.name != std::string_view(poisson_ratio.name);
}

bool has_parameter(std::string_view law, std::string_view parameter) {
  if (law.empty()) law = usual_law;
  for (const LawEntry& entry : law_table()) {
    if (law != entry.name) continue;
    for (const LawParameter& p : entry.parameters) {
      if (parameter == p.name) return true;
    }
  }
  return false;
}

ChosenLaw chosen_law(const Material& material) {
  ChosenLaw chosen;
  chosen.index = index_of(material.law);
  const std::vector<double> values = values_of(law_table()[chosen.index], material);
  Laws::with_type<double>(chosen.index, [&]<class Law>(std::type_identity<Law>) {
    check_together<Law>(values);
    const auto constants = Law::constants(values);
    static_assert(std::tuple_size_v<decltype(constants)> == constants_of_law<Law, double>);
    std::copy(constants.begin(), constants.end(), chosen.constants.begin());
    chosen.constants[constants.size()] = material.volume_stiffness;
    chosen.constants[constants.size() + 1] = material.viscosity;
  });
  return chosen;
}

std::vector<std::string> history_names(const Material& material) {
  std::vector<std::string> names;
  if (material.custom_law) {
    names = material.custom_law->history();
  } else {
    for (const HistoryNumber& n : law_table()[index_of(material.law)].history) {
      names.emplace_back(n.name);
    }
  }
  if (material.viscosity > 0) {
    for (const HistoryNumber& n : WithViscosity<SmallStrain<double>, double>::history) {
      names.emplace_back(n.name);
    }
  }
  return names;
}

double hourglass_modulus(const Material& material) {
  if (material.custom_law) return material.young;
  const int index = index_of(material.law);
  return Laws::with_type<double>(index, [&]<class Law>(std::type_identity<Law>) {
    if constexpr (requires(std::vector<double> v) { Law::hourglass_modulus(v); }) {
      return Law::hourglass_modulus(values_of(law_table()[index], material));
    } else {
      static_assert(has_young<Law>(), "a law without young_modulus needs hourglass_modulus");
      return material.young;
    }
  });
}

double wave_stiffness_at_rest(const Material& material) {
  if (material.custom_law) {
    return lame_lambda(material.young, material.poisson) +
           2 * lame_mu(material.young, material.poisson) + material.volume_stiffness;
  }
  const ChosenLaw law = chosen_law(material);
  return material.volume_stiffness +
         Laws::with<double>(law.index, law.constants.data(), [](const auto& elastic) {
           return elastic.wave_stiffness(PrincipalStretches<double>{1, 1, 1});
         });
}

}  // namespace phyxel
