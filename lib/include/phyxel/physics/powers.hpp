/// Logarithms and powers of positive numbers, of scalars and of packs, with the same bits on all
/// devices.
#pragma once

#include "phyxel/physics/symmetric_functions.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// ln x for 2⁻¹²⁷ <= x <= 2¹²⁷, error of a few roundings of the larger of |ln x| and x - 1. Powers
/// of two are taken out by comparisons, since packs have no access to exponents.
template <class Real>
PHYXEL_HD Real log_of(Real x) {
  Real twos{};
  const auto reduce = [&](double exponent, double power) {
    const double half = power * 0.70710678118654757;  // 2^(exponent - ½)
    const Real divided = Real(1 / power) * x, multiplied = Real(power) * x;
    const Real more = twos + Real(exponent), less = twos - Real(exponent);
    const Real large = Real(half), small = Real(1 / half);
    twos = where_larger(x, large, more, where_larger(small, x, less, twos));
    x = where_larger(x, large, divided, where_larger(small, x, multiplied, x));
  };
  reduce(64, 0x1p64), reduce(32, 0x1p32), reduce(16, 0x1p16), reduce(8, 0x1p8);
  reduce(4, 0x1p4), reduce(2, 0x1p2), reduce(1, 0x1p1);
  const Real z = (x - Real(1)) / (x + Real(1));
  return fused(twos, Real(0.69314718055994531), Real(2) * z * artanh_ratio(z * z));
}

/// xᵖ for 0 < x and p > 0: up to 1 with an absolute error of a few roundings times p |ln x|, above
/// with a relative error of that and of xᵖ roundings. Below e⁻⁶⁰ and above e⁶⁰ it is these.
template <class Real>
PHYXEL_HD Real power_of(Real x, Real p) {
  const Real y = p * log_of(x), none = Real(0);
  const Real decay = Real(1) + exp_minus_one(where_larger(y, none, y, -y));
  return where_larger(y, none, Real(1) / decay, decay);
}

}  // namespace phyxel
