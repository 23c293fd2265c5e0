/// Contact with obstacles on the GPU.
#pragma once

#include <algorithm>
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

/// Keeps the velocities at the start of a step. One thread per phyxel of the layer.
template <class Real, class StateReal>
__global__ void keep_velocities(Fields<Real, StateReal> f, LayerArrays<StateReal> layer) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k < layer.count) layer.before[k] = column3(f.velocity, f.places, layer.place[k]);
}

/// Moves a phyxel of the layer out of an obstacle if the step has led it into it.
/// @param terms receives what is added to the obstacle's sums. @param is_last as of `keep_out`
template <class Shape, class Real, class StateReal>
__device__ void keep_phyxel_out(const Fields<Real, StateReal>& f,
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
  const Vec3<StateReal> before = layer.before[k];
  if (is_last) layer.before[k] = velocity;
  const auto free = [&](int axis) { return layer.prescribed[k] >> axis & 1 ? 0.0 : 1.0; };
  TouchingPoint point{layer.position[k] + u, v,
                      to<double>(before),    {free(0), free(1), free(2)},
                      layer.offset[k],       layer.inertia[k]};
  if (!touch(shape, obstacle, point, terms)) return;
  displacement = to<StateReal>(u + obstacle.dt * (point.velocity - v));
  const Vec3<StateReal> changed = to<StateReal>(point.velocity);
  set_column3(f.velocity, f.places, at, changed);
  if (is_last) layer.before[k] = changed;
  if constexpr (!std::is_same_v<Real, StateReal>) {
    set_column3(f.displacement, f.places, at, displacement);
  }
  record.u = to<Real>(displacement);
  f.points.set(at, record);
}

/// Moves phyxels that a step has led into an obstacle out of it, and adds to the obstacle's sums.
/// One thread per phyxel of the layer. @param is_last true of the last obstacle, which leaves the
/// velocities behind with which the next step starts
template <class Shape, class Real, class StateReal>
__global__ void keep_out(Fields<Real, StateReal> f, LayerArrays<StateReal> layer, Shape shape,
                         ObstacleStep obstacle, SumWords sums, bool is_last) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  ContactTerms terms;
  if (k < layer.count) keep_phyxel_out(f, layer, shape, obstacle, k, is_last, terms);
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
    for (const Obstacle& obstacle : m_.model().obstacles) {
      sums_.emplace_back(ContactTerms::count, accumulators, name);
      fields_.emplace_back(obstacle, name);
    }
  }

  /// True in scenes with obstacles.
  bool acts() const { return !sums_.empty(); }
  /// True if an obstacle moves, so that launches change from step to step.
  bool changes() const {
    const std::vector<Obstacle>& all = m_.model().obstacles;
    return std::any_of(all.begin(), all.end(),
                       [](const Obstacle& o) { return !o.stands_still(); });
  }
  /// Prepares for `count` steps of `dt` [s], some tens at most. Call before they are launched or
  /// recorded.
  void prepare(double dt, int count) {
    if (!acts()) return;
    if (dt != dt_) {
      m_.wait();  // steps in progress read the inertias
      inertia_ = sent(inertia_of_layer(m_.model(), dt), "contact");
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
  /// Moves phyxels out of the obstacles, one obstacle after the other, after a step from `time`
  /// [s].
  void keep_phyxels_out(double time) {
    const LayerArrays<StateReal> layer = arrays();
    rigid_.begin_step(time, dt_);
    for (std::size_t o = 0; o < sums_.size(); ++o) {
      const Obstacle& obstacle = m_.model().obstacles[o];
      const ObstacleStep step = obstacle.free ? rigid_.step_of(o) : obstacle.step_from(time, dt_);
      const SumWords words = sums_[o].pointer();
      ObstacleShapes::with(fields_[o].form(), [&](const auto& shape) {
        m_.launch_each("keep_out", keep_out<std::decay_t<decltype(shape)>, Real, StateReal>,
                       layer.count, m_.fields(), layer, shape, step, words, o + 1 == sums_.size());
      });
    }
    if (!rigid_.empty()) rigid_.end_step(sums());
  }
  /// Sets the states of free bodies, as of `RigidBodies::put`.
  void put_rigid(std::span<const RigidState> states, double dt) { rigid_.put(states, dt); }
  const std::vector<RigidState>& rigid_states() const { return rigid_.states(); }
  /// The sums of each obstacle so far (`ContactTerms`). Waits for the steps in progress.
  std::vector<ExactSum> sums() const {
    std::vector<ExactSum> all;
    if (acts()) m_.wait();
    for (const DeviceSums& of_obstacle : sums_) {
      const std::vector<ExactSum> some = of_obstacle.sums();
      all.insert(all.end(), some.begin(), some.end());
    }
    return all;
  }
  std::size_t bytes() const {
    std::size_t bytes = place_.bytes() + position_.bytes() + prescribed_.bytes() + offset_.bytes() +
                        before_.bytes() + inertia_.bytes();
    for (const DeviceSums& sums : sums_) bytes += sums.bytes();
    for (const DeviceForm& form : fields_) bytes += form.bytes();
    return bytes;
  }

 private:
  static constexpr unsigned accumulators = 128;

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
  DeviceArray<Vec3<StateReal>> before_;
  std::vector<DeviceSums> sums_;
  RigidBodies rigid_;
  std::vector<DeviceForm> fields_;  // of each obstacle
  double dt_ = 0;                   // step for which inertias were made [s]
};

}  // namespace phyxel::cuda
