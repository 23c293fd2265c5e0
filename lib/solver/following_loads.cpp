#include "solver/following_loads.hpp"

#include "model/owned_vectors.hpp"
#include "solver/boundary_conditions.hpp"

namespace phyxel {

void CavitySums::add(Vec3d x, Vec3d a) {
  flux.add(dot(x, a));
  area.add(a);
  place.add(x);
  phyxels.add(1);
}

double CavitySums::volume() const {
  const Vec3d mean = (1 / phyxels.value()) * place.value();
  return -(flux.value() - dot(mean, area.value())) / 3;
}

FollowingLoads::FollowingLoads(const Model& model) : model_(model) {
  for (const Following& f : model.following) {
    if (model.loads[f.load].gas) volume_at_rest_.push_back(1);
  }
  const std::vector<Gas> at_rest = gases([](Index) { return Vec3d{}; });
  for (std::size_t g = 0; g < at_rest.size(); ++g) volume_at_rest_[g] = at_rest[g].volume;
}

std::vector<FollowingLoads::Gas> FollowingLoads::gases_of(std::vector<CavitySums>& sums) const {
  add_each_over_ranks(model_, sums);
  std::vector<Gas> all;
  for (std::size_t f = 0; f < model_.following.size(); ++f) {
    const Load& load = model_.loads[model_.following[f].load];
    if (!load.gas) continue;
    const std::size_t g = all.size();
    all.push_back({f, *load.gas, volume_at_rest_[g], sums[g].volume()});
  }
  return all;
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
    const Load& load = model_.loads[model_.following[gas.following].load];
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
