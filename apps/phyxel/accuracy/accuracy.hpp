/// Problems with known answers, and how far from them phyxels come.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/scene.hpp"

namespace phyxel::app {

/// Where phyxels lie: at the nodes of a lattice or in the middle of its cells; or spread on and in
/// the body's surface as in any mesh, as many as there would be nodes.
enum class Filling { nodes, cells, mesh };
const char* filling_name(Filling filling);

/// What a problem is solved with.
struct Discretisation {
  /// Of problems that name no other; at the strains of most it does not matter.
  const char* law = StVenantKirchhoff<double>::name;
  Filling filling = Filling::nodes;
  double jitter = 0;     ///< Of a lattice, in spacings.
  double factor = 1.8;   ///< Of the support.
  double hourglass = 0;  ///< Strength of hourglass control.
  double closure = 0;    ///< Of gradients.
  int across = 6;        ///< Cells across the thinner sides.
};

struct Quantity {
  std::string name;
  double value = 0;
  double reference = 0;  ///< 0: the value is an error itself.
  double error() const { return reference == 0 ? value : value / reference - 1; }
};

struct Solution {
  Index phyxels = 0;
  double neighbours = 0;         ///< Mean.
  std::int64_t evaluations = 0;  ///< Of all phyxels' forces: steps, of bodies that move.
  double seconds = 0;            ///< That they and what belongs to them took.
  double setup_seconds = 0;      ///< From the scene to the first of them.
  std::vector<Quantity> found;
};

struct AccuracyCase {
  std::string name;
  std::string what;         ///< The problem and where its answer comes from, in a sentence or two.
  std::vector<int> across;  ///< Resolutions that it is run with if none are asked for.
  Solution (*solve)(const Discretisation&);
  std::vector<double> closures{0, 1e-3};  ///< Closures of gradients, likewise.
};

/// Bodies at rest, and bodies that move.
std::vector<AccuracyCase> static_cases();
std::vector<AccuracyCase> dynamic_cases();
std::vector<AccuracyCase> accuracy_cases();  ///< All of them.

}  // namespace phyxel::app
