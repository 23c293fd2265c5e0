/// Many steps in one launch, for bodies that fit the shared memory of multiprocessors.
///
/// A block owns a slice: 64 phyxels, their state in registers, the weighted distances to their
/// neighbours (which never change) and an image of all displacements and stresses that they need in
/// shared memory. Twice a step blocks send what others need, 16 bytes at a time, and wait for what
/// they need themselves; nobody waits for all. There are two ways:
///
/// - The slices of a body form a cluster: each phyxel is written straight into the images that have
///   a slot for it, and counted by a barrier there (`ClusterPost`). For bodies of up to 16 slices;
///   many such bodies follow one another if they do not fit at once.
/// - Through global memory, with the number of the half step in each 16 bytes; readers ask until
///   that number is there (`MailPost`). For larger bodies; all must fit at once.
///
/// Nothing is overwritten too early: who sends the next has received what only those could send
/// who had read the last.
///
/// Sums run in the order of the tile's lists and through the same functions as in kernels.cuh, so
/// that results are the same to the last bit.
#pragma once

#include "solver/kernels.cuh"
#include "solver/resident_plan.hpp"

namespace phyxel::cuda {

/// 16 bytes of mail: a tag and three floats, or a tag and one double.
struct alignas(16) Letter {
  unsigned long long low, high;
};
__device__ inline void post(Letter* box, Letter letter) {
  asm volatile(
      "{ .reg .b128 both; mov.b128 both, {%1, %2}; st.relaxed.gpu.global.b128 [%0], both; }" ::"l"(
          box),
      "l"(letter.low), "l"(letter.high)
      : "memory");
}
__device__ inline Letter look(const Letter* box) {
  Letter letter;
  asm volatile(
      "{ .reg .b128 both; ld.relaxed.gpu.global.b128 both, [%2]; mov.b128 {%0, %1}, both; }"
      : "=l"(letter.low), "=l"(letter.high)
      : "l"(box)
      : "memory");
  return letter;
}

/// How numbers fill letters.
template <class Real>
struct Mail;

template <>
struct Mail<float> {
  static constexpr int numbers = 3;  ///< A letter.
  __device__ static Letter letter(const float* v, unsigned tag) {
    return {static_cast<unsigned long long>(__float_as_uint(v[1])) << 32 | __float_as_uint(v[0]),
            static_cast<unsigned long long>(tag) << 32 | __float_as_uint(v[2])};
  }
  __device__ static unsigned tag(Letter l) { return static_cast<unsigned>(l.high >> 32); }
  __device__ static void open(const Letter& l, float* v) {
    const auto words = reinterpret_cast<const float4&>(l);
    v[0] = words.x;
    v[1] = words.y;
    v[2] = words.z;
  }
};
template <>
struct Mail<double> {
  static constexpr int numbers = 1;
  __device__ static Letter letter(const double* v, unsigned tag) {
    return {static_cast<unsigned long long>(__double_as_longlong(v[0])), tag};
  }
  __device__ static unsigned tag(Letter l) { return static_cast<unsigned>(l.high); }
  __device__ static void open(const Letter& l, double* v) {
    v[0] = __longlong_as_double(static_cast<long long>(l.low));
  }
};

template <class Real>
inline constexpr int displacement_letters = 3 / Mail<Real>::numbers;
template <class Real>
inline constexpr int stress_letters = 9 / Mail<Real>::numbers;

/// A neighbour of a phyxel: w_ij x_ij and its slot. Whole 16-byte words, with nothing left over.
template <class Real>
struct alignas(16) Pair {
  Vec3<Real> wx;
  std::conditional_t<sizeof(Real) == 4, unsigned, unsigned long long> slot;
};

/// `ResidentPlan` in device memory.
template <class Real>
struct ResidentView {
  const Slice* slices;
  const Index* place;
  const Pair<Real>* pairs;  ///< In the order of `ResidentPlan::entries`.
  const Real* weights;      ///< w_ij of those of the first pass, for hourglass control; or null.
  const std::uint32_t* destinations;
  const int* slice_of_block;  ///< -1: none.
  Letter* displacements;      ///< [letters, places], for mail
  Letter* stresses;           ///< [letters, places]
  int most_slots, most_destinations;
  int longest[2];  ///< Entries a lane may have; the second is 0 where one list serves both passes.
};

/// What surfels need of the phyxels that carry them, after each step of a launch.
template <class Real, class StateReal>
struct Trail {
  Real* gradients;           ///< [steps, 9, places]; null: nothing is wanted.
  StateReal* displacements;  ///< [steps, 3, places]
};

/// Numbers of all slots: letter k of slot s is letters[k * slots + s].
struct SlotImage {
  Letter* letters;
  int slots;
};

/// Where everything is in a block's shared memory.
template <class Real>
struct ResidentMemory {
  SlotImage displacements, stresses;
  Pair<Real>*pairs, *second_pairs;
  Real* weights;                 ///< For hourglass control.
  Index* place_of_slot;          ///< For mail.
  unsigned long long* barriers;  ///< For clusters: two.
  std::uint32_t* destinations;   ///< Likewise.

  __device__ ResidentMemory(char* shared, const ResidentView<Real>& r, bool hourglass) {
    const int slots = r.most_slots;
    displacements = {reinterpret_cast<Letter*>(shared), slots};
    stresses = {displacements.letters + displacement_letters<Real> * slots, slots};
    pairs = reinterpret_cast<Pair<Real>*>(stresses.letters + stress_letters<Real> * slots);
    Pair<Real>* end = pairs + r.longest[0] * slice_size;
    second_pairs = r.longest[1] ? end : pairs;
    end += r.longest[1] * slice_size;
    weights = reinterpret_cast<Real*>(end);
    if (hourglass) end += weight_pairs(r.longest[0]);
    place_of_slot = reinterpret_cast<Index*>(end);
    barriers = reinterpret_cast<unsigned long long*>(end);
    destinations = reinterpret_cast<std::uint32_t*>(barriers + 2);
  }
  /// As many pairs take the room of the weights of `longest` entries a lane.
  __host__ __device__ static int weight_pairs(int longest) {
    return longest * slice_size * static_cast<int>(sizeof(Real)) /
           static_cast<int>(sizeof(Pair<Real>));
  }
  /// @param tail what the way of sending needs
  static int bytes(int most_slots, int longest, int second_longest, bool weights, int tail) {
    const int pairs =
        (longest + second_longest) * slice_size + (weights ? weight_pairs(longest) : 0);
    return most_slots * static_cast<int>(sizeof(Letter)) *
               (displacement_letters<Real> + stress_letters<Real>)+pairs *
               static_cast<int>(sizeof(Pair<Real>)) +
           tail;
  }
};

// --- two ways to send ----------------------------------------------------------------------------

/// Through global memory. All threads fetch, the first `slice_size` compute.
template <class Real>
struct MailPost {
  static constexpr int threads = 128;
  static int bytes(int most_slots, int) { return most_slots * static_cast<int>(sizeof(Index)); }

  const Index* place_of_slot;
  Letter* boxes[2];
  std::size_t places;
  int slots;
  unsigned tag;

  __device__ MailPost(const ResidentView<Real>& r, const Slice& slice,
                      const ResidentMemory<Real>& memory, std::size_t all_places,
                      unsigned first_tag)
      : place_of_slot(memory.place_of_slot),
        boxes{r.displacements, r.stresses},
        places(all_places),
        slots(slice.slots),
        tag(first_tag) {
    for (int s = static_cast<int>(threadIdx.x); s < slice.slots; s += threads) {
      memory.place_of_slot[s] = r.place[slice.first_slot + s];
    }
    __syncthreads();
  }

  /// Writes a phyxel's numbers where all that need them find them. `kind` 0: displacements, 1:
  /// stresses.
  template <int letters>
  __device__ void send(int kind, SlotImage image, std::size_t place, bool somebody,
                       const Real* numbers) {
    if (!somebody) return;
#pragma unroll
    for (int k = 0; k < letters; ++k) {
      const Letter letter = Mail<Real>::letter(numbers + k * Mail<Real>::numbers, tag);
      post(boxes[kind] + k * places + place, letter);
      image.letters[k * image.slots + threadIdx.x] = letter;
    }
  }
  /// Ends when all slots of the image are filled. Each thread asks for several letters at once.
  template <int letters>
  __device__ void receive(int kind, SlotImage image) {
    constexpr int batch = letters >= 9 ? 1 : letters >= 3 ? 3 : 4;  // slots
    for (int first = slice_size + static_cast<int>(threadIdx.x); first < slots;
         first += batch * threads) {
      const Letter* from[batch];
      Letter got[batch * letters];
#pragma unroll
      for (int b = 0; b < batch; ++b) {
        const int slot = first + b * threads;
        const Index place = slot < slots ? place_of_slot[slot] : -1;
        from[b] = place >= 0 ? boxes[kind] + place : nullptr;
#pragma unroll
        for (int k = 0; k < letters; ++k) {
          if (from[b]) got[b * letters + k] = look(from[b] + k * places);
        }
      }
      bool all;
      do {
        all = true;
#pragma unroll
        for (int b = 0; b < batch; ++b) {
#pragma unroll
          for (int k = 0; k < letters; ++k) {
            if (!from[b] || Mail<Real>::tag(got[b * letters + k]) == tag) continue;
            got[b * letters + k] = look(from[b] + k * places);
            all = false;
          }
        }
      } while (!all);
#pragma unroll
      for (int b = 0; b < batch; ++b) {
#pragma unroll
        for (int k = 0; k < letters; ++k) {
          if (from[b]) {
            image.letters[k * image.slots + first + b * threads] = got[b * letters + k];
          }
        }
      }
    }
    ++tag;
    __syncthreads();
  }
  __device__ void finish() {}
};

// Clusters came with compute capability 9; `fits_clusters` asks for it.
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ < 900
#define PHYXEL_CLUSTER_ASM(...) __trap()
#else
#define PHYXEL_CLUSTER_ASM(...) asm volatile(__VA_ARGS__)
#endif

/// Straight into the shared memory of the other blocks of a cluster, which is a body.
template <class Real>
struct ClusterPost {
  static constexpr int threads = slice_size;
  static int bytes(int, int most_destinations) {
    return 2 * static_cast<int>(sizeof(unsigned long long)) +
           (most_destinations > near ? most_destinations - near : 0) * slice_size *
               static_cast<int>(sizeof(std::uint32_t));
  }

  static constexpr int near = 8;  ///< Destinations that a thread keeps in registers.

  /// A slot of another block's image of displacements, and that block's barriers; 0: none.
  struct Destination {
    unsigned slot, bells;
  };
  Destination destination[near];
  const std::uint32_t* more;  ///< The rest, in shared memory.
  int more_count, halo;
  unsigned image;     ///< Of this block's displacements, in shared memory.
  unsigned barriers;  ///< Two.
  unsigned parity = 0;

  __device__ static unsigned address(const void* shared) {
    return static_cast<unsigned>(__cvta_generic_to_shared(shared));
  }
  __device__ static void meet_cluster() {
    PHYXEL_CLUSTER_ASM("barrier.cluster.arrive.aligned; barrier.cluster.wait.aligned;" ::
                           : "memory");
  }

  __device__ ClusterPost(const ResidentView<Real>& r, const Slice& slice,
                         const ResidentMemory<Real>& memory, std::size_t, unsigned)
      : more(memory.destinations),
        more_count(max(0, slice.destinations - near)),
        halo(slice.halo),
        image(address(memory.displacements.letters)),
        barriers(address(memory.barriers)) {
    const std::uint32_t* all = r.destinations + slice.first_destination;
#pragma unroll
    for (int d = 0; d < near; ++d) {
      destination[d] =
          d < slice.destinations ? resolve(all[d * slice_size + threadIdx.x]) : Destination{0, 0};
    }
    for (int k = static_cast<int>(threadIdx.x); k < more_count * slice_size; k += threads) {
      memory.destinations[k] = all[near * slice_size + k];
    }
    if (threadIdx.x == 0) {
      PHYXEL_CLUSTER_ASM("mbarrier.init.shared::cta.b64 [%0], %1;" ::"r"(barriers), "n"(threads));
      PHYXEL_CLUSTER_ASM("mbarrier.init.shared::cta.b64 [%0], %1;" ::"r"(barriers + 8),
                         "n"(threads));
      PHYXEL_CLUSTER_ASM("fence.mbarrier_init.release.cluster;" ::: "memory");
    }
    __syncthreads();
    meet_cluster();
  }

  __device__ Destination resolve(std::uint32_t to) const {
    if (to == nobody) return {0, 0};
    Destination d;
    PHYXEL_CLUSTER_ASM("mapa.shared::cluster.u32 %0, %1, %2;"
                       : "=r"(d.slot)
                       : "r"(image + 16 * (to & 0xFFFF)), "r"(to >> 16));
    PHYXEL_CLUSTER_ASM("mapa.shared::cluster.u32 %0, %1, %2;"
                       : "=r"(d.bells)
                       : "r"(barriers), "r"(to >> 16));
    return d;
  }
  template <int letters>
  __device__ static void send_to(Destination d, int kind, unsigned image_offset, int slots,
                                 const Letter* letter) {
#pragma unroll
    for (int k = 0; k < letters; ++k) {
      const auto words = reinterpret_cast<const uint4&>(letter[k]);
      PHYXEL_CLUSTER_ASM(
          "st.async.shared::cluster.mbarrier::complete_tx::bytes.v4.b32 [%0], {%1, %2, %3, %4}, "
          "[%5];" ::"r"(d.slot + image_offset + 16 * static_cast<unsigned>(k * slots)),
          "r"(words.x), "r"(words.y), "r"(words.z), "r"(words.w),
          "r"(d.bells + 8 * static_cast<unsigned>(kind))
          : "memory");
    }
  }

  template <int letters>
  __device__ void send(int kind, SlotImage to, std::size_t, bool somebody, const Real* numbers) {
    const unsigned offset = address(to.letters) - image;
    const unsigned barrier = barriers + 8 * static_cast<unsigned>(kind);
    Letter letter[letters];
#pragma unroll
    for (int k = 0; k < letters; ++k) {
      letter[k] = Mail<Real>::letter(numbers + k * Mail<Real>::numbers, 0);
    }
    if (somebody) {
#pragma unroll
      for (int d = 0; d < near; ++d) {
        if (destination[d].slot) {
          send_to<letters>(destination[d], kind, offset, to.slots, letter);
        }
      }
      for (int d = 0; d < more_count; ++d) {
        const Destination far = resolve(more[d * slice_size + threadIdx.x]);
        if (far.slot) send_to<letters>(far, kind, offset, to.slots, letter);
      }
#pragma unroll
      for (int k = 0; k < letters; ++k) to.letters[k * to.slots + threadIdx.x] = letter[k];
    }
    if (threadIdx.x == 0) {
      PHYXEL_CLUSTER_ASM("mbarrier.arrive.expect_tx.shared::cta.b64 _, [%0], %1;" ::"r"(barrier),
                         "r"(16 * letters * halo)
                         : "memory");
    } else {
      PHYXEL_CLUSTER_ASM("mbarrier.arrive.shared::cta.b64 _, [%0];" ::"r"(barrier) : "memory");
    }
  }
  template <int letters>
  __device__ void receive(int kind, SlotImage) {
    const unsigned barrier = barriers + 8 * static_cast<unsigned>(kind);
    unsigned done;
    do {
      PHYXEL_CLUSTER_ASM(
          "{ .reg .pred p; mbarrier.try_wait.parity.acquire.cluster.shared::cta.b64 p, [%1], %2; "
          "selp.u32 %0, 1, 0, p; }"
          : "=r"(done)
          : "r"(barrier), "r"(parity)
          : "memory");
    } while (!done);
    if (kind == 1) parity ^= 1;  // each barrier is waited for once a step
  }
  /// Nobody leaves while others may still write to them.
  __device__ void finish() { meet_cluster(); }
  /// A block of the cluster without a slice.
  __device__ static void stand_by() {
    meet_cluster();
    meet_cluster();
  }
};

// --- the steps -----------------------------------------------------------------------------------

/// The weighted distances of all slices, one block each: for the first pass by the phyxel's
/// support, for the second by the neighbour's. @param weights of the first pass, where wanted
template <class Real, class StateReal>
__global__ void weigh_pairs(const __grid_constant__ Fields<Real, StateReal> f, const Slice* slices,
                            const Index* place, const std::uint16_t* entries, int passes,
                            Pair<Real>* pairs, Real* weights) {
  const Slice& slice = slices[blockIdx.x];
  const Real body_support = f.tiles[slice.first_place / tile_size].inverse_h_squared;
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
        const Real inverse_h_squared =
            f.inverse_h_squared ? f.inverse_h_squared[pass == 0 ? own : other] : body_support;
        weight = weight_shape_anywhere(dot(x, x), inverse_h_squared);
        pair = {weight * x, entry};
      }
      pairs[rows.first_entry + k] = pair;
      if (weights && pass == 0) weights[rows.first_entry + k] = weight;
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

/// The same of the first pass's weights.
template <class Real>
__device__ void fetch_weights(const ResidentView<Real>& r, const Slice::Rows& rows, Real* weights) {
  constexpr int each = 16 / sizeof(Real);
  const Real* from = r.weights + rows.first_entry;
  for (int k = static_cast<int>(threadIdx.x) * each; k < rows.longest * slice_size;
       k += static_cast<int>(blockDim.x) * each) {
    copy_async<16>(weights + k, from + k);
  }
}

/// Calls visit(numbers of the neighbour, w x, number of the entry) in the order of the list, with
/// the next group's pairs under way. A longer loop, with the next group's numbers under way too, is
/// slower: a warp or two on a multiprocessor wait for its instructions.
template <class Real, int letters, class Visit>
__device__ void walk_pairs(const Pair<Real>* pairs, int length, SlotImage image, Visit&& visit) {
  constexpr int numbers = letters * Mail<Real>::numbers;
  if (length == 0) return;  // then there may be no table
  Pair<Real> ahead[pair_group];
#pragma unroll
  for (int k = 0; k < pair_group; ++k) ahead[k] = pairs[k * slice_size];
#pragma unroll 1
  for (int left = length; left > 0; left -= pair_group) {
    Letter got[pair_group][letters];
    Vec3<Real> wx[pair_group];
#pragma unroll
    for (int k = 0; k < pair_group; ++k) {
      wx[k] = ahead[k].wx;
#pragma unroll
      for (int l = 0; l < letters; ++l)
        got[k][l] = image.letters[l * image.slots + static_cast<int>(ahead[k].slot)];
    }
    pairs += pair_group * slice_size;
    if (left > pair_group) {
#pragma unroll
      for (int k = 0; k < pair_group; ++k) ahead[k] = pairs[k * slice_size];
    }
#pragma unroll
    for (int k = 0; k < pair_group; ++k) {
      Real n[numbers];
#pragma unroll
      for (int l = 0; l < letters; ++l) Mail<Real>::open(got[k][l], n + l * Mail<Real>::numbers);
      visit(n, wx[k], length - left + k);
    }
  }
}

/// @param first_tag not used since the mail was last cleared, nor any up to first_tag + 2 steps + 1
/// @tparam Law that of all bodies, or `AnyLaw`. @tparam controlled some bodies may have hourglass
///   control
template <class Real, class StateReal, class Post, class Law, bool controlled>
__global__ void __launch_bounds__(Post::threads)
    resident_steps(const __grid_constant__ Fields<Real, StateReal> f,
                   const __grid_constant__ ResidentView<Real> r, StateReal dt, int steps,
                   Trail<Real, StateReal> trail, unsigned first_tag) {
  constexpr int u_letters = displacement_letters<Real>, q_letters = stress_letters<Real>;
  extern __shared__ __align__(16) char shared[];
  const int number = r.slice_of_block[blockIdx.x];
  if constexpr (std::is_same_v<Post, ClusterPost<Real>>) {
    if (number < 0) {
      Post::stand_by();
      return;
    }
  }
  const Slice& slice = r.slices[number];
  const int thread = static_cast<int>(threadIdx.x);
  const bool hourglass = controlled && r.weights;
  const ResidentMemory<Real> memory(shared, r, hourglass);
  const TileConstants<Real, StateReal> body = f.tiles[slice.first_place / tile_size];
  fetch_pairs(r, slice.rows[0], memory.pairs);
  if (hourglass) fetch_weights(r, slice.rows[0], memory.weights);
  if (r.longest[1]) fetch_pairs(r, slice.rows[1], memory.second_pairs);
  const bool owner = thread < slice_size;
  const std::size_t place = static_cast<std::size_t>(slice.first_place) + (owner ? thread : 0);
  Sym3<Real> inverse_moment;
  Vec3<Real> moment_offset;
  Real volume{}, inverse_mass{};
  if (owner) {
    const Real* c = f.moment_constants + place;
    inverse_moment = {
        c[0], c[f.places], c[2 * f.places], c[3 * f.places], c[4 * f.places], c[5 * f.places]};
    volume = c[6 * f.places];
    moment_offset = column3(f.force_constants, f.places, place);
    inverse_mass = f.force_constants[3 * f.places + place];
  }
  const bool somebody = owner && inverse_mass != Real(0);
  const int warp = thread / warp_size;
  const int length = owner ? slice.rows[0].length[warp] : 0;
  const int second_length = owner ? slice.rows[1].length[warp] : 0;
  wait_for_copies();
  Post post(r, slice, memory, f.places, first_tag);  // all threads meet

  let_next_launch_begin();
  wait_for_last_launch();
  typename Points<Real>::Value point{};
  Vec3<StateReal> velocity, displacement;
  Vec3<Real> load;
  if (owner) {
    point = f.points.get(place);
    velocity = column3(f.velocity, f.places, place);
    if constexpr (std::is_same_v<Real, StateReal>) {
      displacement = point.u;
    } else {
      displacement = column3(f.displacement, f.places, place);
    }
    if (f.load) load = column3(f.load, f.places, place);
  }
  // Half a step more for the gradients of the last displacements.
  for (int step = 0; step < steps + (trail.gradients ? 1 : 0); ++step) {
    const Real u[] = {point.u.x, point.u.y, point.u.z};
    post.template send<u_letters>(0, memory.displacements, place, somebody, u);
    post.template receive<u_letters>(0, memory.displacements);
    Mat3<Real> q;
    [[maybe_unused]] Vec3<Real> pull;
    if (owner) {
      Mat3<Real> sum;
      walk_pairs<Real, u_letters>(
          memory.pairs + thread, length, memory.displacements,
          [&](const Real* u_j, Vec3<Real> wx, [[maybe_unused]] int entry) {
            const Vec3<Real> u_ij = Vec3<Real>{u_j[0], u_j[1], u_j[2]} - point.u;
            add_gradient_term(sum, u_ij, wx);
            if (hourglass) {
              add_pull(pull, u_ij, memory.weights[entry * slice_size + thread]);
            }
          });
      const Mat3<Real> grad_u = displacement_gradient(sum, inverse_moment);
      if (trail.gradients && step > 0) {
        const auto before = static_cast<std::size_t>(step - 1) * f.places;
        for (int e = 0; e < 9; ++e) {
          trail.gradients[9 * before + e * f.places + place] = grad_u(e / 3, e % 3);
        }
        set_column3(trail.displacements + 3 * before, f.places, place, displacement);
      }
      q = pair_stress(volume, first_piola_stress_of<Law>(body, grad_u), inverse_moment);
      if (hourglass) {
        q = with_hourglass(q, body.hourglass, grad_u);
        pull = pull_force(body.hourglass, pull);
      }
    }
    if (step == steps) break;
    const Real numbers[] = {q(0, 0), q(0, 1), q(0, 2), q(1, 0), q(1, 1),
                            q(1, 2), q(2, 0), q(2, 1), q(2, 2)};
    post.template send<q_letters>(1, memory.stresses, place, somebody, numbers);
    post.template receive<q_letters>(1, memory.stresses);
    if (owner) {
      Vec3<Real> sum;
      walk_pairs<Real, q_letters>(
          memory.second_pairs + thread, second_length, memory.stresses,
          [&](const Real* n, Vec3<Real> wx, int) {
            const Mat3<Real> q_j{{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}, {n[6], n[7], n[8]}}};
            add_neighbour_force(sum, q_j, wx);
          });
      sum += own_force(q, moment_offset);
      if (inverse_mass > Real(0)) {
        if (hourglass) sum += pull;
        if (f.load) sum += load;
        velocity = body.damped ? next_velocity<Real, StateReal, true>(velocity, sum, inverse_mass,
                                                                      f.gravity, dt, body)
                               : next_velocity<Real, StateReal, false>(velocity, sum, inverse_mass,
                                                                       f.gravity, dt, body);
        displacement = fused(dt, velocity, displacement);
        point.u = to<Real>(displacement);
      }
    }
  }

  post.finish();
  if (!somebody) return;
  f.points.set(place, point);
  set_column3(f.velocity, f.places, place, velocity);
  if constexpr (!std::is_same_v<Real, StateReal>) {
    set_column3(f.displacement, f.places, place, displacement);
  }
}

}  // namespace phyxel::cuda
