#include "phyxel/probes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>
#include <utility>

#include "model/point_fit.hpp"
#include "phyxel/error.hpp"
#include "phyxel/point_fields.hpp"
#include "phyxel/share.hpp"
#include "rank_sums.hpp"
#include "solver/first_error.hpp"
#include "solver/tensors.hpp"

namespace phyxel {
namespace {

constexpr std::size_t most_phyxels = 64;  // of a fit

/// A phyxel near a point.
struct Near {
  double distance_squared = 0;  ///< [m²]
  Index global_id = 0, local = 0;
  Index part = 0;
  Vec3d place;         ///< At rest [m].
  double support = 0;  ///< [m]
  bool operator<(const Near& other) const {
    return std::pair(distance_squared, global_id) <
           std::pair(other.distance_squared, other.global_id);
  }
};
static_assert(std::is_trivially_copyable_v<Near>);

/// Merges the lists of all ranks for each point and keeps the nearest `most` phyxels, in order.
/// Phyxels of other ranks have local = -1. Collective on a share.
void merge_over_ranks(const Model& model, std::vector<std::vector<Near>>& of_points,
                      std::size_t most) {
  if (!model.share) return;
  const Communicator& ranks = *model.share->communicator;
  std::vector<std::byte> own;
  for (const std::vector<Near>& list : of_points) {
    const std::uint64_t count = list.size();
    const auto* head = reinterpret_cast<const std::byte*>(&count);
    own.insert(own.end(), head, head + sizeof count);
    const auto* data = reinterpret_cast<const std::byte*>(list.data());
    own.insert(own.end(), data, data + list.size() * sizeof(Near));
  }
  const auto all = ranks.alltoallv(
      std::vector<std::vector<std::byte>>(static_cast<std::size_t>(ranks.size()), own));
  std::vector<std::size_t> at(all.size(), 0);
  for (std::vector<Near>& list : of_points) {
    for (std::size_t r = 0; r < all.size(); ++r) {
      std::uint64_t count = 0;
      std::memcpy(&count, all[r].data() + at[r], sizeof count);
      at[r] += sizeof count;
      if (static_cast<int>(r) != ranks.rank()) {
        const std::size_t before = list.size();
        list.resize(before + count);
        std::memcpy(list.data() + before, all[r].data() + at[r], count * sizeof(Near));
        for (std::size_t k = before; k < list.size(); ++k) list[k].local = -1;
      }
      at[r] += count * sizeof(Near);
    }
    std::sort(list.begin(), list.end());
    if (list.size() > most) list.resize(most);
  }
}

/// Finds the nearest `most` phyxels of some parts that this rank owns and for which may_be(phyxel)
/// is true, in order.
template <class MayBe>
std::vector<Near> nearest_here(const Model& model, std::span<const Part> parts, Vec3d point,
                               std::size_t most, MayBe&& may_be) {
  std::vector<Near> heap;
  for (const Part& part : parts) {
    for (Index i = part.begin; i < part.owned_end(); ++i) {
      const Vec3d x = model.position[i] - point;
      const Near near{.distance_squared = dot(x, x),
                      .global_id = model.global_id(i),
                      .local = i,
                      .part = static_cast<Index>(&part - model.parts.data()),
                      .place = model.position[i],
                      .support = model.neighbourhood.support[i]};
      if ((heap.size() == most && !(near < heap.front())) || !may_be(i)) continue;
      if (heap.size() == most) {
        std::pop_heap(heap.begin(), heap.end());
        heap.pop_back();
      }
      heap.push_back(near);
      std::push_heap(heap.begin(), heap.end());
    }
  }
  std::sort_heap(heap.begin(), heap.end());
  return heap;
}

/// The parts of the body with a name.
std::span<const Part> parts_named(const Model& model, const std::string& name) {
  for (const Part& part : model.parts) {
    if (part.name == name) return model.parts_of_body(part);
  }
  throw InputError(
      fmt::format("a probe is in body \"{}\", which the model lacks; allowed: one of its "
                  "bodies, such as \"{}\"",
                  name, model.parts.empty() ? "" : model.parts.front().name));
}

/// Weighted sums over phyxels.
struct WeightedSums {
  ExactSum weight, von_mises;
  ExactVector place, displacement, velocity;
  std::array<ExactSum, 6> stress, strain;
  std::vector<ExactSum*> all() {
    std::vector<ExactSum*> sums{&weight, &von_mises};
    for (ExactVector* v : {&place, &displacement, &velocity}) {
      sums.insert(sums.end(), {&v->x, &v->y, &v->z});
    }
    for (auto* tensor : {&stress, &strain}) {
      for (ExactSum& sum : *tensor) sums.push_back(&sum);
    }
    return sums;
  }
  /// Adds phyxel i.
  void add(double w, Index i, const Model& model, const State& state, const FieldValues& fields) {
    weight.add(w);
    place.add(w * model.position[i]);
    displacement.add(w * state.displacement[i]);
    velocity.add(w * state.velocity[i]);
    von_mises.add(w * fields.at(Quantity::von_mises)[i]);
    for (int k = 0; k < 6; ++k) {
      stress[k].add(w * fields.at(Quantity::stress)[6 * i + k]);
      strain[k].add(w * fields.at(Quantity::strain)[6 * i + k]);
    }
  }
  /// Returns the reading whose values are the sums times a factor.
  ProbeReading reading(double factor) const {
    ProbeReading found;
    found.place = factor * place.value();
    found.displacement = factor * displacement.value();
    found.velocity = factor * velocity.value();
    found.von_mises = factor * von_mises.value();
    for (int k = 0; k < 6; ++k) {
      found.stress[k] = factor * stress[k].value();
      found.strain[k] = factor * strain[k].value();
    }
    return found;
  }
};

}  // namespace

Probes::Probes(const Model& model, std::vector<Probe> probes)
    : model_(model), probes_(std::move(probes)) {
  add_points();
}

void Probes::add_points() {
  std::vector<std::span<const Part>> bodies;
  for (std::size_t p = 0; p < probes_.size(); ++p) {
    const std::span<const Part> parts = parts_named(model_, probes_[p].body);
    for (std::size_t k = 0; k < probes_[p].points.size(); ++k) {
      points_.push_back(
          {.probe = p, .number = static_cast<Index>(k), .place = probes_[p].points[k]});
      bodies.push_back(parts);
    }
  }
  // The nearest phyxel tells the material.
  const auto count = static_cast<std::ptrdiff_t>(points_.size());
  std::vector<std::vector<Near>> nearest(points_.size()), near(points_.size());
#pragma omp parallel for schedule(dynamic)
  for (std::ptrdiff_t k = 0; k < count; ++k) {
    nearest[k] = nearest_here(model_, bodies[k], points_[k].place, 1, [](Index) { return true; });
  }
  merge_over_ranks(model_, nearest, 1);
  for (std::size_t k = 0; k < points_.size(); ++k) {
    const Vec3d x = points_[k].place;
    const Near none{.distance_squared = HUGE_VAL};
    const Near& first = nearest[k].empty() ? none : nearest[k].front();
    const double distance = std::sqrt(first.distance_squared), allowed = 0.5 * first.support;
    if (!(distance <= allowed)) {
      const Probe& probe = probes_[points_[k].probe];
      throw InputError(fmt::format(
          "{}{}probe \"{}\": point [{:g}, {:g}, {:g}] is {:.3g} m from the nearest phyxel of body "
          "\"{}\"; allowed: at most {:.3g} m, half its support radius",
          probe.where, probe.where.empty() ? "" : ": ", probe.name, x.x, x.y, x.z, distance,
          probe.body, allowed));
    }
  }
#pragma omp parallel for schedule(dynamic)
  for (std::ptrdiff_t k = 0; k < count; ++k) {
    const Near& first = nearest[k].front();
    const Part& part = model_.parts[static_cast<std::size_t>(first.part)];
    const auto body = static_cast<std::size_t>(part.body);
    const Walls* walls = body < model_.walls.size() ? &model_.walls[body] : nullptr;
    const std::size_t room = walls ? walls->room_of(points_[k].place) : 0;
    near[k] = nearest_here(model_, {&part, 1}, points_[k].place, most_phyxels, [&](Index i) {
      const Vec3d x = model_.position[i] - points_[k].place;
      return dot(x, x) <= first.support * first.support &&
             (!walls || walls->room_of(model_.position[i]) == room);
    });
  }
  merge_over_ranks(model_, near, most_phyxels);
  for (std::size_t k = 0; k < points_.size(); ++k) {
    std::vector<Near>& list = near[k];
    // A room may be thinner than its phyxels' distance from the wall.
    if (list.empty()) list = nearest[k];
    std::vector<Vec3d> places;
    for (const Near& phyxel : list) places.push_back(phyxel.place);
    const double support = nearest[k].front().support,
                 farthest = std::sqrt(list.back().distance_squared);
    const std::vector<double> share =
        shares_at(points_[k].place, places,
                  list.size() < most_phyxels ? std::max(support, 1.05 * farthest) : farthest);
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (list[i].local < 0) continue;
      points_[k].phyxels.push_back(list[i].local);
      points_[k].share.push_back(share[i]);
    }
  }
}

std::vector<ProbeReading> Probes::read(Backend& backend, const Recovery* recovery) const {
  if (probes_.empty()) return {};
  check_fits(model_, backend);
  State state;
  backend.download(state);
  const Quantity wanted[] = {Quantity::stress, Quantity::strain, Quantity::von_mises};
  const FieldValues fields = find_fields(model_, backend, wanted, recovery);
  std::vector<WeightedSums> sums;
  auto point = points_.begin();
  for (std::size_t p = 0; p < probes_.size(); ++p) {
    if (probes_[p].points.empty()) {
      WeightedSums& mean = sums.emplace_back();
      for (const Index i : probes_[p].phyxels) {
        if (model_.owns(i)) mean.add(model_.volume[i], i, model_, state, fields);
      }
    }
    for (; point != points_.end() && point->probe == p; ++point) {
      WeightedSums& value = sums.emplace_back();
      for (std::size_t k = 0; k < point->phyxels.size(); ++k) {
        value.add(point->share[k], point->phyxels[k], model_, state, fields);
      }
    }
  }
  add_each_over_ranks(model_, sums);

  std::vector<ProbeReading> readings;
  point = points_.begin();
  auto sum = sums.begin();
  for (std::size_t p = 0; p < probes_.size(); ++p) {
    if (probes_[p].points.empty()) {
      readings.push_back(sum->reading(1 / sum->weight.value()));
      readings.back().probe = probes_[p].name;
      ++sum;
    }
    for (; point != points_.end() && point->probe == p; ++point, ++sum) {
      ProbeReading& reading = readings.emplace_back(sum->reading(1));
      reading.probe = probes_[p].name;
      reading.number = point->number;
      reading.place = point->place;
      reading.von_mises = von_mises_stress(matrix_of(reading.stress));
    }
  }
  return readings;
}

std::span<const ProbeColumn> probe_columns() {
  using R = const ProbeReading&;
  static const ProbeColumn columns[] = {
      {"x", "m", [](R r) { return r.place.x; }},
      {"y", "m", [](R r) { return r.place.y; }},
      {"z", "m", [](R r) { return r.place.z; }},
      {"displacement_x", "m", [](R r) { return r.displacement.x; }},
      {"displacement_y", "m", [](R r) { return r.displacement.y; }},
      {"displacement_z", "m", [](R r) { return r.displacement.z; }},
      {"velocity_x", "m/s", [](R r) { return r.velocity.x; }},
      {"velocity_y", "m/s", [](R r) { return r.velocity.y; }},
      {"velocity_z", "m/s", [](R r) { return r.velocity.z; }},
      {"stress_xx", "Pa", [](R r) { return r.stress[0]; }},
      {"stress_yy", "Pa", [](R r) { return r.stress[1]; }},
      {"stress_zz", "Pa", [](R r) { return r.stress[2]; }},
      {"stress_xy", "Pa", [](R r) { return r.stress[3]; }},
      {"stress_yz", "Pa", [](R r) { return r.stress[4]; }},
      {"stress_xz", "Pa", [](R r) { return r.stress[5]; }},
      {"von_mises", "Pa", [](R r) { return r.von_mises; }},
      {"strain_xx", "", [](R r) { return r.strain[0]; }},
      {"strain_yy", "", [](R r) { return r.strain[1]; }},
      {"strain_zz", "", [](R r) { return r.strain[2]; }},
      {"strain_xy", "", [](R r) { return r.strain[3]; }},
      {"strain_yz", "", [](R r) { return r.strain[4]; }},
      {"strain_xz", "", [](R r) { return r.strain[5]; }},
  };
  return columns;
}

}  // namespace phyxel
