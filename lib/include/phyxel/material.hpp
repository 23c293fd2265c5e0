/// Material of a body and how its volume shares are found.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/physics/hooke.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

class CustomLaw;

/// The value of a law's parameter: a number, the three of a vector, or the points of a curve.
class ParameterValue {
 public:
  /// The points [x, y] of a curve.
  using Curve = std::vector<std::array<double, 2>>;

  ParameterValue() : ParameterValue(0.0) {}
  /// A number converts to a value.
  ParameterValue(double number) : numbers_{number} {}  // NOLINT: implicit on purpose
  /// A vector converts to a value.
  ParameterValue(Vec3d vector)
      : numbers_{vector.x, vector.y, vector.z}, kind_(Kind::vector) {}  // NOLINT: likewise
  /// A curve converts to a value.
  ParameterValue(const Curve& curve) : numbers_(), kind_(Kind::curve) {  // NOLINT: likewise
    for (const auto& point : curve) numbers_.insert(numbers_.end(), point.begin(), point.end());
  }

  /// Its numbers, shape [1], [3] or [2 points], point by point.
  std::span<const double> numbers() const { return numbers_; }
  /// The number, of a parameter that is one; of a vector its first component.
  double number() const { return numbers_.empty() ? 0 : numbers_[0]; }
  /// The vector, of a parameter that is one.
  Vec3d vector() const { return {numbers_[0], numbers_[1], numbers_[2]}; }
  /// The curve, of a parameter that is one.
  Curve curve() const;
  /// The value has three numbers.
  bool is_vector() const { return kind_ == Kind::vector; }
  /// The value is a curve.
  bool is_curve() const { return kind_ == Kind::curve; }
  /// "0.3", "[1, 0, 0]" or "[[0, 1], [2, 3]]".
  std::string text() const;
  bool operator==(const ParameterValue&) const = default;

 private:
  enum class Kind { number, vector, curve };
  std::vector<double> numbers_;
  Kind kind_ = Kind::number;
};

/// The material of a body: a law, its parameters, and terms beside it.
struct Material {
  double young = 0;    ///< Young's modulus E [Pa], > 0, of laws that have one.
  double poisson = 0;  ///< Poisson's ratio, -1 < nu < 0.5, of laws that have one.
  double density = 0;  ///< [kg/m^3], > 0.
  /// The name of the law, one of `law_table()` (phyxel/law_table.hpp). Empty: `default_law`, in
  /// scene files and in code alike; the parts of a model have it set.
  std::string law = {};
  /// The law's other parameters by name, in SI. `validate` refuses names that the law does not
  /// have.
  std::map<std::string, ParameterValue> parameters = {};
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
