/// Finding where phyxels have to be near to each other: where a surface curves, where a body is
/// thin, and where it is asked for.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "mesh/inside_samples.hpp"
#include "mesh/spacing_field.hpp"
#include "mesh/surface_topology.hpp"
#include "phyxel/mesh.hpp"

namespace phyxel {

/// Cosine of the smallest angle between the normals of two faces that makes their edge sharp, and
/// of the smallest turn of a sharp edge that makes a corner: of 40 degrees.
inline const double sharp = std::cos(40 * std::numbers::pi / 180);

/// A body to grade.
struct GradedBody {
  const Surface& surface;
  const SurfaceTopology& topology;
  /// Sample points inside, one in each cube of side `voxel`.
  const std::vector<SampleBlock>& inside;
  double voxel = 0;  ///< [m]
  Index phyxels = 0;
};

/// The spacing s [m] that solves phyxels = V/s³ + A/(2 s²): a phyxel on a face takes half the
/// volume of an interior one.
double spacing_for(double volume, double area, Index phyxels);

/// The spacings that a request wants, coarsest such that the body has about the number of phyxels.
SpacingField graded_spacing(const GradedBody& body, const Grading& request);

}  // namespace phyxel
