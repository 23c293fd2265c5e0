/// Surfel advection on the GPU.
#pragma once

#include "phyxel/physics/surfel.hpp"
#include "solver/passes.cuh"
#include "solver/resident.cuh"
#include "solver/surfel_plan.hpp"

namespace phyxel::cuda {

/// A `SurfelBlock`, with its centre relative to its body's origin.
template <class Real>
struct DeviceSurfelBlock {
  SurfelBlock at;
  Vec3<Real> centre;
};

/// A `Carrier` in device memory.
template <class Real>
struct alignas(2 * sizeof(Real)) DeviceCarrier {
  Real weight;
  unsigned offset;  ///< 16 × slot
};

/// Surfels in device memory, in the order of their plan.
template <class Real, class StateReal>
struct DeviceSurfels {
  const DeviceSurfelBlock<Real>* blocks;
  const Index *place, *row;  ///< Index of a slot in the fields, and in the trail.
  const DeviceCarrier<Real>* carriers;
  const Vec3<Real>*position, *normal;  ///< At rest; positions relative to the centre of the block.
  Vec3<StateReal>*displacement, *moved_normal;  ///< [steps, surfels]
  Trail<Real, StateReal> trail;                 ///< Null displacements: those of the fields.
  std::size_t stride, surfels;                  ///< Tile slots of the trail; number of surfels.
  int most_slots;
};

/// Motions of carriers, in the layout of an image of stresses: u + ∇u (x - x_i), at the centre x of
/// a block, and ∇u.
template <class Real>
using CarrierMotions = Stresses<Real>;

/// Advects surfels. One thread per surfel and step.
template <class Real, class StateReal>
__global__ void __launch_bounds__(surfel_block)
    move_surfels(const __grid_constant__ Fields<Real, StateReal> f,
                 const __grid_constant__ DeviceSurfels<Real, StateReal> s) {
  extern __shared__ __align__(16) char motions[];
  const SurfelBlock& block = s.blocks[blockIdx.x].at;
  const Vec3<Real> centre = s.blocks[blockIdx.x].centre;
  const int thread = static_cast<int>(threadIdx.x);
  DeviceCarrier<Real> next[carrier_group];
  const DeviceCarrier<Real>* list = s.carriers + block.first_carrier + thread;
  const auto fetch_group = [&] {
#pragma unroll
    for (int g = 0; g < carrier_group; ++g) next[g] = list[g * surfel_block];
    list += carrier_group * surfel_block;
  };
  fetch_group();
  Index place = 0, row = 0;
  const auto look_up = [&](int slot) {
    if (slot >= block.slots) return;
    place = s.place[block.first_slot + slot];
    row = s.row[block.first_slot + slot];
  };
  look_up(thread);
  let_next_launch_begin();
  wait_for_last_launch();
  const std::size_t before = blockIdx.y * s.stride;
  const Real* gradients = s.trail.gradients + 9 * before;
  const StateReal* displacements = s.trail.displacements;
  for (int slot = thread; slot < block.slots; slot += surfel_block) {
    const auto point = f.points.get(static_cast<std::size_t>(place));
    Vec3<StateReal> u = to<StateReal>(point.u);
    if (displacements) {
      u = column3(displacements + 3 * before, s.stride, static_cast<std::size_t>(row));
    } else if constexpr (!std::is_same_v<Real, StateReal>) {
      u = column3(f.displacement, f.places, static_cast<std::size_t>(place));
    }
    Mat3<StateReal> gradient;
    for (int e = 0; e < 9; ++e) gradient(e / 3, e % 3) = gradients[e * s.stride + row];
    CarrierMotions<StateReal>::put(motions, s.most_slots, slot,
                                   {u + gradient * to<StateReal>(centre - point.x), gradient});
    look_up(slot + surfel_block);
  }
  __syncthreads();

  if (thread >= block.surfels) return;
  SurfelBlend<StateReal> blend;
  for (int left = block.carriers; left > 0; left -= carrier_group) {
    DeviceCarrier<Real> group[carrier_group];
#pragma unroll
    for (int g = 0; g < carrier_group; ++g) group[g] = next[g];
    if (left > carrier_group) fetch_group();
#pragma unroll
    for (int g = 0; g < carrier_group; ++g) {
      const auto motion = CarrierMotions<StateReal>::at(motions, s.most_slots, group[g].offset);
      blend.add(group[g].weight, motion.x, motion.q);
    }
  }
  const std::size_t at = block.first_surfel + thread, out = blockIdx.y * s.surfels + at;
  const Vec3<StateReal> normal = blend.surfel_normal(to<StateReal>(s.normal[at]));
  s.displacement[out] = blend.surfel_displacement(to<StateReal>(s.position[at]));
  s.moved_normal[out] = (StateReal(1) / sqrt(dot(normal, normal))) * normal;
}

/// Records of phyxels that carry surfels of other ranks, which their owner sends.
template <class Real, class StateReal>
struct CarrierRecords {
  Real* gradients;  ///< [9, places]
  Fields<Real, StateReal> fields;

  struct Value {
    Vec3<StateReal> u;
    Real gradient[9];
  };
  __device__ Value get(std::size_t place) const {
    Value v;
    if constexpr (std::is_same_v<Real, StateReal>) {
      v.u = fields.points.get(place).u;
    } else {
      v.u = column3(fields.displacement, fields.places, place);
    }
    for (int e = 0; e < 9; ++e) v.gradient[e] = gradients[e * fields.places + place];
    return v;
  }
  __device__ void set(std::size_t place, const Value& v) const {
    auto point = fields.points.get(place);
    point.u = to<Real>(v.u);
    fields.points.set(place, point);
    if constexpr (!std::is_same_v<Real, StateReal>) {
      set_column3(fields.displacement, fields.places, place, v.u);
    }
    for (int e = 0; e < 9; ++e) gradients[e * fields.places + place] = v.gradient[e];
  }
};

template <class Real, class StateReal>
class SurfelAdvection {
 public:
  /// @param trail_steps largest number of steps of `launch_trail`; 0 if only `launch` is used,
  /// which computes the gradients of tiles with carriers alone
  SurfelAdvection(const DeviceModel<Real, StateReal>& model, int trail_steps)
      : SurfelAdvection(model, trail_steps, make_surfel_plan(model.model(), model.tiling().place)) {
  }

  /// Computes the surfels at the present state. Steps may be in progress.
  void launch(const Passes<Real, StateReal>& passes) const {
    if (m_.share()) {
      passes.put_gradients({gradients_.data(), stride_, nullptr}, m_.tiles());
      passes.exchange(CarrierRecords<Real, StateReal>{gradients_.data(), m_.fields()});
    } else if (tiles_.size()) {
      passes.put_gradients({gradients_.data(), stride_, tiles_.data()},
                           static_cast<Index>(tiles_.size()));
    } else {
      passes.put_gradients({gradients_.data(), stride_, nullptr}, m_.tiles());
    }
    launch_kernel({gradients_.data(), nullptr}, 1);
  }
  /// The trail that must be filled before `launch_trail`.
  Trail<Real, StateReal> trail() const { return {gradients_.data(), displacements_.data()}; }
  void launch_trail(int steps) const { launch_kernel(trail(), steps); }
  void download(SurfelState& out) const {
    const std::size_t count = order_.size(), first = (last_steps_ - 1) * count;
    const std::vector<Vec3<StateReal>> displacement = fetched(displacement_, first, count),
                                       normal = fetched(moved_normal_, first, count);
    out.position.resize(count);
    out.normal.resize(count);
    for (std::size_t k = 0; k < count; ++k) {
      const auto s = static_cast<std::size_t>(order_[k]);
      out.position[s] = m_.model().surfels.position[s] + to<double>(displacement[k]);
      out.normal[s] = normalised(to<double>(normal[k]));
    }
  }
  /// Takes the carriers on the other sides of cracks from surfels, and gives back those that it
  /// took before from others. Steps must not be in progress.
  void cut(CrackSides sides) {
    if (sides.broken() == sides_.broken()) return;
    sides_ = std::move(sides);
    carriers_.upload(carriers_of(make_surfel_plan(m_.model(), m_.tiling().place, sides_)).data());
  }
  std::size_t bytes() const {
    return blocks_.bytes() + place_.bytes() + row_.bytes() + tiles_.bytes() + carriers_.bytes() +
           position_.bytes() + normal_.bytes() + displacement_.bytes() + moved_normal_.bytes() +
           gradients_.bytes() + displacements_.bytes();
  }

 private:
  static_assert(surfel_block == tile_size);  // the threads of an overlapping launch

  SurfelAdvection(const DeviceModel<Real, StateReal>& model, int trail_steps,
                  const SurfelPlan& plan)
      : m_(model), order_(plan.order), most_slots_(plan.most_slots) {
    const Surfels& surfels = m_.model().surfels;
    shared_bytes_ = CarrierMotions<StateReal>::bytes * most_slots_;
    if (shared_bytes_ > m_.most_shared_memory()) {
      throw InputError(m_.device().name + ": a surfel that " + std::to_string(most_slots_) +
                       " phyxels carry takes " + std::to_string(shared_bytes_) +
                       " bytes of shared memory, of which a block may have " +
                       std::to_string(m_.most_shared_memory()) +
                       ": allowed are a smaller support, precision \"float\" or the CPU");
    }
    std::vector<DeviceSurfelBlock<Real>> blocks;
    std::vector<Vec3<Real>> position, normal;
    for (const SurfelBlock& block : plan.blocks) {
      const Vec3d origin = m_.origin_of(m_.tiling().part[block.tile]);
      blocks.push_back({block, to<Real>(block.centre - origin)});
      for (int k = 0; k < block.surfels; ++k) {
        const auto s = static_cast<std::size_t>(plan.order[block.first_surfel + k]);
        // Relative to the centre as rounded on the device.
        const Vec3d centre = to<double>(blocks.back().centre) + origin;
        position.push_back(to<Real>(surfels.position[s] - centre));
        normal.push_back(to<Real>(surfels.normal[s]));
      }
    }
    const std::string what = std::to_string(order_.size()) + " surfels";
    blocks_ = sent(blocks, what);
    place_ = sent(plan.place, what);
    if (m_.share()) {
      stride_ = m_.places();  // carriers may be ghosts
    } else if (trail_steps > 0) {
      stride_ = m_.places();
      displacements_ = {static_cast<std::size_t>(trail_steps) * 3 * stride_, what};
    } else {
      tiles_ = sent(plan.tiles, what);
      row_ = sent(rows_of(plan), what);
      stride_ = plan.tiles.size() * tile_size;
    }
    const auto steps = static_cast<std::size_t>(std::max(1, trail_steps));
    gradients_ = {steps * 9 * stride_, what};
    carriers_ = sent(carriers_of(plan), what);
    position_ = sent(position, what);
    normal_ = sent(normal, what);
    displacement_ = {steps * order_.size(), what};
    moved_normal_ = {steps * order_.size(), what};
  }

  void launch_kernel(Trail<Real, StateReal> trail, int steps) const {
    last_steps_ = static_cast<std::size_t>(steps);
    const Index* row = row_.size() ? row_.data() : place_.data();
    m_.launch_blocks("move_surfels", move_surfels<Real, StateReal>,
                     {static_cast<unsigned>(blocks_.size()), static_cast<unsigned>(steps)},
                     shared_bytes_, tiles_.size() == 0, m_.fields(),
                     DeviceSurfels<Real, StateReal>{
                         blocks_.data(), place_.data(), row, carriers_.data(), position_.data(),
                         normal_.data(), displacement_.data(), moved_normal_.data(), trail, stride_,
                         order_.size(), most_slots_});
  }

  static std::vector<DeviceCarrier<Real>> carriers_of(const SurfelPlan& plan) {
    std::vector<DeviceCarrier<Real>> carriers;
    for (const Carrier& c : plan.carriers) {
      carriers.push_back({static_cast<Real>(c.weight), 16U * static_cast<unsigned>(c.slot)});
    }
    return carriers;
  }
  /// Returns the index of each slot among the slots of tiles with carriers.
  static std::vector<Index> rows_of(const SurfelPlan& plan) {
    std::vector<Index> rows;
    for (const Index place : plan.place) {
      const auto tile = std::lower_bound(plan.tiles.begin(), plan.tiles.end(), place / tile_size) -
                        plan.tiles.begin();
      rows.push_back(static_cast<Index>(tile) * tile_size + place % tile_size);
    }
    return rows;
  }

  const DeviceModel<Real, StateReal>& m_;
  std::vector<Index> order_;
  CrackSides sides_;  // of the cracks by which carriers were cut
  int most_slots_ = 0, shared_bytes_ = 0;
  std::size_t stride_ = 0;
  mutable std::size_t last_steps_ = 1;  // steps of the last launch
  DeviceArray<DeviceSurfelBlock<Real>> blocks_;
  DeviceArray<Index> place_;
  DeviceArray<Index> row_, tiles_;  // empty if the trail has all tile slots
  DeviceArray<DeviceCarrier<Real>> carriers_;
  DeviceArray<Vec3<Real>> position_, normal_;
  DeviceArray<Vec3<StateReal>> displacement_, moved_normal_;
  DeviceArray<Real> gradients_;
  DeviceArray<StateReal> displacements_;
};

}  // namespace phyxel::cuda
