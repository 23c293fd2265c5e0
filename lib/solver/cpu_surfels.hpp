/// Passive surfel advection on the CPU, W surfels at a time: a lane walks the carriers of its
/// surfel.
#pragma once

#include <algorithm>
#include <utility>

#include "phyxel/physics/surfel.hpp"
#include "phyxel/state.hpp"
#include "solver/carrier_weights.hpp"
#include "solver/cpu_layout.hpp"
#include "solver/pack.hpp"

namespace phyxel {

/// Record of a phyxel that surfels read: its length, and the offset of each value.
struct CarrierRecord {
  static constexpr int size = 16;
  enum { gradient = 0, position = 9, displacement = 12 };
};

/// The surfels of a model and their carriers, in packs. Positions are relative to the first phyxel
/// of the body, as those of the carriers are.
template <class Real>
class CpuSurfels {
  static constexpr int W = static_cast<int>(simd_bytes / sizeof(Real));
  using P = Pack<Real, W>;

 public:
  CpuSurfels(const Model& model, const Layout& layout) : model_(model) {
    const Surfels& surfels = model.surfels;
    const auto count = static_cast<Index>(surfels.position.size());
    const Index packs = (count + W - 1) / W;
    start_.assign(static_cast<std::size_t>(packs) + 1, 0);
    for (Index p = 0; p < packs; ++p) {
      Index longest = 0;
      for (Index s = p * W; s < std::min(count, (p + 1) * W); ++s) {
        longest = std::max(longest, surfels.carriers.length(s));
      }
      start_[p + 1] = start_[p] + Offset{longest} * W;
    }
    carrier_.assign(static_cast<std::size_t>(start_.back()), 0);
    weight_.assign(carrier_.size(), Real(0));
    position_.assign(static_cast<std::size_t>(packs) * 3 * W, Real(0));
    normal_.assign(position_.size(), Real(0));
    std::size_t part = 0;
    for (Index s = 0; s < count; ++s) {
      while (s >= model.parts[part].surfel_end) ++part;
      const Vec3d origin = model.parts[part].origin;
      set3(position_, s, surfels.position[s] - origin);
      set3(normal_, s, surfels.normal[s]);
      set_carriers(layout, s);
    }
  }

  /// Takes the carriers on the other sides of cracks from surfels, and gives back those that it
  /// took before from others.
  void cut(const Layout& layout, CrackSides sides) {
    if (sides.broken() == sides_.broken()) return;
    const CrackSides before = std::exchange(sides_, std::move(sides));
    const auto count = static_cast<Index>(model_.surfels.position.size());
    for (Index s = 0; s < count; ++s) {
      if (before.may_cut(model_, s) || sides_.may_cut(model_, s)) set_carriers(layout, s);
    }
  }

  /// Computes positions and normals of all surfels. @param records carrier records of all slots
  void advect(const AlignedVector<Real>& records, int threads, SurfelState& out) const {
    const auto count = static_cast<Index>(model_.surfels.position.size());
    out.position.resize(static_cast<std::size_t>(count));
    out.normal.resize(static_cast<std::size_t>(count));
#pragma omp parallel for schedule(static) num_threads(threads)
    for (Index p = 0; p < static_cast<Index>(start_.size()) - 1; ++p) {
      const Vec3<P> x_s = vec3_of(position_, p);
      SurfelBlend<P> blend;
      for (Offset k = start_[p]; k < start_[p + 1]; k += W) {
        P record[CarrierRecord::size];
        load_records<CarrierRecord::size>(records.data(), &carrier_[k], record);
        Mat3<P> grad_u;
        for (int e = 0; e < 9; ++e) grad_u(e / 3, e % 3) = record[CarrierRecord::gradient + e];
        const P* x = record + CarrierRecord::position;
        const P* u = record + CarrierRecord::displacement;
        blend.add(load<P>(&weight_[k]), {u[0], u[1], u[2]}, grad_u,
                  x_s - Vec3<P>{x[0], x[1], x[2]});
      }
      const Vec3<P> moved = blend.surfel_displacement(),
                    normal = blend.surfel_normal(vec3_of(normal_, p));
      for (int l = 0; l < W && p * W + l < count; ++l) {
        const Index s = p * W + l;
        out.position[s] = model_.surfels.position[s] + Vec3d{moved.x[l], moved.y[l], moved.z[l]};
        out.normal[s] = normalised(Vec3d{normal.x[l], normal.y[l], normal.z[l]});
      }
    }
  }

  std::size_t bytes() const {
    return start_.size() * sizeof(Offset) + carrier_.size() * sizeof(Index) +
           (weight_.size() + position_.size() + normal_.size()) * sizeof(Real);
  }

 private:
  /// Fills the carriers of one surfel pack. Lanes with fewer carriers repeat the first one, with
  /// weight zero.
  void set_carriers(const Layout& layout, Index s) {
    const auto carriers = model_.surfels.carriers.row(s);
    const std::vector<double> weights = carrier_weights(model_, s, sides_);
    const Index p = s / W, lane = s % W;
    const auto longest = static_cast<std::size_t>((start_[p + 1] - start_[p]) / W);
    for (std::size_t k = 0; k < longest; ++k) {
      const auto at = static_cast<std::size_t>(start_[p]) + k * W + static_cast<std::size_t>(lane);
      carrier_[at] = layout.slot(carriers[k < carriers.size() ? k : 0]);
      if (k < carriers.size()) weight_[at] = static_cast<Real>(weights[k]);
    }
  }

  static void set3(AlignedVector<Real>& array, Index s, Vec3d v) {
    Real* at = &array[static_cast<std::size_t>(s / W) * 3 * W + static_cast<std::size_t>(s % W)];
    at[0] = static_cast<Real>(v.x);
    at[W] = static_cast<Real>(v.y);
    at[2 * W] = static_cast<Real>(v.z);
  }
  static Vec3<P> vec3_of(const AlignedVector<Real>& array, Index p) {
    const Real* at = &array[static_cast<std::size_t>(p) * 3 * W];
    return {phyxel::load<P>(at), phyxel::load<P>(at + W), phyxel::load<P>(at + 2 * W)};
  }

  const Model& model_;
  std::vector<Offset> start_;  // first carrier of each pack
  AlignedVector<Index> carrier_;
  AlignedVector<Real> weight_, position_, normal_;
  CrackSides sides_;
};

}  // namespace phyxel
