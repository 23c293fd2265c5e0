#include "phyxel/gases.hpp"

#include <algorithm>

#include "solver/boundary_conditions.hpp"
#include "solver/following_loads.hpp"

namespace phyxel {

bool has_gas(const Model& model) {
  return std::any_of(model.loads.begin(), model.loads.end(),
                     [](const Load& load) { return load.gas.has_value(); });
}

std::vector<GasReading> read_gases(const Model& model, const Backend& backend,
                                   const Solver& solver) {
  if (!has_gas(model)) return {};
  State state;
  backend.download(state);
  refresh_for_following(model, state.displacement);
  const FollowingLoads following(model);
  const auto gases =
      following.present([&](Index i) { return state.displacement[static_cast<std::size_t>(i)]; })
          .gases;
  const std::vector<double> factors = following.factors(time_of_loads(solver), gases);
  std::vector<GasReading> readings;
  for (const FollowingLoads::Gas& gas : gases) {
    const Load& load = model.loads[model.following[gas.following].load];
    readings.push_back({load.body, load.set, factors[gas.following] * load.pressure, gas.volume});
  }
  return readings;
}

std::span<const GasColumn> gas_columns() {
  using G = const GasReading&;
  static const GasColumn columns[] = {
      {"pressure", "Pa", [](G gas) { return gas.pressure; }},
      {"volume", "m^3", [](G gas) { return gas.volume; }},
  };
  return columns;
}

}  // namespace phyxel
