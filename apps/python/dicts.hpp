/// Energies and reactions as Python's dicts.
#pragma once

#include <vector>

#include "arrays.hpp"
#include "files/frame_file.hpp"
#include "phyxel/state.hpp"

namespace phyxel::python {

/// Returns energies, momenta and the other columns of energy.csv by their names.
inline py::dict energies_of(const Diagnostics& now) {
  py::dict values;
  values["step"] = now.step;
  for (const DiagnosticColumn& column : diagnostic_columns()) {
    values[column.name] = column.value(now);
  }
  values["elastic_energy"] = now.elastic_energy();
  values["momentum"] = now.momentum;
  values["angular_momentum"] = now.angular_momentum;
  return values;
}

/// Returns a dict of each reaction.
inline py::list dicts_of(const std::vector<Reaction>& reactions) {
  py::list list;
  for (const Reaction& reaction : reactions) {
    py::dict values;
    values["body"] = reaction.body;
    values["set"] = reaction.set;
    values["force"] = reaction.force;
    values["torque"] = reaction.torque;
    values["centre"] = reaction.centre;
    values["work"] = reaction.work;
    list.append(values);
  }
  return list;
}

}  // namespace phyxel::python
