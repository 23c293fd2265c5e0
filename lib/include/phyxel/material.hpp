/// Material of a body and how its volume shares are found.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "phyxel/physics/hooke.hpp"

namespace phyxel {

class CustomLaw;

/// The material of a body: a law, its parameters, and terms beside it.
struct Material {
  double young = 0;    ///< Young's modulus E [Pa], > 0, of laws that have one.
  double poisson = 0;  ///< Poisson's ratio, -1 < nu < 0.5, of laws that have one.
  double density = 0;  ///< [kg/m^3], > 0.
  /// The name of the law, one of `law_table()` (phyxel/law_table.hpp).
  std::string law = "st-venant-kirchhoff";
  /// The law's other parameters by name, in SI. `validate` refuses names that the law does not
  /// have.
  std::map<std::string, double> parameters = {};
  /// Stiffness k_v [Pa] of volume conservation (Mueller et al. 2004); 0: no such term.
  double volume_stiffness = 0;
  double damping = 0;    ///< Mass-proportional damping [1/s]; 0: none.
  double viscosity = 0;  ///< Relaxation time τ of Kelvin–Voigt damping [s]; 0: none.
  /// Strength α of hourglass control, in shares of the smallest E of the body; 0: none. Needs one
  /// support for the body. Unset: `default_hourglass`, in scene files and in code alike; the parts
  /// of a model have it set.
  std::optional<double> hourglass = std::nullopt;
  /// A law of the caller's own in place of `law`, on the CPU (phyxel/custom_law.hpp); null: none.
  /// `young` and `poisson` are then its own at small strains: speeds of waves and hourglass control
  /// follow from them.
  std::shared_ptr<const CustomLaw> custom_law = nullptr;

  /// Lamé's first parameter [Pa] of `young` and `poisson`.
  double lame_lambda() const { return phyxel::lame_lambda(young, poisson); }
  /// The shear modulus [Pa] of `young` and `poisson`, Lamé's second parameter.
  double lame_mu() const { return phyxel::lame_mu(young, poisson); }
  bool operator==(const Material&) const = default;
};

/// Where phyxel volumes come from. `kernel`: the rule of Mueller et al. 2004, mass over kernel
/// density. `geometry`: the volumes the cloud carries. `automatic`: geometry if there is one.
enum class VolumeRule { automatic, geometry, kernel };

}  // namespace phyxel
