/// Obstacles of a scene, and the phyxels by which bodies touch them.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "model/contact_groups.hpp"
#include "phyxel/model.hpp"
#include "phyxel/physics/obstacles.hpp"

namespace phyxel {

/// The obstacles of a scene, in its order.
std::vector<Obstacle> obstacles_of(const Scene& scene);

/// The contact layer of a model at some displacements.
template <class Displacement>
class PlacedLayer {
 public:
  /// @param groups of the model's contact layer. @param displacement returns that of a phyxel [m].
  /// All must outlive this.
  PlacedLayer(const Model& model, std::span<const LayerGroup> groups, Displacement displacement)
      : model_(model), groups_(groups), displacement_(displacement) {
    for (const LayerGroup& group : groups) {
      boxes_.push_back(box_of_group(model, group, displacement));
    }
  }

  /// Calls each(k, x, gap) for the phyxels inside an obstacle, ascending: k counts the phyxels of
  /// the layer, x is where each is [m], and gap that of its body's surface there to the obstacle.
  /// @param below gap up to which phyxels count as inside [m]
  template <class Each>
  void for_each_inside(const Obstacle& obstacle, const ObstacleStep& at, Each&& each,
                       double below = 0) const {
    const ContactLayer& layer = model_.contact;
    ObstacleShapes::with(obstacle.form, [&](const auto& shape) {
      for (std::size_t g = 0; g < groups_.size(); ++g) {
        if (is_clear_of(obstacle, at, boxes_[g], groups_[g].offset + below)) continue;
        for (std::size_t k = groups_[g].begin; k < groups_[g].end; ++k) {
          const Index i = layer.phyxels[k];
          const Vec3d x = model_.position[i] + displacement_(i);
          Gap gap = gap_to(shape, at, x);
          gap.distance -= layer.offset[k];
          if (gap.distance < below) each(k, x, gap);
        }
      }
    });
  }

 private:
  const Model& model_;
  std::span<const LayerGroup> groups_;
  Displacement displacement_;
  std::vector<Box> boxes_;
};

/// Refuses a body that cannot touch anything: one without a surface.
/// @throws InputError naming the body and what is allowed
void check_touches(const BodyRequest& request, std::span<const Triangle> triangles);

/// The distance of each phyxel of a body from the body's surface, as far as that counts for contact
/// [m]; infinity for phyxels that are farther inside.
/// @param spacing distance between phyxels near each [m], shape [n]
/// @param first the number of the surface's first vertex in `triangles`
std::vector<double> distances_from_surface(std::span<const Vec3d> position,
                                           std::span<const double> spacing,
                                           std::span<const Vec3d> surface,
                                           std::span<const Triangle> triangles, Index first);

/// How many phyxels of a body lie on its surface, and how many beside it.
struct LayerCounts {
  std::int64_t on = 0, beside = 0;
  void add(double distance, double spacing);
  /// True if the phyxels on the surface are enough to touch with, so that others do not count.
  bool has_layer() const { return 2 * on >= beside; }
};

/// Refuses a body none of whose phyxels are on or beside its surface.
/// @throws InputError naming the body
void check_layer(const BodyRequest& request, const LayerCounts& counts);

/// The distance of a phyxel that touches from its body's surface [m]; negative for one that does
/// not. @param has_layer `LayerCounts::has_layer` of its body
double contact_offset(double distance, double spacing, bool has_layer);

/// Adds the obstacles of a scene to a model that is no share, and the phyxels that touch them.
/// @throws InputError for bodies without a surface, and for those inside an obstacle at the start
void add_contact(Model& model, const Scene& scene);

/// Makes the contact layer of a model from the offsets of all its phyxels (`contact_offset`), but
/// for ghosts, and for those that are held or moved along all axes; these become held points if the
/// model has free rigid bodies. Of a share: collective.
void add_contact_layer(Model& model, std::span<const double> offset);

/// Finds the distances from the surfaces of obstacles that are meshes, as finely as phyxels are
/// spaced, and warns of obstacles that are so thin beside that spacing that they are not felt well.
/// Of a share: collective.
void set_fields(Model& model);

/// True if a phyxel of this rank is inside something at the start, and deepest of all ranks'. Of a
/// share: collective.
/// @param depth [m], 0 if none of this rank is inside
/// @param tolerance of the depth, as a share of a support
bool is_deepest_overlap(const Model& model, double depth, Index phyxel, double tolerance);

/// True if a body of a scene touches an obstacle or a body.
bool touches_anything(const Scene& scene, std::size_t body);

/// The error of a model whose bodies are inside an obstacle at the start: what overlaps would be
/// pushed out in one step, and fly away. Empty if none is. Of a share: collective, and empty on all
/// ranks but one.
std::string overlap_at_start(const Model& model, const Scene& scene);

}  // namespace phyxel
