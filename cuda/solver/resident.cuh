/// Many steps in one launch, for bodies that fit the shared memory of multiprocessors.
///
/// A block owns a slice: 64 phyxels, their state in registers, the weighted distances to their
/// neighbours (which never change) and an image of all displacements and stresses that they need in
/// shared memory. Twice a step blocks send what others need, 16 bytes at a time, and wait for what
/// they need themselves; nobody waits for all. There are two ways:
///
/// - The slices of a body form a cluster: each phyxel is written straight into the images that have
///   a slot for it, and counted by a barrier there (`ClusterChannel`). For bodies of up to 16
///   slices; many such bodies follow one another if they do not fit at once.
/// - Through global memory, with the number of the half step in each 16 bytes; readers ask until
///   that number is there (`MailboxChannel`). For larger bodies; all must fit at once.
///
/// Nothing is overwritten too early: who sends the next has received what only those could send
/// who had read the last.
///
/// Sums run in the order of the tile's lists and through the same functions as in kernels.cuh, so
/// that results are the same to the last bit.
#pragma once

#include "solver/cluster_channel.cuh"
#include "solver/kernels.cuh"
#include "solver/mailbox_channel.cuh"

namespace phyxel::cuda {

/// The weighted distances of all slices, one block each: for the first pass by the phyxel's
/// support, for the second by the neighbour's. @param weights w_ij of both passes, or null
/// @tparam pairwise true if a body has weights of pairs
template <class Real, class StateReal, bool pairwise>
__global__ void weigh_pairs(const __grid_constant__ Fields<Real, StateReal> f, const Slice* slices,
                            const Index* place, const std::uint16_t* entries, int passes,
                            Pair<Real>* pairs, Real* weights) {
  const Slice& slice = slices[blockIdx.x];
  const TileConstants<Real, StateReal>& body = f.tiles[slice.first_place / tile_size];
  const Real body_support = body.inverse_h_squared;
  for (int pass = 0; pass < passes; ++pass) {
    const Slice::Rows& rows = slice.rows[pass];
    for (int k = static_cast<int>(threadIdx.x); k < rows.longest * slice_size;
         k += static_cast<int>(blockDim.x)) {
      const int p = k % slice_size;
      const std::uint16_t entry = entries[rows.first_entry + k];
      Pair<Real> pair{{}, static_cast<decltype(Pair<Real>::slot)>(p)};  // its own: zero from itself
      Real weight{};
      if (!(entry & far_entry)) {
        const auto own = static_cast<std::size_t>(slice.first_place) + p;
        const auto other = static_cast<std::size_t>(place[slice.first_slot + entry]);
        const Vec3<Real> x = f.points.get(other).x - f.points.get(own).x;
        if (pairwise && body.pairwise()) {
          weight = pair_weight(dot(x, x), f.inverse_h_squared[own], f.inverse_h_squared[other],
                               -body.inverse_h_squared);
        } else {
          const Real inverse_h_squared =
              f.inverse_h_squared ? f.inverse_h_squared[pass == 0 ? own : other] : body_support;
          weight = weight_shape_anywhere(dot(x, x), inverse_h_squared);
        }
        pair = {weight * x, entry};
      }
      pairs[rows.first_entry + k] = pair;
      if (weights) weights[rows.first_entry + k] = weight;
    }
  }
}

/// Starts to copy a slice's pairs for one pass into shared memory.
template <class Real>
__device__ void fetch_pairs(const ResidentView<Real>& r, const Slice::Rows& rows,
                            Pair<Real>* pairs) {
  constexpr int words = sizeof(Pair<Real>) / 16;
  const auto* from = reinterpret_cast<const uint4*>(r.pairs + rows.first_entry);
  for (int k = static_cast<int>(threadIdx.x); k < rows.longest * slice_size * words;
       k += static_cast<int>(blockDim.x)) {
    copy_async<16>(reinterpret_cast<uint4*>(pairs) + k, from + k);
  }
}

/// The same of the weights of these pairs.
template <class Real>
__device__ void fetch_weights(const ResidentView<Real>& r, const Slice::Rows& rows, Real* weights) {
  constexpr int each = 16 / sizeof(Real);
  const Real* from = r.weights + rows.first_entry;
  for (int k = static_cast<int>(threadIdx.x) * each; k < rows.longest * slice_size;
       k += static_cast<int>(blockDim.x) * each) {
    copy_async<16>(weights + k, from + k);
  }
}

/// Entries of a lane whose numbers are loaded together: fewer of those that fill many registers.
template <int packets>
inline constexpr int entries_together = packets > 9 ? pair_group / 2 : pair_group;

/// Calls visit(numbers of the neighbour, w x, number of the entry) in the order of the list, with
/// the next group's pairs under way. A longer loop, with the next group's numbers under way too, is
/// slower: a warp or two on a multiprocessor wait for its instructions.
template <class Real, int packets, class Visit>
__device__ void walk_pairs(const Pair<Real>* pairs, int length, SlotImage image, Visit&& visit) {
  constexpr int numbers = packets * Packing<Real>::numbers, group = entries_together<packets>;
  if (length == 0) return;  // then there may be no table
  Pair<Real> ahead[group];
#pragma unroll
  for (int k = 0; k < group; ++k) ahead[k] = pairs[k * slice_size];
#pragma unroll 1
  for (int left = length; left > 0; left -= group) {
    Packet got[group][packets];
    Vec3<Real> wx[group];
#pragma unroll
    for (int k = 0; k < group; ++k) {
      wx[k] = ahead[k].wx;
#pragma unroll
      for (int l = 0; l < packets; ++l)
        got[k][l] = image.packets[l * image.slots + static_cast<int>(ahead[k].slot)];
    }
    pairs += group * slice_size;
    if (left > group) {
#pragma unroll
      for (int k = 0; k < group; ++k) ahead[k] = pairs[k * slice_size];
    }
#pragma unroll
    for (int k = 0; k < group; ++k) {
      Real n[numbers];
#pragma unroll
      for (int l = 0; l < packets; ++l)
        Packing<Real>::unpack(got[k][l], n + l * Packing<Real>::numbers);
      visit(n, wx[k], length - left + k);
    }
  }
}

// --- parts of the kernel ------------------------------------------------------------------------

// Some of these functions take values that a thread keeps in registers by value, others by
// reference. The kernels then have the same instructions as if they were written in one piece, but
// for the order of some sums' components (scripts/kernel_table.py); other signatures move loads and
// change the number of instructions.

/// True for a block without a slice, after its part in the barriers of its cluster.
template <class Channel, class Real>
__device__ __forceinline__ bool stands_by(int number) {
  if constexpr (std::is_same_v<Channel, ClusterChannel<Real>>) {
    if (number < 0) {
      Channel::stand_by();
      return true;
    }
  }
  return false;
}

/// The weights that a block keeps. @param weighted whether terms need those of the first pass
template <class Terms>
__device__ __forceinline__ KeptWeights weights_kept(bool weighted) {
  return Terms::sends ? KeptWeights::both_passes
         : weighted   ? KeptWeights::first_pass
                      : KeptWeights::none;
}

/// Lets the next launch begin, and waits until the last one has written the state.
__device__ __forceinline__ void follow_last_launch() {
  let_next_launch_begin();
  wait_for_last_launch();
}

/// Starts to copy the pairs of a slice, and the weights that its block keeps, into shared memory.
/// @param weighted whether weights of the first pass are kept
template <class Terms, class Real>
__device__ __forceinline__ void fetch_tables(const ResidentView<Real>& r, const Slice& slice,
                                             const ResidentMemory<Real>& memory, bool weighted) {
  fetch_pairs(r, slice.rows[0], memory.pairs);
  if (weighted) fetch_weights(r, slice.rows[0], memory.weights);
  if (r.longest[1]) {
    fetch_pairs(r, slice.rows[1], memory.second_pairs);
    if constexpr (Terms::sends) fetch_weights(r, slice.rows[1], memory.second_weights);
  }
}

/// Number of entries in the rows of a thread's warp; 0 for a thread without a phyxel.
__device__ __forceinline__ int length_of(const Slice& slice, int pass, int thread) {
  return thread < slice_size ? slice.rows[pass].length[thread / warp_size] : 0;
}

/// Loads the inverse moment and the volume of a phyxel. @param c its first constant
template <class Real>
__device__ __forceinline__ void fetch_moment(const Real* c, std::size_t places,
                                             Sym3<Real>& inverse_moment, Real& volume) {
  inverse_moment = {c[0], c[places], c[2 * places], c[3 * places], c[4 * places], c[5 * places]};
  volume = c[6 * places];
}

/// The displacement of a phyxel in the precision of the state. @param u that of its point
template <class Real, class StateReal>
__device__ __forceinline__ Vec3<StateReal> displacement_at(const Fields<Real, StateReal>& f,
                                                           std::size_t place, const Vec3<Real>& u) {
  if constexpr (std::is_same_v<Real, StateReal>) {
    return u;
  } else {
    return column3(f.displacement, f.places, place);
  }
}

/// Stores the state of a phyxel in global memory.
template <class Real, class StateReal>
__device__ __forceinline__ void store_state(const Fields<Real, StateReal>& f, std::size_t place,
                                            typename Points<Real>::Value point,
                                            Vec3<StateReal> velocity,
                                            Vec3<StateReal> displacement) {
  f.points.set(place, point);
  set_column3(f.velocity, f.places, place, velocity);
  if constexpr (!std::is_same_v<Real, StateReal>) {
    set_column3(f.displacement, f.places, place, displacement);
  }
}

/// Sends the displacements of a slice to the slices that need them, and receives theirs.
template <class Channel, class Real>
__device__ __forceinline__ void exchange_displacements(Channel& channel, SlotImage image,
                                                       std::size_t place, bool somebody,
                                                       Vec3<Real> u) {
  constexpr int packets = displacement_packets<Real>;
  const Real numbers[] = {u.x, u.y, u.z};
  channel.template send<packets>(0, image, place, somebody, numbers);
  channel.template receive<packets>(0, image);
}

/// Sends other numbers of a slice likewise. @param half of the step: 0 or 1
template <int packets, class Channel, class Real>
__device__ __forceinline__ void exchange(Channel& channel, int half, SlotImage image,
                                         std::size_t place, bool somebody, const Real* numbers) {
  channel.template send<packets>(half, image, place, somebody, numbers);
  channel.template receive<packets>(half, image);
}

/// Gathers the sums of a thread's phyxel over its neighbours in the first pass.
/// @param weighted whether terms need `NeighbourSums::pull`
template <class Real>
__device__ __forceinline__ void gather_sums(const ResidentMemory<Real>& memory, int thread,
                                            int length, const typename Points<Real>::Value& point,
                                            bool weighted, NeighbourSums<Real>& sums) {
  walk_pairs<Real, displacement_packets<Real>>(
      memory.pairs + thread, length, memory.displacements,
      [&](const Real* u_j, Vec3<Real> wx, [[maybe_unused]] int entry) {
        const Vec3<Real> u_ij = Vec3<Real>{u_j[0], u_j[1], u_j[2]} - point.u;
        add_gradient_term(sums.gradient, u_ij, wx);
        if (weighted) add_pull(sums.pull, u_ij, memory.weights[entry * slice_size + thread]);
      });
}

/// Gathers the internal force on a thread's phyxel, without the hourglass force.
template <class Terms, class Real>
__device__ __forceinline__ Vec3<Real> find_force(const ResidentMemory<Real>& memory, int thread,
                                                 int length, Vec3<Real> moment_offset, Mat3<Real> q,
                                                 Vec3<Real> sent) {
  Vec3<Real> sum;
  walk_pairs<Real, stress_packets<Real, Terms::sends>>(
      memory.second_pairs + thread, length, memory.stresses,
      [&](const Real* n, Vec3<Real> wx, [[maybe_unused]] int entry) {
        const Mat3<Real> q_j{{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}, {n[6], n[7], n[8]}}};
        add_neighbour_force(sum, q_j, wx);
        if constexpr (Terms::sends) {
          Terms::add_forces(sum, sent, {n[9], n[10], n[11]},
                            memory.second_weights[entry * slice_size + thread]);
        }
      });
  sum += own_force(q, moment_offset);
  return sum;
}

/// The velocity half a step after the present displacements.
template <class Real, class StateReal>
__device__ __forceinline__ Vec3<StateReal> velocity_after(
    Vec3<StateReal> velocity, Vec3<Real> force, Real inverse_mass, const Fields<Real, StateReal>& f,
    StateReal dt, const TileConstants<Real, StateReal>& body) {
  return body.damped ? next_velocity<Real, StateReal, true>(velocity, force, inverse_mass,
                                                            f.gravity, dt, body)
                     : next_velocity<Real, StateReal, false>(velocity, force, inverse_mass,
                                                             f.gravity, dt, body);
}

// --- the kernel ---------------------------------------------------------------------------------

/// Takes steps. With a trail, half a step more finds the gradients of the last displacements.
/// @param first_tag not used since the mail was last cleared, nor any up to first_tag + 2 steps + 1
/// @tparam Law that of all bodies, `AnyLaw` or `AnyLawWithHistory`
/// @tparam Terms a list of the pair terms that some bodies may have
template <class Real, class StateReal, class Channel, class Law, class Terms>
__global__ void __launch_bounds__(Channel::threads)
    resident_steps(const __grid_constant__ Fields<Real, StateReal> f,
                   const __grid_constant__ ResidentView<Real> r, StateReal dt, int steps,
                   Trail<Real, StateReal> trail, unsigned first_tag) {
  extern __shared__ __align__(16) char shared[];
  const int number = r.slice_of_block[blockIdx.x];
  if (stands_by<Channel, Real>(number)) return;
  const Slice& slice = r.slices[number];
  const int thread = static_cast<int>(threadIdx.x);
  const bool weighted = Terms::sends || (Terms::pulls && r.weights != nullptr);
  const ResidentMemory<Real> memory(shared, r, stress_packets<Real, Terms::sends>,
                                    weights_kept<Terms>(weighted));
  const TileConstants<Real, StateReal> body = f.tiles[slice.first_place / tile_size];
  fetch_tables<Terms>(r, slice, memory, weighted);
  const bool owner = thread < slice_size;
  const std::size_t place = static_cast<std::size_t>(slice.first_place) + (owner ? thread : 0);
  PointConstants<Real> constants{};
  Real inverse_mass{};
  if (owner) {
    fetch_moment(f.moment_constants + place, f.places, constants.inverse_moment, constants.volume);
    constants.moment_offset = column3(f.force_constants, f.places, place);
    if constexpr (Terms::sends) constants.closing = column3(f.closing, f.places, place);
    constants.hourglass = body.hourglass;
    inverse_mass = f.force_constants[3 * f.places + place];
  }
  const bool somebody = owner && inverse_mass != Real(0);
  const int length = length_of(slice, 0, thread), second_length = length_of(slice, 1, thread);
  wait_for_copies();
  Channel channel(r, slice, memory, f.places, first_tag);  // all threads meet
  follow_last_launch();
  typename Points<Real>::Value point{};
  Vec3<StateReal> velocity, displacement;
  Vec3<Real> load;
  const HistoryColumns<Real> history_columns{f.history, f.places, place};
  HistoryRegisters<Real, kept_numbers<Law, Real>> history;
  if (owner) {
    point = f.points.get(place);
    velocity = column3(f.velocity, f.places, place);
    displacement = displacement_at(f, place, point.u);
    if (f.load) load = column3(f.load, f.places, place);
    history.fetch(history_columns, f.history_numbers);
  }
  for (int step = 0; step < steps + (trail.gradients ? 1 : 0); ++step) {
    exchange_displacements(channel, memory.displacements, place, somebody, point.u);
    PointStress<Real> spread;
    if (owner) {
      NeighbourSums<Real> sums;
      gather_sums<Real>(memory, thread, length, point, weighted, sums);
      const Mat3<Real> fit = displacement_gradient(sums.gradient, constants.inverse_moment);
      const Mat3<Real> grad_u = Terms::gradient(fit, sums, constants);
      if (trail.gradients && step > 0) {
        const auto before = static_cast<std::size_t>(step - 1) * f.places;
        for (int e = 0; e < 9; ++e)
          trail.gradients[9 * before + e * f.places + place] = grad_u(e / 3, e % 3);
        set_column3(trail.displacements + 3 * before, f.places, place, displacement);
      }
      const HistoryUse use = step == steps ? HistoryUse::trial : HistoryUse::commit;
      const Mat3<Real> stress = stress_of_material<Law>(body, grad_u, history, use, Real(dt));
      spread = Terms::stresses(stress, fit, sums, constants);
    }
    if (step == steps) break;
    const auto& [q, hourglass_force, t] = spread;
    const Real numbers[] = {q(0, 0), q(0, 1), q(0, 2), q(1, 0), q(1, 1), q(1, 2),
                            q(2, 0), q(2, 1), q(2, 2), t.x,     t.y,     t.z};
    exchange<stress_packets<Real, Terms::sends>>(channel, 1, memory.stresses, place, somebody,
                                                 numbers);
    if (owner) {
      Vec3<Real> sum =
          find_force<Terms>(memory, thread, second_length, constants.moment_offset, q, t);
      if (inverse_mass > Real(0)) {
        if constexpr (Terms::template has<HourglassControl>) sum += hourglass_force;
        if (f.load) sum += load;
        velocity = velocity_after(velocity, sum, inverse_mass, f, dt, body);
        displacement = fused(dt, velocity, displacement);
        point.u = to<Real>(displacement);
      }
    }
  }
  channel.finish();
  if (!somebody) return;
  store_state(f, place, point, velocity, displacement);
  history.put(history_columns, f.history_numbers);
}

}  // namespace phyxel::cuda
