/// A slender cantilever whose deflection is known: what the error of a precision, a support and a
/// spacing is measured on.
#pragma once

#include "phyxel/backend.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/state.hpp"

namespace phyxel::app {

inline constexpr double cantilever_length = 1;     ///< From the held layer to the loaded one [m].
inline constexpr double cantilever_height = 0.1;   ///< And width [m].
inline constexpr double cantilever_shear = 0.025;  ///< [N]: bends it by a thousandth of its length.
inline const Material cantilever_material{
    .young = 1e6, .poisson = 0.3, .density = 1000, .hourglass = 0};

/// Change of the deflection from frame to frame, as a share of it, at which it has settled.
inline constexpr double cantilever_settled = 1e-6;

/// The beam on a regular lattice along x: its first layer of phyxels is held, its last one carries
/// the shear, along -z. Damping is critical for the first bending mode, whose undamped frequency
/// is that of Euler's and Bernoulli's beam, ω = 1.8751² √(E I / (ρ A L⁴)). A frame is due every
/// 1/ω, in which the damped mode decays by e.
/// @param across phyxels across height and width
/// @param factor of the support, times the mean distance to the ten nearest deep inside the
///   lattice: the same in spacings on every cloud, whatever its share of surface
Scene cantilever_scene(int across, double factor);

/// Timoshenko's deflection of the loaded end [m], F L³ / (3 E I) + F L / (κ A G) with
/// κ = 10 (1 + ν) / (12 + 11 ν). Sources: Timoshenko 1921; κ of a rectangle: Cowper 1966.
double timoshenko_deflection();

/// The deflection that phyxels are to converge to [m]: 0.9934 of Timoshenko's, which lets the held
/// end contract and bulge sideways, as held phyxels cannot. Source: finite elements in three
/// dimensions, 20-node bricks with reduced integration, first face clamped; 40 x 4 x 4 of them
/// give 0.9924, 40 x 6 x 6 and 60 x 8 x 8, finer towards the clamp, 0.9933 and 0.9934.
double known_deflection();

/// A beam at rest under its load.
struct Settled {
  State state;
  double deflection = 0;    ///< Mean of the loaded layer [m].
  double change = 0;        ///< Of it since the frame before, as a share of it.
  std::int64_t frames = 0;  ///< Taken.
  std::int64_t steps = 0;   ///< Taken.
  double seconds = 0;       ///< That the steps took.
};

/// Steps the beam from its straight rest shape until its deflection has settled. What is missing
/// decays by e a frame, by 1.3 where the beam is twice as soft as Timoshenko's and so damped more
/// than critically: some millionths are missing at most, far less than the lattice's error.
/// @param frames as many, settled or not; 0: until it has settled. With as many as in another
///   precision the same share is missing, and the difference of the two is rounding alone.
/// @throws DivergedError if it has not settled when the scene ends
Settled settle(const Scene& scene, const Model& model, Backend& backend, std::int64_t frames = 0);

}  // namespace phyxel::app
