/// Momenta of bodies, which changes of the step keep to rounding.
#pragma once

#include <array>
#include <vector>

#include "phyxel/model.hpp"
#include "solver/step_sums.hpp"

namespace phyxel {

/// Places and velocities of the phyxels of a model.
struct MovingPlaces {
  const std::vector<Vec3d>& displacement;  ///< [m], shape [n]
  const std::vector<Vec3d>& velocity;      ///< [m/s], shape [n]
};

/// Finds the rigid motions by which the momenta of bodies differ between two states: the momentum,
/// and the angular momentum about the centre of mass. Supports take up momenta: of a body that they
/// hold, only the axes along which all of its phyxels are free count, and of one that they hold in
/// part none.
class BodyMomenta {
 public:
  /// Of a share: collective. @param model must outlive this
  explicit BodyMomenta(const Model& model);

  /// Changes velocities rigidly, body by body, so that momenta are those of an earlier state. Sums
  /// are exact: the result does not depend on threads and ranks. Of a share: collective.
  /// @param velocity [m/s], shape [n]
  void keep(const MovingPlaces& earlier, const std::vector<Vec3d>& displacement,
            std::vector<Vec3d>& velocity) const;

 private:
  /// Calls each(i, body) for the phyxels of this rank.
  template <class Each>
  void for_each(Each&& each) const;
  /// The centre of mass of each body [m], in two states.
  std::vector<std::array<Vec3d, 2>> centres(const std::vector<Vec3d>& earlier,
                                            const std::vector<Vec3d>& now) const;

  const Model& model_;
  std::vector<double> mass_;  // of each body [kg]
  std::vector<Vec3d> free_;   // of each body: 1 along axes along which all phyxels are free, else 0
};

}  // namespace phyxel
