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
constexpr bool work_is_potential() {
  if constexpr (requires { Law::work_is_potential; }) return Law::work_is_potential;
  return true;
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
    table.push_back({Law::name, Law::meaning, Law::parameters, is_linear<Law>(),
                     history_of_law<Law>(), work_is_potential<Law>()});
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

/// The number of values that `constants` of a law takes of a parameter.
std::size_t width_of(const LawParameter& p) {
  return static_cast<std::size_t>(p.is_curve() ? 2 * p.points : p.count);
}

/// A parameter's values as the user gave them.
std::string text_of(const LawParameter& p, std::span<const double> values) {
  if (p.is_curve()) {
    ParameterValue::Curve curve;
    for (std::size_t k = 0; k < values.size(); k += 2) {
      if (!curve.empty() && !(values[k] > curve.back()[0])) break;  // the last point, repeated
      curve.push_back({values[k], values[k + 1]});
    }
    return ParameterValue(curve).text();
  }
  if (p.count == 3) return ParameterValue(Vec3d{values[0], values[1], values[2]}).text();
  return ParameterValue(values[0]).text();
}

/// Refuses parameters that a law allows one by one, but not together (`unmet` in its file).
template <class Law>
void check_together(const std::vector<double>& values) {
  if constexpr (requires { Law::unmet(values); }) {
    const std::string needed = Law::unmet(values);
    if (needed.empty()) return;
    std::vector<std::string> found;
    for (std::size_t k = 0; const LawParameter& p : Law::parameters) {
      const std::size_t width = width_of(p);
      found.push_back(fmt::format("{} = {}", p.name, text_of(p, {values.data() + k, width})));
      k += width;
    }
    throw InputError(fmt::format("{} found, which law \"{}\" does not allow together; allowed: {}",
                                 fmt::join(found, ", "), Law::name, needed));
  }
}

/// The range of a parameter in words, e.g. "0 < density < 1e+18 [kg/m^3]".
std::string range_of(const LawParameter& p, const std::string& name) {
  const char* const less = p.open ? "<" : "<=";
  return fmt::format("{:g} {} {} {} {:g}{}{}{}", p.low, less, name, less, p.high,
                     *p.unit ? " [" : "", p.unit, *p.unit ? "]" : "");
}

/// Refuses a curve that has no points, too many, or points that do not ascend from 0 within the
/// range.
void check_curve(const LawParameter& p, const ParameterValue& value) {
  const std::string allowed =
      fmt::format("[[x, y], ...], 1 to {} points, x ({}) ascends from {}0, {}", p.points,
                  p.argument, p.starts_above_zero ? "above " : "", range_of(p, "y"));
  if (!value.is_curve()) {
    throw InputError(fmt::format("{} = {} found; allowed: {}", p.name, value.text(), allowed));
  }
  const ParameterValue::Curve curve = value.curve();
  if (curve.empty() || curve.size() > static_cast<std::size_t>(p.points)) {
    throw InputError(
        fmt::format("{}: {} points found; allowed: {}", p.name, curve.size(), allowed));
  }
  for (std::size_t k = 0; k < curve.size(); ++k) {
    const auto [x, y] = curve[k];
    const bool begins = p.starts_above_zero ? x > 0 : x == 0;
    const bool ascends = (k == 0 ? begins : x > curve[k - 1][0]) && std::isfinite(x);
    if (ascends && is_allowed(p, y)) continue;
    throw InputError(
        fmt::format("{}: point {} is [{:g}, {:g}]; allowed: {}", p.name, k + 1, x, y, allowed));
  }
}

/// Refuses a value that a parameter does not allow.
void check_value(const LawParameter& p, const ParameterValue& value) {
  if (p.is_curve()) return check_curve(p, value);
  if (value.is_curve() || value.is_vector() != (p.count == 3)) {
    throw InputError(fmt::format("{} = {} found; allowed: {}", p.name, value.text(),
                                 p.count == 3 ? "a vector [x, y, z]" : "a number"));
  }
  for (const double number : value.numbers()) {
    if (is_allowed(p, number)) continue;
    throw InputError(
        fmt::format("{} = {} found; allowed: {}", p.name, value.text(), range_of(p, p.name)));
  }
}

/// The parameters of a law in the order of its table, vectors component by component, curves point
/// by point.
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
    } else if (name == "density") {
      value = material.density;
    } else if (const auto at = material.parameters.find(name); at != material.parameters.end()) {
      value = at->second;
    } else if (parameter.required()) {
      throw InputError(fmt::format("{} is missing, which law \"{}\" needs", name, law.name));
    }
    check_value(parameter, value);
    values.insert(values.end(), value.numbers().begin(), value.numbers().end());
    const std::size_t missing = width_of(parameter) - value.numbers().size();
    for (std::size_t k = 0; k < missing; ++k) values.push_back(values[values.size() - 2]);
  }
  return values;
}

/// A time [s] of a material's law; 0 for a caller's law.
/// @param of_law called as of_law<Law>(values), where values() returns the parameters
template <class OfLaw>
double time_of_law(const Material& material, OfLaw&& of_law) {
  if (material.custom_law) return 0;
  const int index = index_of(material.law);
  const auto values = [&] { return values_of(law_table()[index], material); };
  return Laws::with_type<double>(index, [&]<class Law>(std::type_identity<Law>) {
    return of_law.template operator()<Law>(values);
  });
}

}  // namespace

ParameterValue::Curve ParameterValue::curve() const {
  Curve points;
  for (std::size_t k = 0; k < numbers_.size(); k += 2) {
    points.push_back({numbers_[k], numbers_[k + 1]});
  }
  return points;
}

std::string ParameterValue::text() const {
  if (is_vector()) return fmt::format("[{:g}]", fmt::join(numbers_, ", "));
  if (!is_curve()) return fmt::format("{:g}", number());
  std::vector<std::string> points;
  for (const auto& [x, y] : curve()) points.push_back(fmt::format("[{:g}, {:g}]", x, y));
  return fmt::format("[{}]", fmt::join(points, ", "));
}

std::span<const LawEntry> law_table() {
  static const std::vector<LawEntry> table = make_table();
  return table;
}

bool is_own_parameter(const LawParameter& parameter) {
  return parameter.name != std::string_view(young_modulus.name) &&
         parameter.name != std::string_view(poisson_ratio.name) &&
         parameter.name != std::string_view(material_density.name);
}

ParameterValue typical_value(const LawParameter& parameter, double scale) {
  if (!parameter.is_curve()) return scale * parameter.typical;
  ParameterValue::Curve curve;
  for (const auto& [x, y] : parameter.typical_curve) curve.push_back({x, scale * y});
  return curve;
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

std::string laws_with(std::string_view parameter) {
  std::string names;
  for (const LawEntry& law : law_table()) {
    if (!has_parameter(law.name, parameter)) continue;
    names += fmt::format("{}\"{}\"", names.empty() ? "" : " or ", law.name);
  }
  return names;
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

double shortest_time(const Material& material) {
  return time_of_law(material, []<class Law>(const auto& values) {
    if constexpr (requires { Law::shortest_time(values()); }) return Law::shortest_time(values());
    return 0.0;
  });
}

double longest_time(const Material& material) {
  return time_of_law(material, []<class Law>(const auto& values) {
    if constexpr (requires { Law::longest_time(values()); }) return Law::longest_time(values());
    return 0.0;
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
