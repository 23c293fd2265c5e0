/// Loads on the GPU that follow the surface.
#pragma once

#include <string>
#include <vector>

#include "phyxel/physics/follower.hpp"
#include "solver/device_model.cuh"
#include "solver/following_loads.hpp"

namespace phyxel::cuda {

/// A load that follows the surface, as kernels see it.
template <class Real>
struct FollowingView {
  const Index* place;       ///< Tile slot of each phyxel.
  const Vec3<Real>* force;  ///< At rest [N].
  const Offset* row;        ///< Start of each phyxel's row, and the end of the last.
  const Index* near;        ///< Tile slots of the phyxels that a gradient knows of.
  const Vec3<Real>* slope;  ///< Share of each of these phyxels in the gradient [1/m].
  int count;                ///< Number of phyxels.

  /// The displacement gradient at the k-th phyxel.
  template <class Points>
  __device__ Mat3<Real> gradient(const Points& points, int k) const {
    const Vec3<Real> own = points.get(place[k]).u;
    Mat3<Real> sum;
    for (Offset e = row[k]; e < row[k + 1]; ++e) {
      add_gradient_term(sum, points.get(near[e]).u - own, slope[e]);
    }
    return sum;
  }
};

/// `ForceBalance`, from the origin of a body's positions.
template <class Real>
struct BalanceView {
  Vec3<Real> shift, turn, mean;

  __device__ Vec3<Real> change(Vec3<Real> x, Real w) const {
    return w * (shift + cross(turn, x - mean));
  }
};

/// Adds the present forces of a load, times a factor, to columns of forces [N]. One thread per
/// phyxel.
/// @param balance zero, unless the load acts on a closed surface
template <class Real, class StateReal>
__global__ void add_following(const __grid_constant__ Fields<Real, StateReal> f,
                              FollowingView<Real> load, Real factor, BalanceView<Real> balance,
                              Real* force) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= load.count) return;
  const Index place = load.place[k];
  const auto point = f.points.get(place);
  const Vec3<Real> x = to<Real>(point.x) + to<Real>(point.u);
  const Vec3<Real> now = following_force(load.gradient(f.points, k), load.force[k]) +
                         balance.change(x, sqrt(dot(load.force[k], load.force[k])));
  set_column3(force, f.places, place, column3(force, f.places, place) + factor * now);
}

/// Words of `SurfaceSums` on the device. Phyxels are dealt out among accumulators so that few
/// threads add to the same word at once.
struct SurfaceWords {
  static constexpr int sums = 17;
  static constexpr unsigned accumulators = 64;
  static constexpr std::size_t size = std::size_t{sums} * ExactSum::words * accumulators;

  unsigned long long* words;  ///< Shape [sums, words, accumulators].

  __device__ void add(int sum, int k, double value) const {
    const unsigned own = static_cast<unsigned>(k) % accumulators;
    ExactSum::split(value, [&](int word, std::int64_t number) {
      if (number == 0) return;
      atomicAdd(words + static_cast<unsigned>(sum * ExactSum::words + word) * accumulators + own,
                static_cast<unsigned long long>(number));
    });
  }
  /// The sums of all accumulators.
  static SurfaceSums on_host(const std::vector<unsigned long long>& words) {
    SurfaceSums all;
    std::size_t at = 0;
    for (ExactSum* sum : all.all()) {
      for (std::int64_t& word : sum->ready()) {
        for (unsigned a = 0; a < accumulators; ++a) {
          word += static_cast<std::int64_t>(words[at++]);
        }
      }
    }
    return all;
  }
};

/// Adds the terms of `SurfaceSums`, in the order of its sums. One thread per phyxel.
/// @param offset from the origin of the sums to that of the body's positions [m]
template <class Real, class StateReal>
__global__ void sum_surface(const __grid_constant__ Fields<Real, StateReal> f,
                            FollowingView<Real> load, Vec3<double> offset, SurfaceWords words) {
  const int k = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (k >= load.count) return;
  const auto point = f.points.get(load.place[k]);
  const Vec3<double> x = offset + to<double>(point.x) + to<double>(point.u);
  const Mat3<Real> gradient = load.gradient(f.points, k);
  Mat3<double> grad_u;
  for (int e = 0; e < 9; ++e) grad_u(e / 3, e % 3) = gradient(e / 3, e % 3);
  const Vec3<double> at_rest = to<double>(load.force[k]), force = following_force(grad_u, at_rest),
                     torque = cross(x, force);
  const double w = sqrt(dot(at_rest, at_rest));
  const double terms[SurfaceWords::sums] = {
      dot(x, force),   force.x,         force.y,         force.z,
      torque.x,        torque.y,        torque.z,        w,
      w * x.x,         w * x.y,         w * x.z,         w * (x.x * x.x),
      w * (x.x * x.y), w * (x.x * x.z), w * (x.y * x.y), w * (x.y * x.z),
      w * (x.z * x.z)};
  for (int s = 0; s < SurfaceWords::sums; ++s) words.add(s, k, terms[s]);
}

/// The loads of a model that follow the surface, on the device.
template <class Real, class StateReal>
class DeviceFollowing {
 public:
  explicit DeviceFollowing(const DeviceModel<Real, StateReal>& model)
      : m_(model), host_(model.model()) {
    const std::string what = "loads that follow the surface";
    for (const Following& f : m_.model().following) {
      const phyxel::Load& load = m_.model().loads[f.load];
      std::vector<Index> place, near;
      std::vector<Vec3<Real>> force, slope;
      for (const std::size_t k : f.entry) {
        place.push_back(m_.tiling().place[load.phyxels[k]]);
        force.push_back(to<Real>(load.force[k]));
      }
      for (const Index j : f.near.indices) near.push_back(m_.tiling().place[j]);
      for (const Vec3d& s : f.slope) slope.push_back(to<Real>(s));
      loads_.push_back({sent(place, what), sent(near, what), sent(f.near.offsets, what),
                        sent(force, what), sent(slope, what)});
    }
    if (host_.has_closed()) words_ = {SurfaceWords::size, what};
  }

  bool empty() const { return loads_.empty(); }
  /// Adds the present forces to columns of forces [N], shape [3, places]. Collective if there is a
  /// closed surface. Displacements of ghosts must be here. @param time [s]
  void add(double time, Real* force) const {
    const FollowingLoads::Present now = present();
    const std::vector<double> factor = host_.factors(time, now.gases);
    for (std::size_t l = 0; l < loads_.size(); ++l) {
      const FollowingView<Real> load = loads_[l].view();
      m_.launch_each("add_following", add_following<Real, StateReal>, load.count, m_.fields(), load,
                     static_cast<Real>(factor[l]), balance_of(l, now.balances[l]), force);
    }
  }
  std::size_t bytes() const {
    std::size_t bytes = words_.bytes();
    for (const Load& load : loads_) bytes += load.bytes();
    return bytes;
  }

 private:
  struct Load {
    DeviceArray<Index> place, near;
    DeviceArray<Offset> row;
    DeviceArray<Vec3<Real>> force, slope;

    FollowingView<Real> view() const {
      return {place.data(), force.data(), row.data(),
              near.data(),  slope.data(), static_cast<int>(place.size())};
    }
    std::size_t bytes() const {
      return place.bytes() + near.bytes() + row.bytes() + force.bytes() + slope.bytes();
    }
  };

  const phyxel::Load& load_of(std::size_t l) const {
    return host_.load_of(m_.model().following[l]);
  }
  /// From the origin of a load's sums to that of its body's positions [m].
  Vec3d offset_of(std::size_t l) const {
    const phyxel::Load& load = load_of(l);
    for (const Part& part : m_.model().parts) {
      if (part.name == load.body) return part.origin - FollowingLoads::origin_of(load);
    }
    return {};
  }
  BalanceView<Real> balance_of(std::size_t l, const ForceBalance& balance) const {
    return {to<Real>(balance.shift), to<Real>(balance.turn), to<Real>(balance.mean - offset_of(l))};
  }

  FollowingLoads::Present present() const {
    std::vector<SurfaceSums> sums;
    for (std::size_t l = 0; l < loads_.size(); ++l) {
      if (!load_of(l).closed) continue;
      const FollowingView<Real> load = loads_[l].view();
      PHYXEL_CUDA(cudaMemsetAsync(words_.data(), 0, words_.bytes(), m_.stream()));
      m_.launch_each("sum_surface", sum_surface<Real, StateReal>, load.count, m_.fields(), load,
                     offset_of(l), SurfaceWords{words_.data()});
      m_.wait();
      sums.push_back(SurfaceWords::on_host(fetched(words_)));
    }
    return host_.present_of(sums);
  }

  const DeviceModel<Real, StateReal>& m_;
  FollowingLoads host_;
  std::vector<Load> loads_;
  DeviceArray<unsigned long long> words_;
};

}  // namespace phyxel::cuda
