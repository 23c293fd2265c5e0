/// The fragments into which the bodies of a model have broken.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// A fragment of a body, which is a set of phyxels that unbroken pairs connect, or the dust of a
/// body, which is all its phyxels without an unbroken pair.
struct FragmentReading {
  std::string body;  ///< Name of the body.
  /// Rank by mass among the fragments of all bodies, from 1 for the heaviest; of fragments of equal
  /// mass the one with the smaller `first` comes first. 0: dust.
  Index number = 0;
  /// Least global id of its phyxels, by which a fragment can be followed from frame to frame.
  Index first = 0;
  Index phyxels = 0;       ///< Number of its phyxels.
  double mass = 0;         ///< [kg]
  Vec3d centre;            ///< Centre of mass [m].
  Vec3d velocity;          ///< Velocity of that centre over the last step [m/s].
  Vec3d angular_momentum;  ///< Angular momentum about that centre, likewise [kg m²/s].
  /// Angular velocity of a rigid body with this angular momentum and with the inertia of the
  /// phyxels as points [rad/s]; NaN of dust.
  Vec3d spin;

  /// True for dust.
  bool is_dust() const { return number == 0; }
};

/// Finds the fragments of all bodies at the backend's present state, by ascending numbers, and then
/// the dust of each body that has some. Returns none, at no cost, for a model without bodies that
/// break or have notches. Sums are exact: the readings have the same bits on any number of threads
/// and ranks. Collective on a share.
std::vector<FragmentReading> read_fragments(const Model& model, const Backend& backend);

/// The number of each phyxel's fragment as of `FragmentReading::number`, shape [n]; 0 for ghosts,
/// and for all phyxels of a model without bodies that break or have notches. Collective on a share.
std::vector<double> fragment_numbers(const Model& model, const Backend& backend);

/// The fragments of all bodies in a few numbers.
struct FragmentTotals {
  Index fragments = 0;       ///< Number of fragments, without dust.
  double largest_share = 0;  ///< Mass of the heaviest fragment over that of all bodies.
  Index dust = 0;            ///< Number of phyxels that are dust.
  double dust_share = 0;     ///< Mass of the dust over that of all bodies.
};
/// Sums the fragments of a scene up.
FragmentTotals totals_of(std::span<const FragmentReading> readings);

/// A number of a fragment: a column of `fragments.csv`.
struct FragmentColumn {
  const char* name;
  const char* unit;
  double (*value)(const FragmentReading&);
};
/// The numbers of a fragment, in the order of the columns.
std::span<const FragmentColumn> fragment_columns();

}  // namespace phyxel
