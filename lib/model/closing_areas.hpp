/// The areas that phyxels represent of their body's surface (phyxel/physics/closing.hpp).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/model.hpp"

namespace phyxel {

/// A flat piece of the surface. Areas at centroids carry constants and linear functions exactly,
/// however triangles are split.
struct Facet {
  Vec3d centroid, area;  ///< [m], outward [m²]
};

/// Returns the triangles of a surface, halved until no edge is longer than `longest`.
/// @param first the number of the surface's first vertex in `triangles`. @param longest length [m]
std::vector<Facet> facets_of(std::span<const Vec3d> position, std::span<const Triangle> triangles,
                             Index first, double longest);

/// The support of a body's phyxels that facets of its surface have to resolve [m]: the smallest if
/// weights are those of pairs. @param pair_length `Part::pair_length`
double facet_support(std::span<const double> support, double pair_length);

/// The largest edge of a facet of a body whose phyxels have this support: short enough for the
/// facet's area to go to the phyxels beside it [m].
///
/// No body gets more than some hundred facets for each phyxel, however small its support is.
/// @param size number of phyxels of the body
double longest_edge(double support, std::span<const Vec3d> position,
                    std::span<const Triangle> triangles, Index first, Index size);

/// The space inside a closed surface.
struct Enclosed {
  double volume = 0;  ///< [m³]
  double open = 0;    ///< Relative deviation of Σ x Sᵀ from V I, or of Σ S from 0.
};
Enclosed enclosed_by(std::span<const Facet> facets);

/// Distributes facets over the phyxels near them, so that Σ S = 0 and Σ x Sᵀ = V I hold as they do
/// for the facets: by weights that reproduce linear functions, where phyxels span space. If the
/// phyxels in a facet's plane span the plane, only they get shares, and none below the surface.
/// @param near the phyxels within whose support each facet's centroid lies, or else the nearest
/// @param support of each phyxel [m]
/// @returns the area S of each phyxel [m²], summed in the order of the facets
std::vector<Vec3d> areas_of_phyxels(std::span<const Facet> facets, const Csr& near,
                                    std::span<const Vec3d> position,
                                    std::span<const double> support);

/// Distributes values on facets over the phyxels near them as `areas_of_phyxels` distributes areas:
/// sums and moments of the values stay.
/// @param value of each facet
std::vector<Vec3d> distribute(std::span<const Facet> facets, std::span<const Vec3d> value,
                              const Csr& near, std::span<const Vec3d> position,
                              std::span<const double> support);

/// True if a surface encloses a volume and faces outward.
bool encloses_volume(const Surface& surface);

/// True if the gradients of a body may have to be closed, whatever its cloud is.
bool may_close(const BodyRequest& request);
/// True if they have to be closed, provided that the surface encloses the body.
/// @param lattice `Cloud::lattice`
bool may_close(const BodyRequest& request, const Surface& surface, bool lattice,
               bool kernel_volumes);

/// The tolerance to which the gradients of a body are to be closed; 0 if they are not.
/// @param lattice `Cloud::lattice`
/// @param size number of phyxels
/// @param volume of all phyxels [m³], if it follows from the geometry
/// @param warnings are told why a body that does not ask for closed gradients cannot have them
/// @throws InputError naming the body, its fault, and what is allowed, if the body asks for closed
///   gradients and its surface does not enclose its volume
double closure_of(const BodyRequest& request, const Surface& surface, bool lattice, Index size,
                  std::optional<double> volume, std::vector<std::string>& warnings);

}  // namespace phyxel
