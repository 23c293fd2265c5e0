/// Principal stretches of a deformation.
#pragma once

#include <cmath>

#include "phyxel/physics/strain.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Singular values of F = I + ∇u in falling order; `smallest` is negative where det F is.
template <class Real>
struct PrincipalStretches {
  Real largest, middle, smallest;
};

/// The principal stretches of a displacement gradient.
/// @param grad_u ∇u = F - I. Stretches are computed from Green's strain, so that small strains keep
/// their digits.
template <class Real>
PHYXEL_HD PrincipalStretches<Real> principal_stretches(const Mat3<Real>& grad_u) {
  using std::acos;
  using std::cos;
  using std::fmax;
  using std::fmin;
  using std::sqrt;
  const Sym3<Real> e = green_strain(grad_u);
  const Real mean = trace(e) / Real(3);
  const Real xx = e.xx - mean, yy = e.yy - mean, zz = e.zz - mean;
  const Real outer = e.xy * e.xy + e.xz * e.xz + e.yz * e.yz;
  const Real p = sqrt((xx * xx + yy * yy + zz * zz + Real(2) * outer) / Real(6));
  Real high = mean, low = mean;
  if (p > Real(0)) {
    const Real det = xx * (yy * zz - e.yz * e.yz) - e.xy * (e.xy * zz - e.yz * e.xz) +
                     e.xz * (e.xy * e.yz - yy * e.xz);
    const Real angle = acos(fmax(Real(-1), fmin(Real(1), det / (Real(2) * p * p * p)))) / Real(3);
    high = mean + Real(2) * p * cos(angle);
    low = mean + Real(2) * p * cos(angle + Real(2.0943951023931953));  // a third of a turn
  }
  // FᵀF = I + 2 E; rounding may make its smallest eigenvalue negative. The comparison keeps NaN,
  // which fmax would hide.
  const auto stretch = [](Real strain) {
    const Real square = Real(1) + Real(2) * strain;
    return square < Real(0) ? Real(0) : sqrt(square);
  };
  const Real smallest = stretch(low);
  return {stretch(high), stretch(Real(3) * mean - high - low),
          volume_change(grad_u) < Real(-1) ? -smallest : smallest};
}

}  // namespace phyxel
