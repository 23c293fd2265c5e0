#include "solver/following_loads.hpp"

#include <algorithm>

#include "model/owned_vectors.hpp"
#include "phyxel/physics/moment.hpp"
#include "solver/boundary_conditions.hpp"

namespace phyxel {

void SurfaceSums::add(Vec3d x, Vec3d f, double w) {
  flux.add(dot(x, f));
  force.add(f);
  torque.add(cross(x, f));
  weight.add(w);
  place.add(w * x);
  const double terms[6] = {x.x * x.x, x.x * x.y, x.x * x.z, x.y * x.y, x.y * x.z, x.z * x.z};
  for (int k = 0; k < 6; ++k) second[k].add(w * terms[k]);
}

void SurfaceSums::add(SurfaceSums& others) {
  const std::vector<ExactSum*> own = all(), added = others.all();
  for (std::size_t k = 0; k < own.size(); ++k) own[k]->add(*added[k]);
}

std::vector<ExactSum*> SurfaceSums::all() {
  std::vector<ExactSum*> sums{&flux};
  for (ExactVector* v : {&force, &torque}) sums.insert(sums.end(), {&v->x, &v->y, &v->z});
  sums.insert(sums.end(), {&weight, &place.x, &place.y, &place.z});
  for (ExactSum& sum : second) sums.push_back(&sum);
  return sums;
}

double SurfaceSums::volume(double p) const {
  const Vec3d mean = (1 / weight.value()) * place.value();
  return (flux.value() - dot(mean, force.value())) / (3 * p);
}

ForceBalance ForceBalance::of(const SurfaceSums& sums) {
  const double weight = sums.weight.value();
  if (!(weight > 0)) return {};
  ForceBalance balance;
  balance.mean = (1 / weight) * sums.place.value();
  const Vec3d force = sums.force.value(), torque = sums.torque.value() - cross(balance.mean, force);
  const auto value = [&](int k) { return sums.second[k].value(); };
  const Sym3d second = Sym3d{value(0), value(1), value(2), value(3), value(4), value(5)} +
                       moment_term(balance.mean, -weight);
  const double t = trace(second);
  const Sym3d inertia = Sym3d{t, 0, 0, t, 0, t} + -1.0 * second;
  balance.shift = (-1 / weight) * force;
  balance.turn = -(pseudo_inverse(inertia).matrix * torque);
  return balance;
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
    found.balances[f] = ForceBalance::of(of_surface);
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
