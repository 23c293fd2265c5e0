/// Material of a body and how its volume shares are found.
#pragma once

#include <memory>
#include <optional>
#include <string>

namespace phyxel {

/// Strain measure. `green` (equation 2 of Farias et al. 2008) is exact under rotation; `cauchy`
/// (equation 3) is its linearisation, cheaper and only right for small rotations.
enum class Strain { green, cauchy };

/// How stress follows from strain. `hooke`: in proportion, which softens where a body is pressed to
/// half its size and no longer resists beyond. `neo_hooke` (Smith, de Goes and Kim 2018) resists
/// until it is turned inside out, and still then. `corotated` measures strain after taking the
/// nearest rotation away: in proportion to stretch, however large, and inside out, too. All are the
/// same at small strains.
enum class Law { hooke, neo_hooke, corotated };

/// Strain and law in one.
enum class Elasticity { green_hooke, cauchy_hooke, neo_hooke, corotated };

class CustomLaw;

/// Isotropic elastic material.
struct Material {
  double young = 0;               ///< Young's modulus E [Pa], > 0.
  double poisson = 0;             ///< Poisson's ratio, -1 < nu < 0.5.
  double density = 0;             ///< [kg/m^3], > 0.
  Strain strain = Strain::green;  ///< Of Hooke's law.
  Law law = Law::hooke;
  double volume_stiffness =
      0;               ///< Volume conservation k_v [Pa] of Mueller et al. 2004; 0: no such term.
  double damping = 0;  ///< Mass-proportional damping [1/s]; 0: none.
  /// Strength α of hourglass control, in shares of the smallest E of the body; 0: none. Needs one
  /// support for the body. Unset: `default_hourglass`, in scene files and in code alike; the parts
  /// of a model have it set.
  std::optional<double> hourglass = std::nullopt;
  /// A law of the caller's own, in place of `law` and `strain`, on the CPU (phyxel/custom_law.hpp);
  /// null: none. `young` and `poisson` are then its own at small strains: speeds of waves and
  /// hourglass control follow from them.
  std::shared_ptr<const CustomLaw> custom_law = nullptr;

  /// Of `law` and `strain`.
  Elasticity elasticity() const {
    if (law == Law::neo_hooke) return Elasticity::neo_hooke;
    if (law == Law::corotated) return Elasticity::corotated;
    return strain == Strain::green ? Elasticity::green_hooke : Elasticity::cauchy_hooke;
  }
  /// Lamé's first parameter [Pa].
  double lame_lambda() const { return young * poisson / ((1 + poisson) * (1 - 2 * poisson)); }
  /// Shear modulus [Pa], Lamé's second parameter.
  double lame_mu() const { return young / (2 * (1 + poisson)); }
  bool operator==(const Material&) const = default;
};

/// Where phyxel volumes come from. `kernel`: the rule of Mueller et al. 2004, mass over kernel
/// density. `geometry`: the volumes the cloud carries. `automatic`: geometry if there is one.
enum class VolumeRule { automatic, geometry, kernel };

}  // namespace phyxel
