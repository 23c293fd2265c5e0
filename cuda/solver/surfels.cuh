/// Surfels carried along with the phyxels: one launch, in which each block finds the gradients of
/// its surfels' carriers itself.
#pragma once

#include "phyxel/physics/surfel.hpp"
#include "solver/device_model.cuh"
#include "solver/surfel_plan.hpp"

namespace phyxel::cuda {

/// A `SurfelBlock`, with its centre from its body's origin.
template <class Real>
struct DeviceSurfelBlock {
  SurfelBlock at;
  Vec3<Real> centre;
};

/// Surfels in device memory, in the order of their plan.
template <class Real, class StateReal>
struct DeviceSurfels {
  const DeviceSurfelBlock<Real>* blocks;
  const Index* place;
  const std::uint16_t *neighbours, *carriers;
  const Real* weights;
  const Vec3<Real>*position, *normal;  ///< At rest; positions from the centre of the block.
  Vec3<StateReal>*displacement, *moved_normal;
};

/// u + ∇u (x - x_i) of a carrier at the centre x of a block.
template <class StateReal>
struct alignas(16) CarrierMotion {
  Vec3<StateReal> at_centre;
  Mat3<StateReal> gradient;
};

template <class Real, class StateReal>
__global__ void __launch_bounds__(surfel_block)
    move_surfels(const __grid_constant__ Fields<Real, StateReal> f,
                 const __grid_constant__ DeviceSurfels<Real, StateReal> s, int most_slots) {
  extern __shared__ __align__(16) char image[];
  auto* motions = reinterpret_cast<CarrierMotion<StateReal>*>(
      image + static_cast<std::size_t>(Points<Real>::bytes) * most_slots);
  const SurfelBlock& block = s.blocks[blockIdx.x].at;
  const Vec3<Real> centre = s.blocks[blockIdx.x].centre;
  const Index* places = s.place + block.first_slot;
  const int thread = static_cast<int>(threadIdx.x);
  wait_for_last_launch();
  for (int k = thread; k < block.slots; k += surfel_block) {
    f.points.fetch(image, most_slots, k, places[k]);
  }
  wait_for_copies();
  __syncthreads();

  // The carriers, `list_lanes` threads each; whole warps, for the sums across them.
  const Real body_support = f.tiles[block.tile].inverse_h_squared;
  const int lane = thread % list_lanes;
  constexpr int at_once = surfel_block / list_lanes;
  for (int first = 0; first < block.carriers; first += at_once) {
    const int mine = first + thread / list_lanes;
    const int c = mine < block.carriers ? mine : block.carriers - 1;
    const auto place = static_cast<std::size_t>(places[c]);
    const Real* m = f.moment_constants + place;
    const Sym3<Real> inverse_moment{
        m[0], m[f.places], m[2 * f.places], m[3 * f.places], m[4 * f.places], m[5 * f.places]};
    const Real inverse_h_squared = f.inverse_h_squared ? f.inverse_h_squared[place] : body_support;
    const auto own = Points<Real>::at(image, most_slots, 16 * c);
    const std::uint16_t* list = s.neighbours + block.first_neighbour + c * block.longest;
    Mat3<Real> sum;
    for (int e = lane; e < block.longest; e += list_lanes) {
      const auto p = Points<Real>::at(image, most_slots, 16U * list[e]);
      const Vec3<Real> x = p.x - own.x;
      add_gradient_term(sum, p.u - own.u, weight_shape_anywhere(dot(x, x), inverse_h_squared) * x);
    }
    for (int e = 0; e < 9; ++e) {
      Real& value = sum(e / 3, e % 3);
      for (int other = 1; other < list_lanes; other *= 2) {
        value += __shfl_xor_sync(~0U, value, other);
      }
    }
    if (lane == 0 && mine < block.carriers) {
      const auto gradient = to<StateReal>(displacement_gradient(sum, inverse_moment));
      Vec3<StateReal> u = to<StateReal>(own.u);
      if constexpr (!std::is_same_v<Real, StateReal>) u = column3(f.displacement, f.places, place);
      motions[c] = {u + gradient * to<StateReal>(centre - own.x), gradient};
    }
  }
  __syncthreads();

  if (thread >= block.surfels) return;
  SurfelBlend<StateReal> blend;
  const std::size_t list = block.first_carrier + thread;
  for (int k = 0; k < block.most_carriers; ++k) {
    const CarrierMotion<StateReal>& motion = motions[s.carriers[list + k * surfel_block]];
    blend.add(s.weights[list + k * surfel_block], motion.at_centre, motion.gradient);
  }
  const std::size_t at = block.first_surfel + thread;
  const Vec3<StateReal> normal = blend.surfel_normal(to<StateReal>(s.normal[at]));
  s.displacement[at] = blend.surfel_displacement(to<StateReal>(s.position[at]));
  s.moved_normal[at] = (StateReal(1) / sqrt(dot(normal, normal))) * normal;
}

template <class Real, class StateReal>
class SurfelAdvection {
 public:
  explicit SurfelAdvection(const DeviceModel<Real, StateReal>& model)
      : SurfelAdvection(model, make_surfel_plan(model.model(), fetched_tiling(model.tiling()))) {}

  /// Steps may be under way.
  void launch() const {
    m_.launch_overlapping(
        "move_surfels", move_surfels<Real, StateReal>, static_cast<unsigned>(blocks_.size()),
        shared_bytes_, m_.fields(),
        DeviceSurfels<Real, StateReal>{blocks_.data(), place_.data(), neighbours_.data(),
                                       carriers_.data(), weights_.data(), position_.data(),
                                       normal_.data(), displacement_.data(), moved_normal_.data()},
        most_slots_);
  }
  void download(SurfelState& out) const {
    const std::vector<Vec3<StateReal>> displacement = fetched(displacement_),
                                       normal = fetched(moved_normal_);
    out.position.resize(order_.size());
    out.normal.resize(order_.size());
    for (std::size_t k = 0; k < order_.size(); ++k) {
      const auto s = static_cast<std::size_t>(order_[k]);
      out.position[s] = m_.model().surfels.position[s] + to<double>(displacement[k]);
      out.normal[s] = normalised(to<double>(normal[k]));
    }
  }
  std::size_t bytes() const {
    return blocks_.bytes() + place_.bytes() + neighbours_.bytes() + carriers_.bytes() +
           weights_.bytes() + position_.bytes() + normal_.bytes() + displacement_.bytes() +
           moved_normal_.bytes();
  }

 private:
  static_assert(surfel_block == tile_size);  // the threads of an overlapping launch

  SurfelAdvection(const DeviceModel<Real, StateReal>& model, const SurfelPlan& plan)
      : m_(model), order_(plan.order), most_slots_(plan.most_slots) {
    const Surfels& surfels = m_.model().surfels;
    shared_bytes_ = Points<Real>::bytes * most_slots_ +
                    static_cast<int>(sizeof(CarrierMotion<StateReal>)) * plan.most_block_carriers;
    if (shared_bytes_ > m_.most_shared_memory()) {
      throw InputError(m_.device().name + ": " + std::to_string(surfel_block) +
                       " surfels side by side and the phyxels that move them take " +
                       std::to_string(shared_bytes_) +
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
        // From the centre as it is on the device.
        const Vec3d centre = to<double>(blocks.back().centre) + origin;
        position.push_back(to<Real>(surfels.position[s] - centre));
        normal.push_back(to<Real>(surfels.normal[s]));
      }
    }
    const std::string what = std::to_string(order_.size()) + " surfels";
    blocks_ = sent(blocks, what);
    place_ = sent(plan.place, what);
    neighbours_ = sent(plan.neighbours, what);
    carriers_ = sent(plan.carriers, what);
    weights_ = sent(std::vector<Real>(plan.weights.begin(), plan.weights.end()), what);
    position_ = sent(position, what);
    normal_ = sent(normal, what);
    displacement_ = {order_.size(), what};
    moved_normal_ = {order_.size(), what};
  }

  const DeviceModel<Real, StateReal>& m_;
  std::vector<Index> order_;
  int most_slots_ = 0, shared_bytes_ = 0;
  DeviceArray<DeviceSurfelBlock<Real>> blocks_;
  DeviceArray<Index> place_;
  DeviceArray<std::uint16_t> neighbours_, carriers_;
  DeviceArray<Real> weights_;
  DeviceArray<Vec3<Real>> position_, normal_;
  DeviceArray<Vec3<StateReal>> displacement_, moved_normal_;
};

}  // namespace phyxel::cuda
