/// Records of a phyxel for the two passes, in global memory and as images in shared memory. They
/// consist of 16-byte words, so that one load fetches four floats or two doubles. In an image, word
/// k of all slots is contiguous, so that word k of slot s is in 16-byte column s mod 8.
#pragma once

#include <cuda_runtime.h>

#include <type_traits>

#include "phyxel/types.hpp"
#include "setup/tiling.hpp"

namespace phyxel::cuda {

/// Coordinates of a null slot: its weight is zero for every support, and the square of its distance
/// fits a float.
inline constexpr float far_away = 1e15F;

template <int bytes>
__device__ void copy_async(void* shared, const void* global) {
  const auto to = static_cast<unsigned>(__cvta_generic_to_shared(shared));
  if constexpr (bytes == 16) {
    asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(to), "l"(global));
  } else {
    asm volatile("cp.async.ca.shared.global [%0], [%1], %2;" ::"r"(to), "l"(global), "n"(bytes));
  }
}
__device__ inline void wait_for_copies() { asm volatile("cp.async.wait_all;" ::: "memory"); }

/// Waits until all writes before this launch are visible. A launch that may begin before the
/// previous one has ended (`overlap_attribute`) may read only constants before this call.
__device__ inline void wait_for_last_launch() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.wait;" ::: "memory");
#endif
}
/// Lets the next launch begin, if it is allowed to overlap, once all blocks have called this.
__device__ inline void let_next_launch_begin() {
#if defined(__CUDA_ARCH__) && __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.launch_dependents;");
#endif
}

/// Position and displacement of each tile slot.
template <class Real>
struct Points;

template <>
struct Points<float> {
  static constexpr int bytes = 24;
  float4* x_u;  ///< x, y, z, u_x
  float2* u;    ///< u_y, u_z
  static Points in(void* memory, std::size_t places) {
    auto* words = static_cast<float4*>(memory);
    return {words, reinterpret_cast<float2*>(words + places)};
  }

  struct Value {
    Vec3<float> x, u;
  };
  __device__ Value get(std::size_t place) const { return value(x_u[place], u[place]); }
  __device__ void set(std::size_t place, const Value& v) const {
    x_u[place] = {v.x.x, v.x.y, v.x.z, v.u.x};
    u[place] = {v.u.y, v.u.z};
  }
  /// Starts to copy a tile slot into a slot of an image of `slots` slots.
  __device__ void fetch(char* image, int slots, int slot, Index place) const {
    copy_async<16>(image + 16 * slot, x_u + place);
    copy_async<8>(image + 16 * slots + 8 * slot, u + place);
  }
  __device__ static void set_far(char* image, int slots, int slot) {
    reinterpret_cast<float4*>(image)[slot] = {far_away, far_away, far_away, 0};
    reinterpret_cast<float2*>(image + 16 * slots)[slot] = {0, 0};
  }
  /// Reads a slot of an image. @param offset 16 × slot
  __device__ static Value at(const char* image, int slots, unsigned offset) {
    return value(*reinterpret_cast<const float4*>(image + offset),
                 *reinterpret_cast<const float2*>(image + 16 * slots + offset / 2));
  }

 private:
  __device__ static Value value(float4 a, float2 b) { return {{a.x, a.y, a.z}, {a.w, b.x, b.y}}; }
};

template <>
struct Points<double> {
  static constexpr int bytes = 48;
  double2 *xy, *z_u, *u;
  static Points in(void* memory, std::size_t places) {
    auto* words = static_cast<double2*>(memory);
    return {words, words + places, words + 2 * places};
  }

  struct Value {
    Vec3<double> x, u;
  };
  __device__ Value get(std::size_t place) const { return value(xy[place], z_u[place], u[place]); }
  __device__ void set(std::size_t place, const Value& v) const {
    xy[place] = {v.x.x, v.x.y};
    z_u[place] = {v.x.z, v.u.x};
    u[place] = {v.u.y, v.u.z};
  }
  __device__ void fetch(char* image, int slots, int slot, Index place) const {
    copy_async<16>(image + 16 * slot, xy + place);
    copy_async<16>(image + 16 * (slots + slot), z_u + place);
    copy_async<16>(image + 16 * (2 * slots + slot), u + place);
  }
  __device__ static void set_far(char* image, int slots, int slot) {
    auto* words = reinterpret_cast<double2*>(image);
    words[slot] = {far_away, far_away};
    words[slots + slot] = {far_away, 0};
    words[2 * slots + slot] = {0, 0};
  }
  __device__ static Value at(const char* image, int slots, unsigned offset) {
    const char* word = image + offset;
    return value(*reinterpret_cast<const double2*>(word),
                 *reinterpret_cast<const double2*>(word + 16 * slots),
                 *reinterpret_cast<const double2*>(word + 32 * slots));
  }

 private:
  __device__ static Value value(double2 a, double2 b, double2 c) {
    return {{a.x, a.y, b.x}, {b.y, c.x, c.y}};
  }
};

/// Position and pair stress Q of each tile slot.
template <class Real>
struct Stresses;

template <>
struct Stresses<float> {
  static constexpr int bytes = 48;
  float4 *x_q, *q_a, *q_b;  ///< x, y, z, q8; q0 to q3; q4 to q7
  static Stresses in(void* memory, std::size_t places) {
    auto* words = static_cast<float4*>(memory);
    return {words, words + places, words + 2 * places};
  }

  struct Value {
    Vec3<float> x;
    Mat3<float> q;
  };
  __device__ Value get(std::size_t place) const {
    return value(x_q[place], q_a[place], q_b[place]);
  }
  __device__ void set(std::size_t place, const Value& v) const {
    x_q[place] = {v.x.x, v.x.y, v.x.z, v.q(2, 2)};
    q_a[place] = {v.q(0, 0), v.q(0, 1), v.q(0, 2), v.q(1, 0)};
    q_b[place] = {v.q(1, 1), v.q(1, 2), v.q(2, 0), v.q(2, 1)};
  }
  __device__ void fetch(char* image, int slots, int slot, Index place) const {
    copy_async<16>(image + 16 * slot, x_q + place);
    copy_async<16>(image + 16 * (slots + slot), q_a + place);
    copy_async<16>(image + 16 * (2 * slots + slot), q_b + place);
  }
  __device__ static void set_far(char* image, int slots, int slot) {
    auto* words = reinterpret_cast<float4*>(image);
    words[slot] = {far_away, far_away, far_away, 0};
    words[slots + slot] = words[2 * slots + slot] = {0, 0, 0, 0};
  }
  __device__ static void put(char* image, int slots, int slot, const Value& v) {
    auto* words = reinterpret_cast<float4*>(image);
    Stresses{words, words + slots, words + 2 * slots}.set(static_cast<std::size_t>(slot), v);
  }
  __device__ static Value at(const char* image, int slots, unsigned offset) {
    const char* word = image + offset;
    return value(*reinterpret_cast<const float4*>(word),
                 *reinterpret_cast<const float4*>(word + 16 * slots),
                 *reinterpret_cast<const float4*>(word + 32 * slots));
  }

 private:
  __device__ static Value value(float4 x, float4 a, float4 b) {
    return {{x.x, x.y, x.z}, {{{a.x, a.y, a.z}, {a.w, b.x, b.y}, {b.z, b.w, x.w}}}};
  }
};

template <>
struct Stresses<double> {
  static constexpr int bytes = 96;
  double2* word[6];  ///< x, y; z, q8; q0, q1; q2, q3; q4, q5; q6, q7
  static Stresses in(void* memory, std::size_t places) {
    Stresses s;
    for (int k = 0; k < 6; ++k) s.word[k] = static_cast<double2*>(memory) + k * places;
    return s;
  }

  struct Value {
    Vec3<double> x;
    Mat3<double> q;
  };
  __device__ Value get(std::size_t place) const {
    double2 w[6];
#pragma unroll
    for (int k = 0; k < 6; ++k) w[k] = word[k][place];
    return value(w);
  }
  __device__ void set(std::size_t place, const Value& v) const {
    word[0][place] = {v.x.x, v.x.y};
    word[1][place] = {v.x.z, v.q(2, 2)};
    word[2][place] = {v.q(0, 0), v.q(0, 1)};
    word[3][place] = {v.q(0, 2), v.q(1, 0)};
    word[4][place] = {v.q(1, 1), v.q(1, 2)};
    word[5][place] = {v.q(2, 0), v.q(2, 1)};
  }
  __device__ void fetch(char* image, int slots, int slot, Index place) const {
#pragma unroll
    for (int k = 0; k < 6; ++k) copy_async<16>(image + 16 * (k * slots + slot), word[k] + place);
  }
  __device__ static void set_far(char* image, int slots, int slot) {
    auto* words = reinterpret_cast<double2*>(image);
    words[slot] = {far_away, far_away};
    words[slots + slot] = {far_away, 0};
    for (int k = 2; k < 6; ++k) words[k * slots + slot] = {0, 0};
  }
  __device__ static void put(char* image, int slots, int slot, const Value& v) {
    auto* words = reinterpret_cast<double2*>(image);
    Stresses stresses;
    for (int k = 0; k < 6; ++k) stresses.word[k] = words + k * slots;
    stresses.set(static_cast<std::size_t>(slot), v);
  }
  __device__ static Value at(const char* image, int slots, unsigned offset) {
    double2 w[6];
#pragma unroll
    for (int k = 0; k < 6; ++k) {
      w[k] = *reinterpret_cast<const double2*>(image + offset + 16 * k * slots);
    }
    return value(w);
  }

 private:
  __device__ static Value value(const double2 (&w)[6]) {
    return {{w[0].x, w[0].y, w[1].x},
            {{{w[2].x, w[2].y, w[3].x}, {w[3].y, w[4].x, w[4].y}, {w[5].x, w[5].y, w[1].y}}}};
  }
};

/// Closing stress t of each tile slot, with closed gradients (phyxel/physics/closing.hpp).
template <class Real>
struct ClosingStresses {
  using Word = std::conditional_t<sizeof(Real) == 4, float4, double2>;
  static constexpr int words = sizeof(Real) == 4 ? 1 : 2, bytes = 16 * words;
  Word* word[words];
  static ClosingStresses in(void* memory, std::size_t places) {
    ClosingStresses s;
    for (int k = 0; k < words; ++k) s.word[k] = static_cast<Word*>(memory) + k * places;
    return s;
  }

  __device__ Vec3<Real> get(std::size_t place) const {
    const Word first = word[0][place];
    if constexpr (words == 1) {
      return {first.x, first.y, first.z};
    } else {
      return {first.x, first.y, word[1][place].x};
    }
  }
  __device__ void set(std::size_t place, Vec3<Real> t) const {
    if constexpr (words == 1) {
      word[0][place] = {t.x, t.y, t.z, 0};
    } else {
      word[0][place] = {t.x, t.y};
      word[1][place] = {t.z, 0};
    }
  }
  __device__ void fetch(char* image, int slots, int slot, Index place) const {
#pragma unroll
    for (int k = 0; k < words; ++k)
      copy_async<16>(image + 16 * (k * slots + slot), word[k] + place);
  }
  __device__ static void set_far(char* image, int slots, int slot) {
    for (int k = 0; k < words; ++k) reinterpret_cast<Word*>(image)[k * slots + slot] = {};
  }
  __device__ static Vec3<Real> at(const char* image, int slots, unsigned offset) {
    const auto first = *reinterpret_cast<const Word*>(image + offset);
    if constexpr (words == 1) {
      return {first.x, first.y, first.z};
    } else {
      const auto second = *reinterpret_cast<const Word*>(image + offset + 16 * slots);
      return {first.x, first.y, second.x};
    }
  }
};

/// Stresses of each tile slot with closed gradients, as sent between ranks: those of `Stresses` and
/// the closing stress.
template <class Real>
struct ClosedStresses {
  static constexpr int bytes = Stresses<Real>::bytes + ClosingStresses<Real>::bytes;
  Stresses<Real> stresses;
  ClosingStresses<Real> closing;

  struct Value {
    typename Stresses<Real>::Value stress;
    Vec3<Real> t;
  };
  __device__ Value get(std::size_t place) const {
    return {stresses.get(place), closing.get(place)};
  }
  __device__ void set(std::size_t place, const Value& v) const {
    stresses.set(place, v.stress);
    closing.set(place, v.t);
  }
};

}  // namespace phyxel::cuda
