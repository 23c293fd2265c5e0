/// The stiffness of a deformed model relative to that at rest.
#include <algorithm>
#include <cmath>
#include <limits>

#include "phyxel/diagnostics.hpp"
#include "phyxel/error.hpp"
#include "phyxel/solver.hpp"
#include "solver/host_threads.hpp"
#include "solver/part_law.hpp"
#include "solver/stiffest.hpp"

namespace phyxel {
namespace {

/// Estimates the largest stiffness of plane waves [Pa] of a caller's law from its stresses: forward
/// differences give ∂P/∂F, and direction and polarisation are optimised in turn.
double wave_stiffness_of(const CustomLaw& law, const Mat3d& grad_u) {
  constexpr double step = 1e-6;  // relative errors: 1e-10 of rounding, 1e-6 of curvature
  const Mat3d stress = law.first_piola_stress(grad_u);
  Mat3d tangent[9];  // ∂P by entry e of ∇u
  for (int e = 0; e < 9; ++e) {
    Mat3d changed = grad_u;
    changed(e / 3, e % 3) += step;
    tangent[e] = (1 / step) * (law.first_piola_stress(changed) - stress);
  }
  const auto traction = [&](Vec3d a, Vec3d b) {  // ∂P/∂F : a bᵀ
    const double left[] = {a.x, a.y, a.z}, right[] = {b.x, b.y, b.z};
    Mat3d sum;
    for (int e = 0; e < 9; ++e) sum += (left[e / 3] * right[e % 3]) * tangent[e];
    return sum;
  };
  const auto unit = [](Vec3d v) { return norm(v) > 0 ? (1 / norm(v)) * v : v; };
  double largest = 0;
  for (const Vec3d start : {Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}}) {
    Vec3d a = start, b = start;
    for (int k = 0; k < 8; ++k) {
      a = unit(traction(a, b) * b);
      b = unit(transpose(traction(a, b)) * a);
    }
    largest = std::max(largest, dot(a, traction(a, b) * b));
  }
  return largest;
}

double stiffening_of(const PartLaw& law, const Material& material, const Mat3d& grad_u,
                     const PrincipalStretches<double>& stretches, double at_rest) {
  const double volume_stiffness = material.volume_stiffness;
  if (!law.custom()) {
    return stiffening(law.chosen().index, law.chosen().constants.data(), volume_stiffness,
                      stretches);
  }
  const VolumeConservation<double> volume{volume_stiffness};
  const double stiffer =
      (wave_stiffness_of(*law.custom(), grad_u) + volume.wave_stiffness(stretches)) / at_rest;
  return material.viscosity > 0 ? std::max(stiffer, viscous_stiffening(stretches)) : stiffer;
}

/// The largest stiffening of this rank's phyxels.
Stiffest stiffest_here(const Model& model, Backend& backend) {
  std::vector<Mat3d> gradient;
  backend.displacement_gradients(gradient);
  Stiffest all;
#pragma omp parallel num_threads(host_threads(backend))
  {
    Stiffest own;
    for (const Part& part : model.parts) {
      const PartLaw law(part.material);
      const double at_rest = wave_stiffness_at_rest(part.material);
#pragma omp for schedule(static) nowait
      for (Index i = part.begin; i < part.owned_end(); ++i) {
        const PrincipalStretches<double> s = principal_stretches(gradient[i]);
        own.look_at(stiffening_of(law, part.material, gradient[i], s, at_rest), s.largest,
                    model.global_id(i));
      }
    }
#pragma omp critical
    all.look_at(own);
  }
  return all;
}

}  // namespace

bool stiffens(const Material& material) {
  return material.custom_law || material.volume_stiffness > 0 || material.viscosity > 0 ||
         !law_table()[chosen_law(material).index].is_linear;
}

Stiffening find_stiffening(const Model& model, Backend& backend) {
  check_fits(model, backend);
  Stiffest found;
  if (const auto on_device = backend.stiffening()) {
    found = Stiffest{*on_device};
  } else {
    found = stiffest_here(model, backend);
  }
  if (model.share) found.look_at_ranks(*model.share->communicator);
  return found.values();
}

}  // namespace phyxel
