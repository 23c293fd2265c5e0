#include "solver/yielding.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "phyxel/history.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/physics/hooke.hpp"
#include "solver/pack.hpp"
#include "solver/part_law.hpp"

namespace phyxel {
namespace {

double contract(const Mat3d& a, const Mat3d& b) {
  double sum = 0;
  for (int e = 0; e < 9; ++e) sum += a(e / 3, e % 3) * b(e / 3, e % 3);
  return sum;
}

/// The part of a deformation across another one of size 1, made 1 in size; 0 if it is small.
Mat3d across(const Mat3d& deformation, const Mat3d& way) {
  const Mat3d rest = deformation - contract(deformation, way) * way;
  const double size = std::sqrt(contract(rest, rest));
  return size > 0.3 * std::sqrt(contract(deformation, deformation)) ? (1 / size) * rest : Mat3d{};
}

constexpr int width = 8;
using P = Pack<double, width>;
using Lanes = std::array<Mat3d, width>;

/// The first Piola–Kirchhoff stresses of some phyxels. @param numbers their history
template <class Law>
Lanes stresses_of(const Law& law, const Lanes& gradient, std::span<const P> numbers, double dt) {
  Mat3<P> packed;
  for (int e = 0; e < 9; ++e) {
    for (int l = 0; l < width; ++l) packed(e / 3, e % 3).lanes[l] = gradient[l](e / 3, e % 3);
  }
  Mat3<P> stress;
  if constexpr (has_history<Law>) {
    typename Law::State state{};
    std::memcpy(static_cast<void*>(&state), numbers.data(), numbers.size_bytes());
    stress = law.first_piola_stress(packed, state, P(dt));
  } else {
    stress = law.first_piola_stress(packed);
  }
  Lanes found;
  for (int l = 0; l < width; ++l) {
    for (int e = 0; e < 9; ++e) found[l](e / 3, e % 3) = stress(e / 3, e % 3)[l];
  }
  return found;
}

/// Calls apply(law) with the law of a material, with volume conservation and viscosity.
template <class Apply>
void with_law(const Material& m, Apply&& apply) {
  const ChosenLaw chosen = chosen_law(m);
  const VolumeConservation<P> volume{P(m.volume_stiffness)};
  Laws::with<P>(chosen.index, chosen.constants.data(), [&]<class Law>(const Law& law) {
    const SumOf<Law, VolumeConservation<P>> solid{law, volume};
    if (m.viscosity > 0) {
      apply(WithViscosity<SumOf<Law, VolumeConservation<P>>, P>{solid, P(m.viscosity)});
    } else if (m.volume_stiffness > 0) {
      apply(solid);
    } else {
      apply(law);
    }
  });
}

/// The direction of a stress but for pressure, of size 1; 0 if there is none.
Mat3d sheared_part(const Mat3d& stress, const Mat3d& f, double mu) {
  const Mat3d sheared = stress - (contract(stress, f) / contract(f, f)) * f;
  const double size = std::sqrt(contract(sheared, sheared));
  return size > 1e-9 * mu ? (1 / size) * sheared : Mat3d{};
}

/// A change of shape across another one.
Mat3d shear_across(const Mat3d& f, const Mat3d& way) {
  Mat3d flat, slanted;
  flat(0, 0) = 1;
  flat(1, 1) = -1;
  slanted(0, 1) = slanted(1, 0) = 1;
  const Mat3d beside = across(f * flat, way);
  return contract(beside, beside) > 0 ? beside : across(f * slanted, way);
}

/// How some phyxels yield. @param stresses_at returns their stresses at gradients of displacement
template <class StressesAt>
std::array<Yielding, width> yielding_of(const Lanes& gradient, double mu,
                                        StressesAt&& stresses_at) {
  constexpr double difference = 1e-6, elastic = 0.95;
  constexpr double least = 0.02;  // of elasticity; metal may have none left
  const Lanes stress = stresses_at(gradient);
  const auto shares_along = [&](const Lanes& way) {
    Lanes there;
    for (int l = 0; l < width; ++l) there[l] = gradient[l] + difference * way[l];
    const Lanes after = stresses_at(there);
    std::array<double, width> shares;
    for (int l = 0; l < width; ++l) {
      shares[l] = contract(after[l] - stress[l], way[l]) / (difference * 2 * mu);
    }
    return shares;
  };
  Lanes way, beside;
  for (int l = 0; l < width; ++l) {
    way[l] = sheared_part(stress[l], identity<double>() + gradient[l], mu);
  }
  const std::array<double, width> along = shares_along(way);
  std::array<Yielding, width> found;
  bool any = false;
  for (int l = 0; l < width; ++l) {
    if (along[l] > 1 / elastic && std::isfinite(along[l])) found[l] = {along[l], along[l], {}};
    const bool flows = along[l] < elastic && contract(way[l], way[l]) > 0;
    beside[l] = flows ? shear_across(identity<double>() + gradient[l], way[l]) : Mat3d{};
    any = any || flows;
  }
  if (!any) return found;
  const std::array<double, width> share = shares_along(beside);
  for (int l = 0; l < width; ++l) {
    if (!(contract(beside[l], beside[l]) > 0) || !std::isfinite(share[l])) continue;
    const double shear = std::clamp(share[l], least, 1.0);
    const double kept = std::clamp(along[l], least, shear);
    found[l] = {1, shear, std::sqrt(0.98 * (shear - kept) * 2 * mu) * way[l]};
  }
  return found;
}

/// How the phyxels of a part yield.
void add_yielding(const Model& model, const Part& part, std::span<const Mat3d> gradient,
                  const State& state, int threads, std::vector<Yielding>& all) {
  const PartHistory history(state, part.material, history_columns(model));
  const double mu = small_strain_parameters(part).mu;
  with_law(part.material, [&](const auto& law) {
#pragma omp parallel for schedule(static) num_threads(threads)
    for (Index begin = part.begin; begin < part.owned_end(); begin += width) {
      std::vector<double> room(history.size());
      std::vector<P> numbers(history.size());
      Lanes own{};
      for (int l = 0; l < width; ++l) {
        const Index i = std::min(begin + l, part.owned_end() - 1);
        own[l] = gradient[i];
        const std::span<double> values = history.of(i, room);
        for (std::size_t k = 0; k < values.size(); ++k) numbers[k].lanes[l] = values[k];
      }
      const auto found = yielding_of(own, mu, [&](const Lanes& there) {
        return stresses_of(law, there, numbers, state.history_interval);
      });
      for (Index i = begin; i < std::min(begin + width, part.owned_end()); ++i) {
        all[i] = found[static_cast<std::size_t>(i - begin)];
      }
    }
  });
}

}  // namespace

LameParameters small_strain_parameters(const Part& part) {
  const Material& material = part.material;
  if (material.young > 0) return {material.lame_lambda(), material.lame_mu()};
  constexpr double poisson = 0.25;
  const double young = hourglass_modulus(material);
  return {lame_lambda(young, poisson), lame_mu(young, poisson)};
}

bool may_yield(const Model& model, const Part& part) {
  return !part.material.custom_law && !columns_of(part.material, history_columns(model)).empty();
}

std::vector<Yielding> present_yielding(const Model& model, std::span<const Mat3d> gradient,
                                       const State& state, int threads) {
  std::vector<Yielding> found;
  if (std::none_of(model.parts.begin(), model.parts.end(),
                   [&](const Part& part) { return may_yield(model, part); })) {
    return found;
  }
  found.resize(static_cast<std::size_t>(model.size()));
  for (const Part& part : model.parts) {
    if (may_yield(model, part)) add_yielding(model, part, gradient, state, threads, found);
  }
  return found;
}

}  // namespace phyxel
