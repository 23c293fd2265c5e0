/// Pressures and volumes of gases in cavities.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/solver.hpp"

namespace phyxel {

/// The state of a gas in a cavity, or in the cavities around which one traction acts.
struct GasReading {
  std::string body;     ///< Name of the body around the cavity.
  std::string set;      ///< Entry of that body in the scene, e.g. "traction 1".
  double pressure = 0;  ///< [Pa]
  double volume = 0;    ///< Of the cavity [m³].
};

/// True if a load of the model is the pressure of a gas.
bool has_gas(const Model& model);

/// Returns the state of each gas at the solver's present state, in the order of the loads; none, at
/// no cost, for a model without a gas. Volumes are exact sums: they do not depend on the number of
/// threads and ranks. Collective on a share.
std::vector<GasReading> read_gases(const Model& model, const Backend& backend,
                                   const Solver& solver);

/// A number of a gas: a column of `gas.csv`.
struct GasColumn {
  const char* name;
  const char* unit;
  double (*value)(const GasReading&);
};
/// The numbers of a gas, in the order of the columns.
std::span<const GasColumn> gas_columns();

}  // namespace phyxel
