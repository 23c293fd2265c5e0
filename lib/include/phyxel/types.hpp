/// Small vectors and matrices shared by host and device code.
///
/// Everything here is a plain value templated on the scalar type `Real`, which may be `float`,
/// `double`, or a SIMD pack of either (see lib/solver/pack.hpp): the physics in `phyxel/physics/`
/// is written once for these types. Public headers have no Eigen types, whose alignment depends on
/// the compiler flags of the including program.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#if defined(__CUDACC__)
#define PHYXEL_HD __host__ __device__ __forceinline__
#else
#define PHYXEL_HD inline __attribute__((always_inline))
#endif

namespace phyxel {

/// Three components.
template <class Real>
struct Vec3 {
  Real x{}, y{}, z{};
};

/// 3x3 matrix, row-major: `a[row][column]`.
template <class Real>
struct Mat3 {
  Real a[3][3]{};
  PHYXEL_HD Real& operator()(int row, int column) { return a[row][column]; }
  PHYXEL_HD const Real& operator()(int row, int column) const { return a[row][column]; }
};

/// Symmetric 3x3 matrix, upper triangle.
template <class Real>
struct Sym3 {
  Real xx{}, xy{}, xz{}, yy{}, yz{}, zz{};
};

/// Conversion to another precision.
template <class To, class From>
PHYXEL_HD Vec3<To> to(const Vec3<From>& v) {
  return {static_cast<To>(v.x), static_cast<To>(v.y), static_cast<To>(v.z)};
}

/// The same in another precision.
template <class To, class From>
PHYXEL_HD Mat3<To> to(const Mat3<From>& m) {
  Mat3<To> out;
  for (int e = 0; e < 9; ++e) out(e / 3, e % 3) = static_cast<To>(m(e / 3, e % 3));
  return out;
}

/// In double.
using Vec3d = Vec3<double>;
/// In double.
using Mat3d = Mat3<double>;
/// In double.
using Sym3d = Sym3<double>;
using Index = std::int32_t;   ///< index of a phyxel, surfel or triangle on one rank
using Offset = std::int64_t;  ///< offset into a list of pairs; never 32-bit

/// a > b ? yes : no; lane by lane for packs.
template <class R>
PHYXEL_HD R where_larger(R a, R b, R yes, R no) {
  return a > b ? yes : no;
}

/// a b + c. On a GPU rounded once, always: left to the compiler, it would depend on what surrounds
/// the expression, and two kernels would not agree to the last bit. With PHYXEL_UNFUSED rounded
/// twice, as a CPU without such an instruction does.
template <class R>
PHYXEL_HD R fused(R a, R b, R c) {
#if defined(__CUDA_ARCH__) && !defined(PHYXEL_UNFUSED)
  return fma(a, b, c);
#else
  return a * b + c;
#endif
}

// --- Vec3 ---------------------------------------------------------------------------------------
template <class R>
PHYXEL_HD Vec3<R> operator+(Vec3<R> a, Vec3<R> b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class R>
PHYXEL_HD Vec3<R> operator-(Vec3<R> a, Vec3<R> b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class R>
PHYXEL_HD Vec3<R> operator-(Vec3<R> a) {
  return {-a.x, -a.y, -a.z};
}
template <class R>
PHYXEL_HD Vec3<R> operator*(R s, Vec3<R> a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class R>
PHYXEL_HD Vec3<R> operator*(Vec3<R> a, R s) {
  return {a.x * s, a.y * s, a.z * s};
}
template <class R>
PHYXEL_HD Vec3<R> operator/(Vec3<R> a, R s) {
  return {a.x / s, a.y / s, a.z / s};
}
template <class R>
PHYXEL_HD Vec3<R>& operator+=(Vec3<R>& a, Vec3<R> b) {
  return a = a + b;
}
template <class R>
PHYXEL_HD Vec3<R>& operator-=(Vec3<R>& a, Vec3<R> b) {
  return a = a - b;
}
template <class R>
PHYXEL_HD bool operator==(const Vec3<R>& a, const Vec3<R>& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z;
}
/// a · b.
template <class R>
PHYXEL_HD R dot(Vec3<R> a, Vec3<R> b) {
  return fused(a.z, b.z, fused(a.y, b.y, a.x * b.x));
}
/// s a + b.
template <class R>
PHYXEL_HD Vec3<R> fused(R s, Vec3<R> a, Vec3<R> b) {
  return {fused(s, a.x, b.x), fused(s, a.y, b.y), fused(s, a.z, b.z)};
}
/// a × b.
template <class R>
PHYXEL_HD Vec3<R> cross(Vec3<R> a, Vec3<R> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// Component by component.
inline Vec3d by_components(Vec3d a, Vec3d b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
/// The component along an axis, 0 to 2.
inline double component(Vec3d a, int axis) { return axis == 0 ? a.x : axis == 1 ? a.y : a.z; }
/// |a|.
inline double norm(Vec3d a) { return std::sqrt(dot(a, a)); }
/// Unit vector along `a`; the zero vector stays zero.
inline Vec3d normalised(Vec3d a) {
  const double length = norm(a);
  return length > 0 ? a / length : Vec3d{};
}
/// True if no component is NaN or infinite.
inline bool is_finite(Vec3d a) {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

// --- Mat3 ---------------------------------------------------------------------------------------
/// I.
template <class R>
PHYXEL_HD Mat3<R> identity() {
  Mat3<R> m;
  m(0, 0) = m(1, 1) = m(2, 2) = R(1);
  return m;
}
template <class R>
PHYXEL_HD Mat3<R> operator+(const Mat3<R>& p, const Mat3<R>& q) {
  Mat3<R> m;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m(r, c) = p(r, c) + q(r, c);
  return m;
}
template <class R>
PHYXEL_HD Mat3<R> operator-(const Mat3<R>& p, const Mat3<R>& q) {
  Mat3<R> m;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m(r, c) = p(r, c) - q(r, c);
  return m;
}
template <class R>
PHYXEL_HD Mat3<R>& operator+=(Mat3<R>& p, const Mat3<R>& q) {
  return p = p + q;
}
template <class R>
PHYXEL_HD Mat3<R> operator*(R s, const Mat3<R>& q) {
  Mat3<R> m;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m(r, c) = s * q(r, c);
  return m;
}
template <class R>
PHYXEL_HD Mat3<R> operator*(const Mat3<R>& p, const Mat3<R>& q) {
  Mat3<R> m;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      m(r, c) = fused(p(r, 2), q(2, c), fused(p(r, 1), q(1, c), p(r, 0) * q(0, c)));
  return m;
}
template <class R>
PHYXEL_HD Vec3<R> operator*(const Mat3<R>& m, Vec3<R> v) {
  const auto row = [&](int r) { return fused(m(r, 2), v.z, fused(m(r, 1), v.y, m(r, 0) * v.x)); };
  return {row(0), row(1), row(2)};
}
/// s p + q.
template <class R>
PHYXEL_HD Mat3<R> fused(R s, const Mat3<R>& p, const Mat3<R>& q) {
  Mat3<R> m;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m(r, c) = fused(s, p(r, c), q(r, c));
  return m;
}
/// p q + m.
template <class R>
PHYXEL_HD Mat3<R> fused(const Mat3<R>& p, const Mat3<R>& q, Mat3<R> m) {
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c)
      m(r, c) = fused(p(r, 2), q(2, c), fused(p(r, 1), q(1, c), fused(p(r, 0), q(0, c), m(r, c))));
  return m;
}
/// qᵀ.
template <class R>
PHYXEL_HD Mat3<R> transpose(const Mat3<R>& q) {
  Mat3<R> m;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m(r, c) = q(c, r);
  return m;
}
/// Tensor product a bᵀ.
template <class R>
PHYXEL_HD Mat3<R> outer(Vec3<R> a, Vec3<R> b) {
  return {{{a.x * b.x, a.x * b.y, a.x * b.z},
           {a.y * b.x, a.y * b.y, a.y * b.z},
           {a.z * b.x, a.z * b.y, a.z * b.z}}};
}
/// a bᵀ + m.
template <class R>
PHYXEL_HD Mat3<R> fused_outer(Vec3<R> a, Vec3<R> b, Mat3<R> m) {
  m(0, 0) = fused(a.x, b.x, m(0, 0));
  m(0, 1) = fused(a.x, b.y, m(0, 1));
  m(0, 2) = fused(a.x, b.z, m(0, 2));
  m(1, 0) = fused(a.y, b.x, m(1, 0));
  m(1, 1) = fused(a.y, b.y, m(1, 1));
  m(1, 2) = fused(a.y, b.z, m(1, 2));
  m(2, 0) = fused(a.z, b.x, m(2, 0));
  m(2, 1) = fused(a.z, b.y, m(2, 1));
  m(2, 2) = fused(a.z, b.z, m(2, 2));
  return m;
}
namespace detail {
/// a b - c d.
template <class R>
PHYXEL_HD R minor(R a, R b, R c, R d) {
  return fused(a, b, -(c * d));
}
}  // namespace detail
/// Cofactor matrix, det(m) m⁻ᵀ: the derivative of the determinant.
template <class R>
PHYXEL_HD Mat3<R> cofactor(const Mat3<R>& m) {
  using detail::minor;
  Mat3<R> c;
  c(0, 0) = minor(m(1, 1), m(2, 2), m(1, 2), m(2, 1));
  c(0, 1) = minor(m(1, 2), m(2, 0), m(1, 0), m(2, 2));
  c(0, 2) = minor(m(1, 0), m(2, 1), m(1, 1), m(2, 0));
  c(1, 0) = minor(m(2, 1), m(0, 2), m(2, 2), m(0, 1));
  c(1, 1) = minor(m(2, 2), m(0, 0), m(2, 0), m(0, 2));
  c(1, 2) = minor(m(2, 0), m(0, 1), m(2, 1), m(0, 0));
  c(2, 0) = minor(m(0, 1), m(1, 2), m(0, 2), m(1, 1));
  c(2, 1) = minor(m(0, 2), m(1, 0), m(0, 0), m(1, 2));
  c(2, 2) = minor(m(0, 0), m(1, 1), m(0, 1), m(1, 0));
  return c;
}
/// det m.
template <class R>
PHYXEL_HD R determinant(const Mat3<R>& m) {
  using detail::minor;
  const R a = minor(m(1, 1), m(2, 2), m(1, 2), m(2, 1)),
          b = minor(m(1, 2), m(2, 0), m(1, 0), m(2, 2)),
          c = minor(m(1, 0), m(2, 1), m(1, 1), m(2, 0));
  return fused(m(0, 2), c, fused(m(0, 1), b, m(0, 0) * a));
}

// --- Sym3 ---------------------------------------------------------------------------------------
template <class R>
PHYXEL_HD Sym3<R> operator+(const Sym3<R>& p, const Sym3<R>& q) {
  return {p.xx + q.xx, p.xy + q.xy, p.xz + q.xz, p.yy + q.yy, p.yz + q.yz, p.zz + q.zz};
}
template <class R>
PHYXEL_HD Sym3<R>& operator+=(Sym3<R>& p, const Sym3<R>& q) {
  return p = p + q;
}
template <class R>
PHYXEL_HD Sym3<R> operator*(R s, const Sym3<R>& q) {
  return {s * q.xx, s * q.xy, s * q.xz, s * q.yy, s * q.yz, s * q.zz};
}
/// tr s.
template <class R>
PHYXEL_HD R trace(const Sym3<R>& s) {
  return s.xx + s.yy + s.zz;
}
/// Double contraction p : q.
template <class R>
PHYXEL_HD R contract(const Sym3<R>& p, const Sym3<R>& q) {
  const R off_diagonal = fused(p.yz, q.yz, fused(p.xz, q.xz, p.xy * q.xy));
  const R diagonal = fused(p.zz, q.zz, fused(p.yy, q.yy, p.xx * q.xx));
  return fused(R(2), off_diagonal, diagonal);
}
/// The nine entries as a `Mat3`.
template <class R>
PHYXEL_HD Mat3<R> full(const Sym3<R>& s) {
  Mat3<R> m;
  m(0, 0) = s.xx;
  m(0, 1) = s.xy;
  m(0, 2) = s.xz;
  m(1, 0) = s.xy;
  m(1, 1) = s.yy;
  m(1, 2) = s.yz;
  m(2, 0) = s.xz;
  m(2, 1) = s.yz;
  m(2, 2) = s.zz;
  return m;
}
template <class R>
PHYXEL_HD Vec3<R> operator*(const Sym3<R>& s, Vec3<R> v) {
  return full(s) * v;
}
template <class R>
PHYXEL_HD Mat3<R> operator*(const Mat3<R>& m, const Sym3<R>& s) {
  return m * full(s);
}

}  // namespace phyxel
