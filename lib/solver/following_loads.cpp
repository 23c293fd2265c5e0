#include "solver/following_loads.hpp"

#include <algorithm>

#include "model/owned_vectors.hpp"
#include "solver/boundary_conditions.hpp"

namespace phyxel {

void SurfaceSums::add(Vec3d x, Vec3d f, double w) {
  flux.add(dot(x, f));
  force.add(f);
  torque.add(cross(x, f));
  sizes.add(w, x);
}

void SurfaceSums::add(SurfaceSums& set) {
  const std::vector<ExactSum*> own = all(), added = set.all();
  for (std::size_t k = 0; k < own.size(); ++k) own[k]->add(*added[k]);
}

std::vector<ExactSum*> SurfaceSums::all() {
  std::vector<ExactSum*> sums{&flux}, of_sizes = sizes.all();
  for (ExactVector* v : {&force, &torque}) sums.insert(sums.end(), {&v->x, &v->y, &v->z});
  sums.insert(sums.end(), of_sizes.begin(), of_sizes.end());
  return sums;
}

double SurfaceSums::volume(double p) const {
  const Vec3d mean = (1 / sizes.mass.value()) * sizes.moment.value();
  return (flux.value() - dot(mean, force.value())) / (3 * p);
}

ForceBalance SurfaceSums::balance() const {
  return ForceBalance::adding(sizes, -force.value(), -torque.value());
}

FollowingLoads::FollowingLoads(const Model& model) : model_(model) {
  for (const Following& f : model.following) {
    if (load_of(f).gas) volume_at_rest_.push_back(1);
  }
  if (volume_at_rest_.empty()) return;
  const std::vector<Gas> at_rest = present([](Index) { return Vec3d{}; }).gases;
  for (std::size_t g = 0; g < at_rest.size(); ++g) volume_at_rest_[g] = at_rest[g].volume;
}

bool FollowingLoads::has_closed() const {
  return std::any_of(model_.following.begin(), model_.following.end(),
                     [&](const Following& f) { return load_of(f).closed; });
}

FollowingLoads::Present FollowingLoads::present_of(std::vector<SurfaceSums>& sums) const {
  Present found;
  found.balances.resize(model_.following.size());
  if (!sums.empty()) add_each_over_ranks(model_, sums);
  std::size_t next = 0;
  for (std::size_t f = 0; f < model_.following.size(); ++f) {
    const Load& load = load_of(model_.following[f]);
    if (!load.closed) continue;
    const SurfaceSums& of_surface = sums[next++];
    found.balances[f] = of_surface.balance();
    if (!load.gas) continue;
    found.gases.push_back(
        {f, *load.gas, volume_at_rest_[found.gases.size()], of_surface.volume(load.pressure)});
  }
  return found;
}

std::vector<double> FollowingLoads::factors(double time, const std::vector<Gas>& gases) const {
  std::vector<double> factors;
  for (const Following& f : model_.following) {
    factors.push_back(model_.loads[f.load].scale_at(time));
  }
  for (const Gas& gas : gases) factors[gas.following] *= gas.ratio();
  return factors;
}

double FollowingLoads::energy_of(double time, const std::vector<Gas>& gases) const {
  double energy = 0;
  for (const Gas& gas : gases) {
    const Load& load = load_of(model_.following[gas.following]);
    // The integral of p over V, whose power tends to the logarithm as its exponent tends to 1.
    const double less = gas.exponent - 1, log = std::log(gas.volume_at_rest / gas.volume);
    const double work = less == 0 ? -log : -std::expm1(less * log) / less;
    energy -= load.scale_at(time) * load.pressure * gas.volume_at_rest * work;
  }
  return energy;
}

void refresh_for_following(const Model& model, std::vector<Vec3d>& displacement) {
  if (model.share && !model.following.empty()) refresh_ghosts(*model.share, displacement);
}

void add_loads(const FollowingLoads& following, double time, std::span<const Vec3d> displacement,
               std::vector<Vec3d>& force) {
  add_constant_loads(following.model(), time, force);
  following.add(
      time, [&](Index i) { return displacement[static_cast<std::size_t>(i)]; }, force);
}

}  // namespace phyxel
