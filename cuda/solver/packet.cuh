/// Packets of 16 bytes, which the blocks of one launch send each other and which are written and
/// read atomically.
#pragma once

#include <cuda_runtime.h>

namespace phyxel::cuda {

/// A tag and three floats, or a tag and one double.
struct alignas(16) Packet {
  unsigned long long low, high;
};
/// Stores a packet in global memory in one piece.
__device__ inline void store_packet(Packet* to, Packet packet) {
  asm volatile(
      "{ .reg .b128 both; mov.b128 both, {%1, %2}; st.relaxed.gpu.global.b128 [%0], both; }" ::"l"(
          to),
      "l"(packet.low), "l"(packet.high)
      : "memory");
}
/// Loads a packet from global memory in one piece.
__device__ inline Packet load_packet(const Packet* from) {
  Packet packet;
  asm volatile(
      "{ .reg .b128 both; ld.relaxed.gpu.global.b128 both, [%2]; mov.b128 {%0, %1}, both; }"
      : "=l"(packet.low), "=l"(packet.high)
      : "l"(from)
      : "memory");
  return packet;
}

/// The layout of numbers in packets.
template <class Real>
struct Packing;

template <>
struct Packing<float> {
  static constexpr int numbers = 3;  ///< Numbers of one packet.
  __device__ static Packet packed(const float* v, unsigned tag) {
    return {static_cast<unsigned long long>(__float_as_uint(v[1])) << 32 | __float_as_uint(v[0]),
            static_cast<unsigned long long>(tag) << 32 | __float_as_uint(v[2])};
  }
  __device__ static unsigned tag(Packet p) { return static_cast<unsigned>(p.high >> 32); }
  __device__ static void unpack(const Packet& p, float* v) {
    const auto words = reinterpret_cast<const float4&>(p);
    v[0] = words.x;
    v[1] = words.y;
    v[2] = words.z;
  }
};
template <>
struct Packing<double> {
  static constexpr int numbers = 1;
  __device__ static Packet packed(const double* v, unsigned tag) {
    return {static_cast<unsigned long long>(__double_as_longlong(v[0])), tag};
  }
  __device__ static unsigned tag(Packet p) { return static_cast<unsigned>(p.high); }
  __device__ static void unpack(const Packet& p, double* v) {
    v[0] = __longlong_as_double(static_cast<long long>(p.low));
  }
};

/// Packets of a phyxel's displacement.
template <class Real>
inline constexpr int displacement_packets = 3 / Packing<Real>::numbers;
/// Packets of a phyxel's pair stress, and of its closing stress with closed gradients.
template <class Real, bool closed>
inline constexpr int stress_packets = (closed ? 12 : 9) / Packing<Real>::numbers;

}  // namespace phyxel::cuda
