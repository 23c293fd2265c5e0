/// Contact with obstacles on the GPU.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "phyxel/physics/obstacles.hpp"
#include "solver/device_distances.cuh"
#include "solver/device_model.cuh"
#include "solver/device_sums.cuh"
#include "solver/step_contacts.hpp"

namespace phyxel::cuda {

/// The phyxels that touch obstacles, in device memory, shape [count] each.
template <class StateReal>
struct LayerArrays {
  const Index* place = nullptr;            ///< Tile slots.
  const Vec3<double>* position = nullptr;  ///< At rest [m].
  const double* offset = nullptr;          ///< As of `ContactLayer` [m].
  const double* inertia = nullptr;         ///< As of `TouchingPoint` [kg/s].
  const char* prescribed = nullptr;        ///< Prescribed axes (`Axes::bits`).
  Vec3<StateReal>* before = nullptr;       ///< Velocities at the start of the step [m/s].
  int count = 0;
};

/// The displacement of a place, as precisely as the state has it [m].
template <class Real, class StateReal>
__device__ Vec3<double> displacement_at(const Fields<Real, StateReal>& f, Index place) {
  if constexpr (std::is_same_v<Real, StateReal>) {
    return to<double>(f.points.get(place).u);
  } else {
    return to<double>(column3(f.displacement, f.places, place));
  }
}

/// Sets the displacement and the velocity of a place.
template <class Real, class StateReal>
__device__ void move_to(const Fields<Real, StateReal>& f, Index at, Vec3<double> displacement,
                        Vec3<double> velocity) {
  const Vec3<StateReal> u = to<StateReal>(displacement);
  set_column3(f.velocity, f.places, at, to<StateReal>(velocity));
  if constexpr (!std::is_same_v<Real, StateReal>) set_column3(f.displacement, f.places, at, u);
  auto record = f.points.get(at);
  record.u = to<Real>(u);
  f.points.set(at, record);
}

/// Keeps the velocities at the start of a step. One thread per phyxel of the layer.
template <class Real, class StateReal>
__global__ void keep_velocities(Fields<Real, StateReal> f, LayerArrays<StateReal> layer) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k < layer.count) layer.before[k] = column3(f.velocity, f.places, layer.place[k]);
}

/// Returns 1 for the free axes of a phyxel of the layer and 0 for prescribed ones.
template <class StateReal>
__device__ Vec3<double> free_axes_of(const LayerArrays<StateReal>& layer, int k) {
  const auto free = [&](int axis) { return layer.prescribed[k] >> axis & 1 ? 0.0 : 1.0; };
  return {free(0), free(1), free(2)};
}

/// Moves a phyxel of the layer out of an obstacle if the step has led it into it.
/// @param terms receives what is added to the obstacle's sums. @param is_last as of `keep_out`
/// @returns true if it has
template <class Shape, class Real, class StateReal>
__device__ bool keep_phyxel_out(const Fields<Real, StateReal>& f,
                                const LayerArrays<StateReal>& layer, const Shape& shape,
                                const ObstacleStep& obstacle, int k, bool is_last,
                                ContactTerms& terms) {
  const Index at = layer.place[k];
  auto record = f.points.get(at);
  Vec3<StateReal> displacement;
  if constexpr (std::is_same_v<Real, StateReal>) {
    displacement = record.u;
  } else {
    displacement = column3(f.displacement, f.places, at);
  }
  const Vec3<StateReal> velocity = column3(f.velocity, f.places, at);
  const Vec3<double> u = to<double>(displacement), v = to<double>(velocity);
  const Vec3<double> position = layer.position[k] + u;
  // Most phyxels are outside, and need no more than that.
  if (!(gap_to(shape, obstacle, position).distance < layer.offset[k])) {
    if (is_last) layer.before[k] = velocity;
    return false;
  }
  const Vec3<StateReal> before = layer.before[k];
  if (is_last) layer.before[k] = velocity;
  TouchingPoint point{
      position, v, to<double>(before), free_axes_of(layer, k), layer.offset[k], layer.inertia[k]};
  if (!touch(shape, obstacle, point, terms)) return false;
  displacement = to<StateReal>(u + obstacle.dt * (point.velocity - v));
  const Vec3<StateReal> changed = to<StateReal>(point.velocity);
  set_column3(f.velocity, f.places, at, changed);
  if (is_last) layer.before[k] = changed;
  if constexpr (!std::is_same_v<Real, StateReal>) {
    set_column3(f.displacement, f.places, at, displacement);
  }
  record.u = to<Real>(displacement);
  f.points.set(at, record);
  return true;
}

/// Moves phyxels that a step has led into an obstacle out of it, and adds to the obstacle's sums.
/// One thread per phyxel of the layer. @param is_last true of the last obstacle, which leaves the
/// velocities behind with which the next step starts
template <class Shape, class Real, class StateReal>
__global__ void keep_out(Fields<Real, StateReal> f, LayerArrays<StateReal> layer, Shape shape,
                         ObstacleStep obstacle, SumWords sums, bool is_last) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  ContactTerms terms;
  const bool touches =
      k < layer.count && keep_phyxel_out(f, layer, shape, obstacle, k, is_last, terms);
  if (!__any_sync(0xffffffff, touches)) return;
  for (int s = 0; s < ContactTerms::count; ++s) sums.add_of_warp(s, k, terms.value[s]);
}

/// What penalties need of the phyxels that touch obstacles, in device memory, shape [count] each.
struct PenaltyArrays {
  const double* stiffness = nullptr;  ///< Of penalties of 1 [N/m].
  const double* inertia = nullptr;    ///< As of `PushedPoint` [kg/s].
};

/// Changes the velocities with which a step starts by the penalty of an obstacle, and adds to the
/// obstacle's sums. One thread per phyxel of the layer. @param obstacle as the step starts
template <class Shape, class Real, class StateReal>
__global__ void push_out(Fields<Real, StateReal> f, LayerArrays<StateReal> layer,
                         PenaltyArrays penalties, Shape shape, ObstacleStep obstacle,
                         double penalty, SumWords sums) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  ContactTerms terms;
  if (k < layer.count) {
    const Index at = layer.place[k];
    const PushedPoint point{layer.position[k] + displacement_at(f, at), free_axes_of(layer, k),
                            layer.offset[k], penalty * penalties.stiffness[k],
                            penalties.inertia[k]};
    Vec3<double> change{};
    if (penalty_change(shape, obstacle, point, change, terms)) {
      set_column3(f.velocity, f.places, at,
                  to<StateReal>(to<double>(column3(f.velocity, f.places, at)) + change));
    }
  }
  for (int s = 0; s < ContactTerms::count; ++s) sums.add_of_warp(s, k, terms.value[s]);
}

/// Lets phyxels rub on an obstacle whose penalty pushes them, at the end of a step, and adds to the
/// obstacle's sums. One thread per phyxel of the layer.
template <class Shape, class Real, class StateReal>
__global__ void rub_on(Fields<Real, StateReal> f, LayerArrays<StateReal> layer,
                       PenaltyArrays penalties, Shape shape, ObstacleStep obstacle, double penalty,
                       SumWords sums) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  ContactTerms terms;
  if (k < layer.count) {
    const Index at = layer.place[k];
    const Vec3<double> u = displacement_at(f, at),
                       v = to<double>(column3(f.velocity, f.places, at));
    TouchingPoint point{layer.position[k] + u,
                        v,
                        to<double>(layer.before[k]),
                        free_axes_of(layer, k),
                        layer.offset[k],
                        layer.inertia[k]};
    if (rub(shape, obstacle, penalty * penalties.stiffness[k], point, terms)) {
      move_to(f, at, u + obstacle.dt * (point.velocity - v), point.velocity);
    }
  }
  for (int s = 0; s < ContactTerms::count; ++s) sums.add_of_warp(s, k, terms.value[s]);
}

/// The shape of an obstacle, with what it reads in device memory.
class DeviceForm {
 public:
  DeviceForm(const Obstacle& obstacle, const std::string& name) : form_(obstacle.form) {
    if (!obstacle.distances) return;
    distances_ = DeviceDistances(*obstacle.distances, name);
    form_.field = distances_.view();
  }
  const ObstacleForm& form() const { return form_; }
  std::size_t bytes() const { return distances_.bytes(); }

 private:
  ObstacleForm form_;
  DeviceDistances distances_;
};

/// Contact of a model's bodies with its obstacles.
template <class Real, class StateReal>
class Contacts {
 public:
  explicit Contacts(DeviceModel<Real, StateReal>& model) : m_(model), rigid_(model.model()) {
    const ContactLayer& layer = m_.model().contact;
    if (m_.model().obstacles.empty()) return;
    const std::string name = "contact";
    const std::vector<char> all_axes = prescribed_axes(m_.model());
    std::vector<Index> places;
    std::vector<Vec3<double>> positions;
    std::vector<char> prescribed;
    for (const Index i : layer.phyxels) {
      places.push_back(m_.tiling().place[i]);
      positions.push_back(m_.model().position[i]);
      prescribed.push_back(all_axes[i]);
    }
    place_ = sent(places, name);
    position_ = sent(positions, name);
    prescribed_ = sent(prescribed, name);
    offset_ = sent(layer.offset, name);
    before_ = sent(std::vector<Vec3<StateReal>>(places.size()), name);
    const std::vector<Obstacle>& obstacles = m_.model().obstacles;
    if (std::any_of(obstacles.begin(), obstacles.end(),
                    [](const Obstacle& o) { return o.penalty > 0; })) {
      stiffness_ = sent(stiffness_of_layer(m_.model(), share_of_layer), name);
    }
    for (const Obstacle& obstacle : obstacles) {
      sums_.emplace_back(ContactTerms::count, accumulators, name);
      fields_.emplace_back(obstacle, name);
    }
  }

  /// True in scenes with obstacles.
  bool acts() const { return !sums_.empty(); }
  /// True if an obstacle moves, so that launches change from step to step.
  bool changes() const {
    const std::vector<Obstacle>& all = m_.model().obstacles;
    return std::any_of(all.begin(), all.end(), [](const Obstacle& o) { return !o.stands_still(); });
  }
  /// Prepares for `count` steps of `dt` [s], some tens at most. Call before they are launched or
  /// recorded.
  void prepare(double dt, int count) {
    if (!acts()) return;
    if (dt != dt_) {
      m_.wait();  // steps in progress read the inertias
      inertia_ = sent(inertia_of_layer(m_.model(), dt), "contact");
      if (pushes()) start_inertia_ = sent(start_inertia_of_layer(m_.model(), dt), "contact");
      dt_ = dt;
    }
    for (DeviceSums& sums : sums_) {
      sums.prepare(place_.size(), count, [&] { m_.wait(); });
    }
  }
  /// Remembers the velocities at the start of a step that does not follow another one at once.
  void remember_velocities() {
    if (!acts()) return;
    const LayerArrays<StateReal> layer = arrays();
    m_.launch_each("keep_velocities", keep_velocities<Real, StateReal>, layer.count, m_.fields(),
                   layer);
  }
  /// True if an obstacle acts by penalties.
  bool pushes() const { return stiffness_.size() > 0; }
  /// Changes the velocities with which the step from `time` [s] starts by penalties.
  void push_phyxels(double time) {
    if (!pushes()) return;
    const LayerArrays<StateReal> layer = arrays();
    for (std::size_t o = 0; o < sums_.size(); ++o) {
      const Obstacle& obstacle = m_.model().obstacles[o];
      if (!(obstacle.penalty > 0)) continue;
      const ObstacleStep start =
          obstacle.free ? rigid_.start_of(o, dt_) : obstacle.stage_to(time, dt_);
      const SumWords words = sums_[o].pointer();
      ObstacleShapes::with(fields_[o].form(), [&](const auto& shape) {
        m_.launch_each("push_out", push_out<std::decay_t<decltype(shape)>, Real, StateReal>,
                       layer.count, m_.fields(), layer, penalties(), shape, start, obstacle.penalty,
                       words);
      });
    }
    if (!rigid_.empty()) rigid_.act_back(sums_of_phyxels());
  }
  /// Moves phyxels out of the obstacles, one obstacle after the other, after a step from `time`
  /// [s], and lets those rub that penalties push.
  void keep_phyxels_out(double time) {
    const LayerArrays<StateReal> layer = arrays();
    rigid_.begin_step(time, dt_);
    for (std::size_t o = 0; o < sums_.size(); ++o) {
      const Obstacle& obstacle = m_.model().obstacles[o];
      const ObstacleStep step = obstacle.free ? rigid_.step_of(o) : obstacle.step_from(time, dt_);
      const SumWords words = sums_[o].pointer();
      ObstacleShapes::with(fields_[o].form(), [&](const auto& shape) {
        using Shape = std::decay_t<decltype(shape)>;
        if (obstacle.penalty > 0) {
          if (!(obstacle.law.static_friction > 0)) return;
          m_.launch_each("rub_on", rub_on<Shape, Real, StateReal>, layer.count, m_.fields(), layer,
                         penalties(), shape, step, obstacle.penalty, words);
          return;
        }
        m_.launch_each("keep_out", keep_out<Shape, Real, StateReal>, layer.count, m_.fields(),
                       layer, shape, step, words, o + 1 == sums_.size());
      });
    }
    if (!rigid_.empty()) rigid_.act_back(sums_of_phyxels());
  }
  /// Sets the states of free bodies, as of `RigidBodies::put`.
  void put_rigid(std::span<const RigidState> states, double dt) { rigid_.put(states, dt); }
  const std::vector<RigidState>& rigid_states() const { return rigid_.states(); }
  /// What a step changes, but for phyxels.
  struct Kept {
    RigidBodies::Kept rigid;
    std::vector<ExactSum> sums;
  };
  Kept kept() const { return {rigid_.kept(), sums_of_phyxels()}; }
  /// Takes steps since then back.
  void put_back(Kept kept) {
    rigid_.put_back(std::move(kept.rigid));
    for (std::size_t o = 0; o < sums_.size(); ++o) {
      const auto first = kept.sums.begin() + static_cast<std::ptrdiff_t>(o * ContactTerms::count);
      sums_[o].set({first, first + ContactTerms::count});
    }
  }
  /// The sums of each obstacle so far (`ContactTerms`). Waits for the steps in progress.
  std::vector<ExactSum> sums() const { return rigid_.with_held_points(sums_of_phyxels()); }
  std::size_t bytes() const {
    std::size_t bytes = place_.bytes() + position_.bytes() + prescribed_.bytes() + offset_.bytes() +
                        before_.bytes() + inertia_.bytes() + stiffness_.bytes() +
                        start_inertia_.bytes();
    for (const DeviceSums& sums : sums_) bytes += sums.bytes();
    for (const DeviceForm& form : fields_) bytes += form.bytes();
    return bytes;
  }

 private:
  static constexpr unsigned accumulators = 128;

  /// The sums of what obstacles do to the phyxels of the layer. Waits for the steps in progress.
  std::vector<ExactSum> sums_of_phyxels() const {
    std::vector<ExactSum> all;
    if (acts()) m_.wait();
    for (const DeviceSums& of_obstacle : sums_) {
      const std::vector<ExactSum> some = of_obstacle.sums();
      all.insert(all.end(), some.begin(), some.end());
    }
    return all;
  }
  PenaltyArrays penalties() const { return {stiffness_.data(), start_inertia_.data()}; }

  LayerArrays<StateReal> arrays() const {
    return {place_.data(),
            position_.data(),
            offset_.data(),
            inertia_.data(),
            prescribed_.data(),
            before_.data(),
            static_cast<int>(place_.size())};
  }

  DeviceModel<Real, StateReal>& m_;
  DeviceArray<Index> place_;
  DeviceArray<Vec3<double>> position_;
  DeviceArray<char> prescribed_;
  DeviceArray<double> offset_, inertia_;
  DeviceArray<double> stiffness_, start_inertia_;  // of penalties; empty without them
  DeviceArray<Vec3<StateReal>> before_;
  std::vector<DeviceSums> sums_;
  RigidBodies rigid_;
  std::vector<DeviceForm> fields_;  // of each obstacle
  double dt_ = 0;                   // step for which inertias were made [s]
};

}  // namespace phyxel::cuda
