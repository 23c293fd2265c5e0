/// A strip of a plate in plane strain between grips, with a crack: its exact energy release rate is
/// known (Rice 1967).
#pragma once

#include <cmath>

#include "phyxel/diagnostics.hpp"
#include "phyxel/equilibrium.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/solver.hpp"
#include "support/backend.hpp"
#include "support/clouds.hpp"

namespace phyxel::testing {

/// The strip: `length` by `height` by `width` spacings of 1 m, along x, y and z, whose outer two
/// layers along y are moved apart. It is cut from x- to a fraction of its length.
struct Strip {
  int length = 48, height = 16, width = 3;
  double crack = 0;  ///< Length of the crack [m].
  double apart = 0;  ///< Displacement of each grip over half the height.
  double young = 1e6, poisson = 0.25, density = 1000;
  double jitter = 0;
  std::optional<double> energy_release_rate;

  /// Phyxels in the middle of cells, moved by up to `jitter` spacings.
  Cloud cloud() const { return lattice(length, height, width, 1, jitter); }
  Model model(const Scene& scene) const {
    const std::vector<Cloud> clouds{cloud()};
    return build_model(scene, clouds);
  }
  Scene scene(Method method = Method::verlet) const {
    Scene scene;
    scene.solver.method = method;
    BodyRequest body;
    body.name = "strip";
    body.where = "test";
    body.source.cloud = "strip";
    body.material = {.young = young, .poisson = poisson, .density = density, .hourglass = 0.1};
    body.material.law = "small-strain";
    const double half = 0.5 * height;
    const auto grip = [&](double side) {
      std::vector<Index> layers;
      const Cloud all = cloud();
      for (Index i = 0; i < static_cast<Index>(all.position.size()); ++i) {
        if (side * (all.position[i].y - half) > half - 2) layers.push_back(i);
      }
      // Half a layer of each grip takes part in a uniform strain, as do the gripped layers' inner
      // neighbours; both layers move alike.
      body.motions.push_back({.select = {.indices = layers},
                              .displacement = {0, side * apart * (half - 1), 0},
                              .duration = 1e-12,
                              .axes = {true, true, false}});
    };
    grip(1);
    grip(-1);
    // Planes of symmetry at both ends: the strip ahead of the crack is in plane strain.
    std::vector<Index> ends;
    const Cloud all = cloud();
    for (Index i = 0; i < static_cast<Index>(all.position.size()); ++i) {
      const Vec3d x = all.position[i];
      if (std::abs(x.y - half) < half - 2 && (x.x < 1 || x.x > length - 1)) ends.push_back(i);
    }
    body.fixed.push_back({.select = {.indices = ends}, .axes = {true, false, false}});
    body.fixed.push_back({.select = {.all = true}, .axes = {false, false, true}});
    if (crack > 0) {
      const double radius = 1e4 * length;
      body.notches.push_back(
          {.centre = {crack - radius, half, 0.5 * width}, .normal = {0, 1, 0}, .radius = radius});
    }
    if (energy_release_rate) {
      body.fracture = FractureRequest{.energy_release_rate = *energy_release_rate};
      body.fracture->where = "test";
    }
    scene.bodies.push_back(body);
    return scene;
  }
};

/// A strip at rest: displacements, and the energy of its deformation [J].
struct StripAtRest {
  std::vector<Vec3d> displacement;
  double energy = 0;
};

inline StripAtRest rest_of(Strip strip) {
  strip.energy_release_rate.reset();
  const Scene scene = strip.scene(Method::equilibrium);
  const Model model = strip.model(scene);
  const auto backend = make_test_backend(model, Precision::double_);
  Solver solver(model, *backend, initial_state(model, scene, 1), Method::equilibrium);
  solver.step(1);
  return {solver.state().displacement, diagnose(model, *backend, solver).elastic_energy()};
}

/// The energy release rate of a long crack [J/m²]: the energy by area that the strip has ahead of
/// it and has lost behind it.
inline double release_rate(Strip strip) {
  strip.crack = 0;
  const double whole = rest_of(strip).energy;
  strip.crack = 2.0 * strip.length;
  return (whole - rest_of(strip).energy) / (strip.length * strip.width);
}

}  // namespace phyxel::testing
