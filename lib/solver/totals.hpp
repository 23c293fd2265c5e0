/// The sums behind `Diagnostics`. They are exact: the result has the same bits for any order of
/// phyxels and any number of threads and ranks.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "exact_sum.hpp"
#include "phyxel/communicator.hpp"
#include "phyxel/diagnostics.hpp"
#include "solver/phyxel_totals.hpp"

namespace phyxel {

/// Sums and extremes over phyxels, which are identified by global ids.
struct Totals {
  ExactSum kinetic_energy, strain_energy, volume_energy, hourglass_energy, plastic_work,
      viscous_work;
  ExactSum gravity_energy, load_energy;
  ExactSum force_scale, torque_scale;
  ExactVector momentum, angular_momentum, internal_force, internal_torque;
  std::int64_t inverted = 0;
  double largest_displacement = 0, largest_speed = 0;
  Index fastest = -1, first_bad = std::numeric_limits<Index>::max();

  template <class Each>
  void for_each_sum(Each&& each) {
    each(kinetic_energy), each(strain_energy), each(volume_energy), each(hourglass_energy);
    each(plastic_work), each(viscous_work);
    each(gravity_energy), each(load_energy), each(force_scale), each(torque_scale);
    for (ExactVector* v : {&momentum, &angular_momentum, &internal_force, &internal_torque}) {
      each(v->x), each(v->y), each(v->z);
    }
  }
  /// Updates the fastest phyxel; ties go to the smaller id.
  void look_at_speed(double speed, Index phyxel) {
    if (speed > largest_speed || (speed == largest_speed && fastest >= 0 && phyxel < fastest)) {
      largest_speed = speed;
      fastest = phyxel;
    }
  }
  /// Adds one phyxel. @param id its global id
  void add(const PhyxelTotals& phyxel, Index id) {
    const double* term = phyxel.sum;
    for_each_sum([&](ExactSum& sum) { sum.add(*term++); });
    inverted += phyxel.inverted;
    if (!phyxel.finite) first_bad = std::min(first_bad, id);
    largest_displacement = std::max(largest_displacement, phyxel.displacement);
    look_at_speed(phyxel.speed, id);
  }
  void add(Totals other) {
    std::vector<ExactSum*> own;
    for_each_sum([&](ExactSum& sum) { own.push_back(&sum); });
    std::size_t k = 0;
    other.for_each_sum([&](const ExactSum& sum) { own[k++]->add(sum); });
    inverted += other.inverted;
    largest_displacement = std::max(largest_displacement, other.largest_displacement);
    if (other.fastest >= 0) look_at_speed(other.largest_speed, other.fastest);
    first_bad = std::min(first_bad, other.first_bad);
  }
  void add_ranks(const Communicator& ranks) {
    std::vector<std::int64_t> words{inverted};
    for_each_sum([&](ExactSum& sum) {
      const auto ready = sum.ready();
      words.insert(words.end(), ready.begin(), ready.end());
    });
    ranks.add(words);
    auto from = words.begin();
    inverted = *from++;
    for_each_sum([&](ExactSum& sum) {
      for (std::int64_t& word : sum.ready()) word = *from++;
    });
    largest_displacement = ranks.largest(largest_displacement);
    const double fastest_of_all = ranks.largest(largest_speed);
    const double nobody = std::numeric_limits<double>::infinity();
    const double who = ranks.smallest(
        largest_speed == fastest_of_all && fastest >= 0 ? static_cast<double>(fastest) : nobody);
    largest_speed = fastest_of_all;
    fastest = who < nobody ? static_cast<Index>(who) : -1;
    first_bad = static_cast<Index>(ranks.smallest(static_cast<double>(first_bad)));
  }
  Diagnostics values() const {
    Diagnostics d;
    d.kinetic_energy = kinetic_energy.value();
    d.strain_energy = strain_energy.value();
    d.volume_energy = volume_energy.value();
    d.hourglass_energy = hourglass_energy.value();
    d.plastic_work = plastic_work.value();
    d.viscous_work = viscous_work.value();
    d.gravity_energy = gravity_energy.value();
    d.load_energy = load_energy.value();
    d.momentum = momentum.value();
    d.angular_momentum = angular_momentum.value();
    d.internal_force = internal_force.value();
    d.internal_torque = internal_torque.value();
    d.force_scale = force_scale.value();
    d.torque_scale = torque_scale.value();
    d.inverted = static_cast<Index>(inverted);
    d.largest_displacement = largest_displacement;
    d.largest_speed = largest_speed;
    d.fastest_phyxel = fastest;
    d.bad_phyxel = first_bad < std::numeric_limits<Index>::max() ? first_bad : -1;
    return d;
  }
};

}  // namespace phyxel
