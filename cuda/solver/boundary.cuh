/// Prescribed motions and loads on the GPU.
#pragma once

#include <optional>
#include <vector>

#include "solver/boundary_conditions.hpp"
#include "solver/device_sums.cuh"
#include "solver/following.cuh"
#include "solver/step_sums.hpp"

namespace phyxel::cuda {

/// The affine field offset + slope x of positions x relative to the body's origin [m].
template <class T>
struct AffineField {
  Vec3<T> offset;
  Mat3<T> slope;
  __device__ Vec3<T> at(Vec3<T> x) const { return offset + slope * x; }
};

/// The work of the support of one motion on a device, in which a step adds a term for each phyxel.
struct DeviceWork {
  const double* inertia = nullptr;  ///< As `support_inertia` [kg/s]; null: no work is counted.
  AffineField<double> mean_step;    ///< Displacement as of `Motion::mean_step` [m].
  SumWords words;                   ///< One sum.

  /// Adds the work on the k-th phyxel, by velocities as for `support_force` [m/s].
  __device__ void add(int k, Vec3<double> x, Vec3<double> prescribed, Vec3<double> free) const {
    words.add(0, k, dot(support_force(inertia[k], prescribed, free), mean_step.at(x)));
  }
};

/// Sets displacements and velocities of phyxels with a prescribed motion, along its axes, after
/// each step, and adds the work of its support. One thread per phyxel.
/// @param position of the moved phyxels relative to the body's origin [m]; null for
/// phyxels whose displacements do not depend on it
template <class Real, class StateReal>
__global__ void follow(Fields<Real, StateReal> f, const Index* place,
                       const Vec3<StateReal>* position, int count, Axes axes,
                       AffineField<StateReal> displacements, AffineField<StateReal> velocities,
                       DeviceWork work) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  const Index at = place[k];
  auto point = f.points.get(at);
  const Vec3<StateReal> x = position ? position[k] : Vec3<StateReal>{};
  Vec3<StateReal> displacement = displacements.at(x), velocity = velocities.at(x);
  if (!axes.x || !axes.y || !axes.z) {
    const auto along_axes = [axes](Vec3<StateReal> path, Vec3<StateReal> free) {
      return Vec3<StateReal>{axes.x ? path.x : free.x, axes.y ? path.y : free.y,
                             axes.z ? path.z : free.z};
    };
    velocity = along_axes(velocity, column3(f.velocity, f.places, at));
    if constexpr (std::is_same_v<Real, StateReal>) {
      displacement = along_axes(displacement, point.u);
    } else {
      displacement = along_axes(displacement, column3(f.displacement, f.places, at));
    }
  }
  if (work.inertia) {
    const Vec3<double> free = to<double>(column3(f.velocity, f.places, at));
    work.add(k, to<double>(x), to<double>(velocity), free);
  }
  set_column3(f.velocity, f.places, at, velocity);
  if constexpr (!std::is_same_v<Real, StateReal>) {
    set_column3(f.displacement, f.places, at, displacement);
  }
  point.u = to<Real>(displacement);
  f.points.set(at, point);
}

/// Adds scale · force to the load of each listed tile slot. One thread per slot; slots must be
/// distinct.
template <class Real>
__global__ void add_load(Real* load, std::size_t places, const Index* place,
                         const Vec3<Real>* force, int count, Real scale) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= count) return;
  set_column3(load, places, place[k], column3(load, places, place[k]) + scale * force[k]);
}

template <class Real, class StateReal>
class Boundary {
 public:
  explicit Boundary(DeviceModel<Real, StateReal>& model) : m_(model) {
    make_motions();
    make_loads();
  }

  /// True if motions or loads that change in size or follow the surface change from step to step.
  bool changes() const {
    return !paths_.empty() || !following_.empty() ||
           std::any_of(loads_.begin(), loads_.end(),
                       [](const auto& l) { return !l.of->curve.is_constant(); });
  }
  /// Sets the caller's forces [N], shape [3, places]; an empty list clears them. They act from the
  /// next launch on.
  void set_external(const std::vector<Real>& force) {
    m_.set_external(force);
    load_scales_.reset();
    sum_loads(time_);
  }
  /// Sums the applied forces at a time [s] without loads that follow the surface, which may be
  /// added to the sum (`DeviceFollowing::add`). Repeated calls sum again only while a load still
  /// changes or follows the surface.
  void sum_loads(double time) {
    time_ = time;
    if (!m_.loads()) return;
    const std::vector<double> scales = load_scales(m_.model(), time);
    if (scales == load_scales_ && following_.empty()) return;
    load_scales_ = scales;
    const std::size_t bytes = 3 * m_.places() * sizeof(Real);
    if (m_.fields().external) {
      PHYXEL_CUDA(cudaMemcpyAsync(m_.loads(), m_.fields().external, bytes, cudaMemcpyDeviceToDevice,
                                  m_.stream()));
    } else {
      PHYXEL_CUDA(cudaMemsetAsync(m_.loads(), 0, bytes, m_.stream()));
    }
    for (const Loading& load : loads_) {
      m_.launch_each("add_load", add_load<Real>, static_cast<int>(load.places.size()), m_.loads(),
                     m_.places(), load.places.data(), load.force.data(),
                     static_cast<int>(load.places.size()),
                     static_cast<Real>(load.of->scale_at(time)));
    }
  }
  /// The loads that follow the surface.
  const DeviceFollowing<Real, StateReal>& following() const { return following_; }
  /// Moves phyxels to their prescribed positions after a step from `time` [s].
  /// @param counts_work whether the step is added to the work of supports
  void follow_paths(double time, double dt, bool counts_work) {
    prepare_work(dt);
    for (Moved& path : paths_) {
      const Path before = path.of->path_at(time), after = path.of->path_at(time + dt);
      const Vec3d x = path.origin, there = after.at(x);
      DeviceWork work;
      if (counts_work && !path.words.empty()) {
        const Path mean_step = path.of->mean_step(time, dt);
        work = {path.inertia.data(), {mean_step.at(x), mean_step.turn}, path.words.pointer()};
      }
      set(path.places, path.positions.data(), path.of->axes,
          {to<StateReal>(there), to_real(after.turn)},
          {to<StateReal>((there - before.at(x)) / dt),
           to_real((1 / dt) * (after.turn - before.turn))},
          work);
    }
  }
  /// The work of supports so far, of each motion; none if no support moves. Waits for the steps in
  /// progress.
  StepSums support_work() const {
    StepSums work(sums_of_motions(m_.model()));
    if (work.empty()) return work;
    m_.wait();
    for (const Moved& path : paths_) {
      if (path.words.empty()) continue;
      work[static_cast<std::size_t>(path.of - m_.model().motions.data())] = path.words.sums()[0];
    }
    return work;
  }
  /// Bytes of the arrays for the work of supports.
  std::size_t work_bytes() const {
    std::size_t bytes = 0;
    for (const Moved& path : paths_) bytes += path.inertia.bytes() + path.words.bytes();
    return bytes;
  }
  /// Returns fixed phyxels to their prescribed positions, at rest, whatever an uploaded state says.
  void put_held_at_rest() const {
    if (held_.size() > 0) set(held_, nullptr, {}, {}, {}, {});
  }
  /// The prescribed axes of each phyxel (`Axes::bits`), shape [places]; null if there are none.
  const char* moved() const { return moved_.data(); }

 private:
  struct Moved {
    const Motion* of;
    Vec3d origin;  ///< Origin of their body.
    DeviceArray<Index> places;
    /// Positions relative to `origin` [m] in the precision of displacements: in mixed precision the
    /// tiles have positions in float.
    DeviceArray<Vec3<StateReal>> positions;
    /// The work of a motion that does not stand still, as of `DeviceWork`.
    DeviceArray<double> inertia{};
    DeviceSums words{};
  };
  struct Loading {
    const Load* of;
    DeviceArray<Index> places;
    DeviceArray<Vec3<Real>> force;
  };

  std::vector<Index> places_of(const std::vector<Index>& phyxels) const {
    std::vector<Index> places;
    for (const Index i : phyxels) places.push_back(m_.tiling().place[i]);
    return places;
  }
  void make_motions() {
    std::vector<char> moved;
    std::vector<Index> held;
    for (const Motion& motion : m_.model().motions) {
      // Ghosts have the values of their owners, whose free axes are not known here.
      std::vector<Index> own;
      for (const Index i : motion.phyxels) {
        if (m_.model().owns(i)) own.push_back(i);
      }
      const std::vector<Index> at = places_of(own);
      if (motion.stands_still() && motion.axes.all()) {
        held.insert(held.end(), at.begin(), at.end());
        continue;
      }
      const Vec3d origin = origin_of(motion);
      std::vector<Vec3<StateReal>> positions;
      for (const Index i : own) {
        positions.push_back(to<StateReal>(m_.model().position[i] - origin));
      }
      paths_.push_back({&motion, origin, sent(at, "moved phyxels"),
                        sent(positions, "positions of moved phyxels")});
      if (!motion.stands_still() && !own.empty()) {
        paths_.back().words = DeviceSums(1, 1024, work_name);
      }
      moved.resize(m_.places(), 0);
      for (const Index place : at) moved[place] |= motion.axes.bits();
    }
    held_ = sent(held, "held phyxels");
    moved_ = sent(moved, "moved phyxels");
  }
  static constexpr const char* work_name = "work of supports";
  /// Makes inertias for steps of `dt` [s], and room in the sums for one step more.
  void prepare_work(double dt) {
    for (Moved& path : paths_) {
      if (path.words.empty()) continue;
      if (dt != work_step_) {
        m_.wait();  // steps in progress read the inertias
        path.inertia = sent(support_inertia(m_.model(), *path.of, dt), work_name);
      }
      path.words.prepare(path.places.size(), 1, [&] { m_.wait(); });
    }
    work_step_ = dt;
  }
  Vec3d origin_of(const Motion& motion) const {
    for (const Part& part : m_.model().parts) {
      const bool here = !motion.phyxels.empty() && motion.phyxels[0] >= part.begin &&
                        motion.phyxels[0] < part.end;
      if (here) return part.origin;
    }
    return {};
  }
  static Mat3<StateReal> to_real(const Mat3d& m) {
    Mat3<StateReal> out;
    for (int e = 0; e < 9; ++e) out(e / 3, e % 3) = static_cast<StateReal>(m(e / 3, e % 3));
    return out;
  }
  void make_loads() {
    if (m_.model().loads.empty()) return;
    m_.make_loads();
    for (const Load& load : m_.model().loads) {
      if (load.follows) continue;
      std::vector<Vec3<Real>> force;
      for (const Vec3d& f : load.force) force.push_back(to<Real>(f));
      loads_.push_back(
          {&load, sent(places_of(load.phyxels), "loaded phyxels"), sent(force, "loads")});
    }
  }
  void set(const DeviceArray<Index>& at, const Vec3<StateReal>* positions, Axes axes,
           const AffineField<StateReal>& displacement, const AffineField<StateReal>& velocity,
           const DeviceWork& work) const {
    const auto count = static_cast<int>(at.size());
    m_.launch_each("follow", follow<Real, StateReal>, count, m_.fields(), at.data(), positions,
                   count, axes, displacement, velocity, work);
  }

  DeviceModel<Real, StateReal>& m_;
  std::vector<Moved> paths_;
  std::vector<Loading> loads_;
  DeviceFollowing<Real, StateReal> following_{m_};
  std::optional<std::vector<double>> load_scales_;  // of the last sum; none before the first
  double time_ = 0;                                 // of the last sum [s]
  double work_step_ = 0;                            // step for which inertias were made [s]
  DeviceArray<Index> held_;
  DeviceArray<char> moved_;
};

}  // namespace phyxel::cuda
