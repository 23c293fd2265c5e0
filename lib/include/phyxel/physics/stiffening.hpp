/// How stiff a law is where it is deformed. A plane wave of direction b (at rest) and polarisation
/// a has the displacement gradient a bᵀ, and sees the stiffness a bᵀ : ∂P/∂F : a bᵀ, the quadratic
/// form of the acoustic tensor; geometric stress is part of it. On a lattice of phyxels the fastest
/// mode is such a wave, so that the largest eigenvalue of M⁻¹K grows as the largest stiffness of
/// all waves does: λ + 2μ at rest. (The largest eigenvalue of ∂P/∂F itself would not do: at rest it
/// belongs to a change of volume, 3λ + 2μ, and grows less than that of waves.)
///
/// Every law here is isotropic, so its bound depends on the principal stretches alone and does not
/// change with the frame. det F is linear along a bᵀ: a function g of it adds g'' (a · cof F b)².
#pragma once

#include <cmath>

#include "phyxel/physics/stress.hpp"

namespace phyxel {

/// Singular values of F = I + ∇u in falling order; `smallest` is negative where det F is.
template <class Real>
struct PrincipalStretches {
  Real largest, middle, smallest;
};

/// @param grad_u ∇u = F - I. ChunkedSource are found from Green's strain, so that small strains
/// keep
///   their digits.
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
  // FᵀF = I + 2 E; rounding may make its smallest eigenvalue negative. What is not a number stays
  // so, which fmax would hide.
  const auto stretch = [](Real strain) {
    const Real square = Real(1) + Real(2) * strain;
    return square < Real(0) ? Real(0) : sqrt(square);
  };
  const Real smallest = stretch(low);
  return {stretch(high), stretch(Real(3) * mean - high - low),
          volume_change(grad_u) < Real(-1) ? -smallest : smallest};
}

/// λ + 2μ [Pa], the stiffness of pressure waves at rest.
template <class Real>
PHYXEL_HD Real wave_stiffness_at_rest(const Hooke<Real>& hooke) {
  return hooke.lambda + Real(2) * hooke.mu;
}

/// An upper bound of the stiffness of all plane waves [Pa].
/// St Venant–Kirchhoff: b·S b + (λ + μ)(Fᵀa · b)² + μ |Fᵀa|², largest along the largest stretch.
template <class Real>
PHYXEL_HD Real wave_stiffness(const GreenHooke<Real>& law, const PrincipalStretches<Real>& s) {
  const auto strain = [](Real stretch) { return Real(0.5) * (stretch * stretch - Real(1)); };
  const Real all = strain(s.largest) + strain(s.middle) + strain(s.smallest);
  const Real stress = law.hooke.lambda * all + Real(2) * law.hooke.mu * strain(s.largest);
  return wave_stiffness_at_rest(law.hooke) * s.largest * s.largest + stress;
}

/// Cauchy's strain is linear: as at rest.
template <class Real>
PHYXEL_HD Real wave_stiffness(const CauchyHooke<Real>& law, const PrincipalStretches<Real>&) {
  return wave_stiffness_at_rest(law.hooke);
}

/// Neo-Hooke: μ' (1 - 1/(I + 1)) + 2 μ' (a · F b)² / (I + 1)² + λ' (a · cof F b)², each term at its
/// own largest.
template <class Real>
PHYXEL_HD Real wave_stiffness(const NeoHooke<Real>& law, const PrincipalStretches<Real>& s) {
  const Real square = s.largest * s.largest, area = s.largest * s.middle;
  const Real more = Real(1) / (Real(1) + square + s.middle * s.middle + s.smallest * s.smallest);
  return law.shear() * (Real(1) - more + Real(2) * square * more * more) + law.bulk() * area * area;
}

/// Corotated: 2μ + λ (R : a bᵀ)² + (λ (tr S - 3) - 2μ) dR : a bᵀ. With c = R a, in the frame of S,
/// (R : a bᵀ)² is (c · b)², and dR : a bᵀ is Σ (c_i b_j - c_j b_i)² / (σ_i + σ_j), between 1 - (c ·
/// b)² over the largest and over the smallest sum of two stretches; all is linear in (c · b)².
template <class Real>
PHYXEL_HD Real wave_stiffness(const CorotatedHooke<Real>& law, const PrincipalStretches<Real>& s) {
  using std::fmax;
  const Real two_mu = Real(2) * law.hooke.mu;
  const Real turning = law.hooke.lambda * (s.largest + s.middle + s.smallest - Real(3)) - two_mu;
  // Where two stretches cancel, the rotation jumps: no step resolves that.
  const Real least(0.01F);
  const Real across = turning > Real(0) ? turning / fmax(s.middle + s.smallest, least)
                                        : turning / fmax(s.largest + s.middle, least);
  return two_mu + fmax(law.hooke.lambda, across);
}

/// Volume conservation: k_v (a · cof F b)².
template <class Real>
PHYXEL_HD Real wave_stiffness(const VolumeConservation<Real>& law,
                              const PrincipalStretches<Real>& s) {
  const Real area = s.largest * s.middle;
  return law.stiffness * area * area;
}

/// How many times as stiff as at rest a material of our own laws is at most: 1 at rest.
template <class Real>
PHYXEL_HD Real stiffening(Elasticity elasticity, const Hooke<Real>& hooke, Real volume_stiffness,
                          const PrincipalStretches<Real>& s) {
  const Real elastic =
      with_law(elasticity, hooke, [&](const auto& law) { return wave_stiffness(law, s); });
  const Real volume = wave_stiffness(VolumeConservation<Real>{volume_stiffness}, s);
  return (elastic + volume) / (wave_stiffness_at_rest(hooke) + volume_stiffness);
}

}  // namespace phyxel
