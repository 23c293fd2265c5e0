#include "solver/contact_stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "model/parts.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/physics/contact_penalty.hpp"

namespace phyxel {
namespace {

/// The square of the largest frequency of springs of obstacles [1/s²], on this rank.
double squared_frequency_of_obstacles(const Model& model) {
  double largest = 0;
  for (const Obstacle& obstacle : model.obstacles) largest = std::max(largest, obstacle.penalty);
  if (!(largest > 0)) return 0;
  // Two that are beside each other may push alike.
  const double count = model.obstacles.size() > 1 ? 2 : 1;
  const std::vector<double> stiffness = stiffness_of_layer(model, share_of_layer * largest);
  double square = 0;
  for (std::size_t k = 0; k < stiffness.size(); ++k) {
    square = std::max(square, count * stiffness[k] / model.mass[model.contact.phyxels[k]]);
  }
  return square;
}

/// The square of the largest frequency of springs between bodies [1/s²]. Of a share: collective.
///
/// A spring pushes its point with 1 and the phyxels that carry it with shares r, whose sizes add up
/// to little more than 1. So does the stiffness that a phyxel carries for the points of another
/// surface, against a point of its own area there. By Gershgorin's theorem
///
///   ω² < (1 + κ) share M/(ρ h) (1/h + κ/h'),
///
/// with the supports h of the phyxel and h' of these points, and κ for a little more than 1.
double squared_frequency_of_bodies(const Model& model) {
  if (!has_body_penalties(model)) return 0;
  constexpr double kappa = 1.5;
  std::map<std::pair<double, double>, double> support;  // the smallest, by modulus and density
  for (const Part& part : model.parts) {
    const auto kind = std::pair(wave_stiffness_at_rest(part.material), part.material.density);
    support.try_emplace(kind, HUGE_VAL);
  }
  for (const Index i : model.body_contact.layer.phyxels) {
    const Material& material = part_of(model, i).material;
    double& least = support[{wave_stiffness_at_rest(material), material.density}];
    least = std::min(least, model.neighbourhood.support[i]);
  }
  if (model.share) {
    for (auto& [kind, least] : support) least = model.share->communicator->smallest(least);
  }
  double square = 0;
  for (const auto& [kind, h] : support) {
    for (const auto& [other, h_other] : support) {
      if (h == HUGE_VAL || h_other == HUGE_VAL) continue;
      const double modulus = harmonic_mean(kind.first, other.first);
      square = std::max(square, (1 + kappa) * share_of_layer * model.body_contact.penalty *
                                    modulus / (kind.second * h) * (1 / h + kappa / h_other));
    }
  }
  return square;
}

}  // namespace

bool has_penalties(const Model& model) {
  return has_body_penalties(model) ||
         std::any_of(model.obstacles.begin(), model.obstacles.end(),
                     [](const Obstacle& obstacle) { return obstacle.penalty > 0; });
}

bool has_body_friction(const BodyContact& contact) {
  return contact.law.static_friction > 0 ||
         std::any_of(contact.pairs.begin(), contact.pairs.end(),
                     [](const BodyContact::Pair& pair) { return pair.law.static_friction > 0; });
}

std::vector<double> stiffness_of_layer(const Model& model, double share) {
  std::vector<double> stiffness;
  for (const Index i : model.contact.phyxels) {
    const double c = pressure_wave_speed(part_of(model, i).material);
    const double crossings = c / model.neighbourhood.support[i];
    stiffness.push_back(share * model.mass[i] * crossings * crossings);
  }
  return stiffness;
}

double contact_frequency(const Model& model) {
  if (!has_penalties(model)) return 0;
  double of_obstacles = squared_frequency_of_obstacles(model);
  if (model.share) of_obstacles = model.share->communicator->largest(of_obstacles);
  return std::sqrt(of_obstacles + squared_frequency_of_bodies(model));
}

}  // namespace phyxel
