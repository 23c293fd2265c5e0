#include "model/contact_groups.hpp"

#include <algorithm>

#include "mesh/distance_field.hpp"
#include "model/parts.hpp"
#include "phyxel/physics/obstacles.hpp"

namespace phyxel {

std::vector<LayerGroup> groups_of(const Model& model, const ContactLayer& layer) {
  constexpr std::size_t most = 256;
  std::vector<LayerGroup> groups;
  Index body = -1;
  for (std::size_t k = 0; k < layer.phyxels.size(); ++k) {
    const Index i = layer.phyxels[k], of = part_of(model, i).body;
    if (of != body || k - groups.back().begin == most) groups.push_back({k, k});
    body = of;
    LayerGroup& group = groups.back();
    group.end = k + 1;
    group.offset = std::max(group.offset, layer.offset[k]);
    group.support = std::max(group.support, model.neighbourhood.support[i]);
  }
  return groups;
}

// A signed distance changes by no more than the way of its point. Those of meshes are interpolated,
// so that only their grids bound them: beyond the grid the distance is more than that from it.
bool is_clear_of(const Obstacle& obstacle, const ObstacleStep& at, const Box& box, double offset) {
  if (box.low.x > box.high.x) return true;  // of no points
  const Vec3d centre = 0.5 * (box.low + box.high);
  const double reach = 0.5 * norm(box.high - box.low) + offset;
  double gap = 0;
  if (!obstacle.surface) {
    gap = ObstacleShapes::with(
        obstacle.form, [&](const auto& shape) { return gap_to(shape, at, centre).distance; });
  } else if (!obstacle.hollow) {
    const DistanceField& field = obstacle.form.field;
    const double cell = DistanceField::edge * field.spacing;
    const Vec3d half{0.5 * cell * field.count.x, 0.5 * cell * field.count.y,
                     0.5 * cell * field.count.z};
    gap = norm(centre - (at.turn * (field.low + half) + at.place)) - norm(half);
  }
  constexpr double rounding = 1e-12;
  return gap > reach + rounding * (reach + gap + norm(centre) + norm(at.place));
}

}  // namespace phyxel
