/// Energies, reactions, gases and contacts as Python's dicts.
#pragma once

#include <vector>

#include "arrays.hpp"
#include "files/frame_file.hpp"
#include "phyxel/contacts.hpp"
#include "phyxel/fragments.hpp"
#include "phyxel/gases.hpp"
#include "phyxel/probes.hpp"
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

/// Returns a list with a dict for each reading, which `fill(reading, dict)` fills.
template <class Reading, class Fill>
py::list listed(const std::vector<Reading>& readings, Fill&& fill) {
  py::list list;
  for (const Reading& reading : readings) {
    py::dict values;
    fill(reading, values);
    list.append(values);
  }
  return list;
}

/// Returns a dict of each reaction.
inline py::list dicts_of(const std::vector<Reaction>& reactions) {
  return listed(reactions, [](const Reaction& reaction, py::dict& values) {
    values["body"] = reaction.body;
    values["set"] = reaction.set;
    values["force"] = reaction.force;
    values["torque"] = reaction.torque;
    values["centre"] = reaction.centre;
    values["work"] = reaction.work;
  });
}

/// Returns a dict of each gas.
inline py::list dicts_of(const std::vector<GasReading>& gases) {
  return listed(gases, [](const GasReading& gas, py::dict& values) {
    values["body"] = gas.body;
    values["set"] = gas.set;
    values["pressure"] = gas.pressure;
    values["volume"] = gas.volume;
  });
}

/// Returns a dict of each obstacle.
inline py::list dicts_of(const std::vector<ContactReading>& contacts) {
  return listed(contacts, [](const ContactReading& contact, py::dict& values) {
    values["obstacle"] = contact.obstacle;
    values["force"] = contact.force;
    values["torque"] = contact.torque;
    values["impulse"] = contact.impulse;
    values["angular_impulse"] = contact.angular_impulse;
    values["work"] = contact.work;
    values["friction_heat"] = contact.friction_heat;
    values["impact_loss"] = contact.impact_loss;
    values["depth"] = contact.depth;
    values["place"] = contact.place;
  });
}

/// Returns a dict of each free rigid body.
inline py::list dicts_of(const std::vector<RigidReading>& bodies) {
  return listed(bodies, [](const RigidReading& body, py::dict& values) {
    values["obstacle"] = body.obstacle;
    values["place"] = body.place;
    values["rotation"] = body.rotation;
    values["velocity"] = body.velocity;
    values["spin"] = body.spin;
    values["kinetic_energy"] = body.kinetic_energy;
  });
}

/// Returns a dict of each fragment.
inline py::list dicts_of(const std::vector<FragmentReading>& fragments) {
  return listed(fragments, [](const FragmentReading& fragment, py::dict& values) {
    values["body"] = fragment.body;
    values["fragment"] = fragment.number;
    values["first_phyxel"] = fragment.first;
    values["phyxels"] = fragment.phyxels;
    values["mass"] = fragment.mass;
    values["centre"] = fragment.centre;
    values["velocity"] = fragment.velocity;
    values["angular_momentum"] = fragment.angular_momentum;
    values["spin"] = fragment.spin;
  });
}

/// Returns the values of readings, one row each, by their names.
inline py::dict arrays_of(const std::vector<ProbeReading>& readings) {
  std::vector<Vec3d> place, displacement, velocity;
  std::vector<double> stress, strain, von_mises;
  for (const ProbeReading& reading : readings) {
    place.push_back(reading.place);
    displacement.push_back(reading.displacement);
    velocity.push_back(reading.velocity);
    stress.insert(stress.end(), reading.stress.begin(), reading.stress.end());
    strain.insert(strain.end(), reading.strain.begin(), reading.strain.end());
    von_mises.push_back(reading.von_mises);
  }
  py::dict values;
  values["rest"] = taken(std::move(place));
  values["displacement"] = taken(std::move(displacement));
  values["velocity"] = taken(std::move(velocity));
  values["stress"] = taken(std::move(stress)).reshape({-1, 6});
  values["strain"] = taken(std::move(strain)).reshape({-1, 6});
  values["von_mises"] = taken(std::move(von_mises));
  return values;
}

/// Columns of history from a dict of arrays. @throws InputError naming what is not so
inline std::vector<HistoryColumn> history_from(const py::object& history, py::ssize_t rows) {
  if (!py::isinstance<py::dict>(history)) {
    throw InputError(fmt::format("history: {} found; allowed: a dict of arrays",
                                 py::repr(history).cast<std::string>()));
  }
  std::vector<HistoryColumn> columns;
  for (const auto& [key, values] : history.cast<py::dict>()) {
    if (!py::isinstance<py::str>(key)) {
      throw InputError(fmt::format("history: the key {} found; allowed: names of columns",
                                   py::repr(key).cast<std::string>()));
    }
    const auto name = key.cast<std::string>();
    columns.push_back({name, numbers_from(values, "history, " + name, rows)});
  }
  return columns;
}

}  // namespace phyxel::python
