/// Fields of phyxels that are computed for output: stress, strain, and what the scene sets.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/chunked_source.hpp"
#include "phyxel/model.hpp"
#include "phyxel/recovery.hpp"

namespace phyxel {

/// A computed field.
struct PointField {
  const char* name;  ///< In `output.fields` and in frames.
  Quantity quantity;
  const char* meaning;  ///< With its unit and components, for documentation.
};
/// All computed fields.
std::span<const PointField> point_fields();

/// Values of computed fields, each of shape [n, width_of(quantity)].
using FieldValues = std::map<Quantity, std::vector<double>>;

/// The computed fields that the output of a scene wants.
std::vector<Quantity> wanted_fields(const OutputRequest& output);

/// Computes fields of the phyxels of a model, or of a rank's share, at the backend's present state.
/// Stress is Cauchy's, σ = P Fᵀ / det F [Pa], strain is Green's, (FᵀF - I) / 2; both as xx, yy, zz,
/// xy, yz, xz. Values of ghosts are 0.
/// @param recovery of the model's gradients: on the surface, fields are then those of the recovered
///   gradient, changed along the normal so that the traction is that of the phyxel's own stress.
///   Viscous stresses stay. Phyxels that have broken pairs, or have yielded, or have the history of
///   a caller's law, keep their own gradient, and so does one whose det F that would change by a
///   factor of two, as at a kink. Null: fields are of the gradients from which forces follow.
///   Collective on a share, if not null
FieldValues find_fields(const Model& model, Backend& backend, std::span<const Quantity> wanted,
                        const Recovery* recovery = nullptr);

/// Makes the recovery that the output of a scene asks for; null if it asks for none, or if there
/// are neither probes nor fields that follow from gradients.
std::unique_ptr<const Recovery> recovery_for(const OutputRequest& output, const Model& model);

}  // namespace phyxel
