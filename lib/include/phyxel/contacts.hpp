/// Forces and work of obstacles, and of bodies on each other.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/solver.hpp"

namespace phyxel {

/// What an obstacle does to the bodies, or all other bodies to one, now and since t = 0.
struct ContactReading {
  std::string obstacle;      ///< Its name, or that of the body.
  std::string shape;         ///< The name of its shape, e.g. "plane".
  Vec3d force, torque;       ///< On the bodies [N], and about `place` [N m], over the next step.
  Vec3d impulse;             ///< On the bodies since t = 0 [N s].
  Vec3d angular_impulse;     ///< The same about `place` [N m s].
  double work = 0;           ///< Of the obstacle on the bodies since t = 0 [J].
  double friction_heat = 0;  ///< What friction has turned into heat since t = 0 [J].
  double impact_loss = 0;    ///< What surface points have lost in impacts since t = 0 [J].
  double depth = 0;          ///< Of the phyxel of a surface that is deepest inside, now [m].
  /// The largest depth over the phyxel's support, now, or over the smaller support of both bodies.
  double depth_share = 0;
  Vec3d place;  ///< The obstacle's place at rest [m].
};

/// Where a free rigid body is and how it moves, at the time of the solver.
struct RigidReading {
  std::string obstacle;       ///< Its name.
  std::string shape;          ///< The name of its shape, e.g. "sphere".
  Vec3d place;                ///< Of its centre of mass [m].
  Vec3d rotation;             ///< From its position at rest: axis times angle, at most π [rad].
  Vec3d velocity;             ///< Of its centre of mass [m/s].
  Vec3d spin;                 ///< Angular velocity [rad/s].
  double kinetic_energy = 0;  ///< [J]
};

/// The free rigid bodies of a model, in the order of its obstacles; none, at no cost, for a model
/// without any.
std::vector<RigidReading> read_rigid_bodies(const Model& model, const Backend& backend,
                                            const Solver& solver);

/// The depth of a phyxel in another body beyond which contact may lead it out on the wrong side, as
/// of `ContactReading::depth_share`: a distance between phyxels. Surfaces of bodies are looked at
/// from half of that inside.
inline constexpr double trusted_share_in_bodies = 0.45;

/// A number of such a reading: a column of `rigid.csv`.
struct RigidColumn {
  const char* name;
  const char* unit;
  double (*value)(const RigidReading&);
};
/// The numbers of such a reading, in the order of the columns.
std::span<const RigidColumn> rigid_columns();

/// The name of an obstacle's shape in scenes.
const char* shape_name(const Obstacle& obstacle);

/// What each obstacle of a model does, in their order; none, at no cost, for a model without
/// obstacles. Forces are those of the step of Verlet's method from the solver's present state,
/// found from one evaluation of the forces, without taking it. Sums are exact: they do not depend
/// on the number of threads and ranks. Of a share: those of the whole model; collective, for a
/// solver that was made with the model.
/// @throws DivergedError if a phyxel is deeper in an obstacle than a quarter of its support, or in
/// another body than the smaller support of both bodies
std::vector<ContactReading> find_contacts(const Model& model, Backend& backend,
                                          const Solver& solver);

/// Refuses speeds at which bodies and obstacles might pass through each other in a step: pairs that
/// move against each other by more than half of the obstacle's inner radius, or of the smallest
/// support of the phyxels by which the pair touches. Of a share: collective.
/// @param largest_speed of the phyxels of all ranks [m/s]
/// @param speeds_of_bodies returns the largest speed of each body's phyxels [m/s], of all ranks;
/// not called where no pair can be too fast
/// @param rigid states of the free bodies
/// @throws DivergedError naming the pair, its speeds, and the largest step allowed; or the free
/// body whose state is not finite
void check_contact_speeds(const Model& model, const Solver& solver, double largest_speed,
                          const std::function<std::vector<double>()>& speeds_of_bodies,
                          std::span<const RigidState> rigid);

/// A number of a reading: a column of `contacts.csv`.
struct ContactColumn {
  const char* name;
  const char* unit;
  double (*value)(const ContactReading&);
};
/// The numbers of a reading, in the order of the columns.
std::span<const ContactColumn> contact_columns();

}  // namespace phyxel
