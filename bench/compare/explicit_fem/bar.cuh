/// The bar, its references, and a step of time.
#pragma once

#include <cmath>

/// Marks functions that run on processors and GPUs.
#define FEM_HD __host__ __device__ __forceinline__

namespace fem {

// The bar of `phyxel accuracy gravity` and `bending`: 1 m long and 0.2 m wide, held at one end.
constexpr double youngs_modulus = 1e6;  ///< [Pa]
constexpr double poissons_ratio = 0.3;
constexpr double density = 1000;  ///< [kg/m³]
constexpr double gravity = 0.1;   ///< [m/s²], across the bar
constexpr double width = 0.2;     ///< [m]
constexpr int cells_along = 5;    ///< Cells along the bar for each one across.

/// Constants of Lamé [Pa].
constexpr float lame_lambda =
    float(youngs_modulus * poissons_ratio / ((1 + poissons_ratio) * (1 - 2 * poissons_ratio)));
constexpr float lame_mu = float(youngs_modulus / (2 * (1 + poissons_ratio)));

/// Results that finer elements approach: those of `phyxel accuracy gravity` and `bending`.
constexpr double reference_deflection = 3.83980e-3;  ///< [m], by which the free end sinks
constexpr double reference_frequency = 0.99945;      ///< [Hz], the first one of bending

constexpr double settling_time = 2.5;  ///< [s], after which the damped bar is at rest
/// Damping that brings the bar to rest soonest [1/s]: critical at 1.00097 Hz. That is within 0.2 %
/// of the first frequency; another value would change the last digits of the deflection.
constexpr double settling_damping = 4 * M_PI * 1.00097;

/// What a step needs beside the mesh, for a damping a [1/s].
struct Step {
  float dt;       ///< [s]
  float gravity;  ///< [m/s²]
  float keep;     ///< (1 - a dt/2) / (1 + a dt/2), the share of the velocity that stays
  float gain;     ///< dt / (1 + a dt/2) [s], the velocity that an acceleration adds
};

/// Returns the constants of a step. @param dt [s] @param g gravity [m/s²] @param a damping [1/s]
inline Step make_step(double dt, double g, double a) {
  return {float(dt), float(g), float((1 - a * dt / 2) / (1 + a * dt / 2)),
          float(dt / (1 + a * dt / 2))};
}

/// Moves a node by a step of symplectic Euler.
/// @param u displacement [m] and, as w, the inverse mass [1/kg], zero where held
/// @param v velocity [m/s]. @param fx, fy, fz force [N]
FEM_HD void advance(float4& u, float4& v, float fx, float fy, float fz, Step step) {
  const float inverse_mass = u.w;
  const float g = inverse_mass > 0 ? step.gravity : 0.f;
  v.x = v.x * step.keep + step.gain * (fx * inverse_mass);
  v.y = v.y * step.keep + step.gain * (fy * inverse_mass);
  v.z = v.z * step.keep + step.gain * (fz * inverse_mass - g);
  u.x += step.dt * v.x;
  u.y += step.dt * v.y;
  u.z += step.dt * v.z;
}

}  // namespace fem
