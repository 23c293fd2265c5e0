/// A slender cantilever of known deflection, on which errors of precision, support and spacing are
/// measured.
#pragma once

#include "phyxel/backend.hpp"
#include "phyxel/physics/laws.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/state.hpp"

namespace phyxel::app {

inline constexpr double cantilever_length = 1;     ///< From the fixed to the loaded layer [m].
inline constexpr double cantilever_height = 0.1;   ///< Height and width [m].
inline constexpr double cantilever_shear = 0.025;  ///< Load [N]: deflects it by length / 1000.
inline const Material cantilever_material{.young = 1e6,
                                          .poisson = 0.3,
                                          .density = 1000,
                                          .law = StVenantKirchhoff<double>::name,
                                          .hourglass = 0};

/// Relative change of the deflection from frame to frame at which the beam has settled.
inline constexpr double cantilever_settled = 1e-6;

/// The scene of the beam on a regular lattice along x. The first layer of phyxels is fixed, and the
/// last one carries the shear, along -z. Damping is critical for the first bending mode, whose
/// undamped frequency is that of the Euler-Bernoulli beam, ω = 1.8751² √(E I / (ρ A L⁴)). The time
/// between frames is 1/ω, in which the damped mode decays by e.
/// @param across number of phyxels across height and width
/// @param factor support, in mean distances to the ten nearest of an interior phyxel, so that it is
///   the same in spacings on each cloud
Scene cantilever_scene(int across, double factor);

/// Timoshenko's deflection of the loaded end [m], F L³ / (3 E I) + F L / (κ A G) with
/// κ = 10 (1 + ν) / (12 + 11 ν). Sources: Timoshenko 1921; κ of a rectangle: Cowper 1966.
double timoshenko_deflection();

/// The deflection to which phyxels should converge [m]: 0.9934 of Timoshenko's, in which the
/// clamped end may contract and bulge sideways, unlike fixed phyxels. Source: finite elements in
/// three dimensions, 20-node bricks with reduced integration and a clamped face: 40 x 4 x 4
/// elements give 0.9924; 40 x 6 x 6 and 60 x 8 x 8, refined towards the clamp, 0.9933 and 0.9934.
double known_deflection();

/// A beam at rest under its load.
struct Settled {
  State state;
  double deflection = 0;    ///< Mean deflection of the loaded layer [m].
  double change = 0;        ///< Relative change of the deflection since the last frame.
  std::int64_t frames = 0;  ///< Number of frames.
  std::int64_t steps = 0;   ///< Number of steps.
  double seconds = 0;       ///< Time of the steps [s].
};

/// Steps the beam from its straight rest shape until its deflection has settled. The distance from
/// equilibrium decays by e each frame, or by 1.3 if the beam is twice as soft as Timoshenko's and
/// so overdamped: the remaining error is some millionths, far less than that of the lattice.
/// @param frames number of frames, settled or not; 0 until it has settled. With the same number of
///   frames in two precisions, the difference is rounding alone.
/// @throws DivergedError if it has not settled when the scene ends
Settled settle(const Scene& scene, const Model& model, Backend& backend, std::int64_t frames = 0);

}  // namespace phyxel::app
