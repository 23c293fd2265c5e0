/// The computed fields of a run's frames.
#pragma once

#include <memory>
#include <vector>

#include "phyxel/point_fields.hpp"

namespace phyxel {

/// The finder of a run's computed fields, of phyxels and of surfels. It is made once for a model,
/// or for a rank's share.
class OutputFields {
 public:
  /// @param model must outlive this object
  OutputFields(const Model& model, const OutputRequest& output);
  ~OutputFields();
  OutputFields(const OutputFields&) = delete;
  OutputFields& operator=(const OutputFields&) = delete;

  /// The quantities that `find` fills; the same on all ranks.
  const std::vector<Quantity>& quantities() const { return quantities_; }

  /// Finds the fields of phyxels (`find_fields`), and those of surfels (`on_surface`). A surfel has
  /// the value of a quadratic polynomial fitted to the phyxels around it that are of the same
  /// material as the nearest, within the range of their values, so that rough fields cannot
  /// overshoot; if they all lie below it, as those of a lattice of cells do, the range is wider in
  /// proportion to their depth. Its principal stresses are those of the stress so found; so is von
  /// Mises', within the range of the phyxels' own. The values of "boundary" and "fragment" are
  /// those of the nearest phyxel. Velocities and histories are those of the state. The displacement
  /// of a surfel is the way from its place at rest. A surfel beside a crack has the weighted mean
  /// of the phyxels on its side. Collective on a share.
  /// @param state of the backend, with its history variables and the broken pairs of all ranks
  /// @param surfels the present surface, or null if it is not written
  /// @param recovery as of `find_fields`
  FieldValues find(Backend& backend, const State& state, const SurfelState* surfels,
                   const Recovery* recovery) const;

 private:
  class SurfaceFit;

  const Model& model_;
  std::vector<Quantity> wanted_;   // of phyxels
  std::size_t columns_ = 0;        // of history variables on surfels
  bool has_displacement_ = false;  // of surfels
  std::vector<Quantity> quantities_;
  mutable std::unique_ptr<const SurfaceFit> surface_;  // made when first needed
};

}  // namespace phyxel
