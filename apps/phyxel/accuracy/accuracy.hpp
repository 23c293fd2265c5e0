/// Benchmark problems with known answers, and the errors of phyxels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::app {

/// Placement of phyxels: at the nodes of a lattice, in the middle of its cells, or on and in the
/// body's surface as in any mesh, with the number of nodes of the lattice.
enum class Filling { nodes, cells, mesh };
const char* filling_name(Filling filling);

/// The discretisation of a problem.
struct Discretisation {
  /// Of problems that name no other; at the strains of most it does not matter.
  const char* law = StVenantKirchhoff<double>::name;
  Filling filling = Filling::nodes;
  double jitter = 0;     ///< Random displacement of lattice phyxels, in spacings.
  double factor = 1.8;   ///< Support factor.
  double hourglass = 0;  ///< Strength of hourglass control.
  double closure = 0;    ///< Closure of gradients.
  int across = 6;        ///< Number of cells across the thinner sides.
};

struct Quantity {
  std::string name;
  double value = 0;
  double reference = 0;  ///< Known answer; 0 if the value itself is an error.
  double error() const { return reference == 0 ? value : value / reference - 1; }
};

struct Solution {
  Index phyxels = 0;
  double neighbours = 0;         ///< Mean number of neighbours.
  std::int64_t evaluations = 0;  ///< Number of force evaluations; steps, for moving bodies.
  double seconds = 0;            ///< Time of the solution [s].
  double setup_seconds = 0;      ///< Time of the set-up [s].
  std::vector<Quantity> found;
};

struct AccuracyCase {
  std::string name;
  std::string what;         ///< Description of the problem and the source of its answer.
  std::vector<int> across;  ///< Default resolutions.
  Solution (*solve)(const Discretisation&);
  std::vector<double> closures{0, 1e-3};  ///< Closures of gradients, likewise.
  std::vector<double> jitters{0, 0.2};    ///< Of lattices, likewise.
  std::vector<double> hourglass{0, 0.1};  ///< Strengths of hourglass control, likewise.
  /// Fillings that the case has; it is run with no others.
  std::vector<Filling> fillings{Filling::nodes, Filling::cells, Filling::mesh};
  std::string group = {};  ///< A name that chooses several cases; empty for most.
};

std::vector<AccuracyCase> static_cases();       ///< Elastic bodies at rest.
std::vector<AccuracyCase> dynamic_cases();      ///< Elastic bodies that move.
std::vector<AccuracyCase> plastic_cases();      ///< Bodies of metal in uniform states.
std::vector<AccuracyCase> collapse_cases();     ///< Bodies of metal under their collapse loads.
std::vector<AccuracyCase> impact_cases();       ///< Bars of metal that strike a wall.
std::vector<AccuracyCase> contact_impacts();    ///< Bodies that hit each other.
std::vector<AccuracyCase> contact_cylinders();  ///< Cylinders and straps in contact.
std::vector<AccuracyCase> contact_cases();      ///< Bodies in contact: the group "contact".
std::vector<AccuracyCase> fracture_cases();     ///< Bodies with cracks: the group "fracture".
std::vector<AccuracyCase> accuracy_cases();     ///< All of them.

}  // namespace phyxel::app
