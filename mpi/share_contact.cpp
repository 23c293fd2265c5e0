/// The phyxels of a rank by which bodies touch obstacles.
#include <array>
#include <span>

#include "model/contact.hpp"
#include "model/symmetry.hpp"
#include "mpi/share_pipeline.hpp"
#include "scene/scene_error.hpp"
#include "tabulated.hpp"

namespace phyxel {

void find_contact_layer(const ShareSetup& setup, const WholeBodies& whole, LocalModel& local) {
  if (setup.scene.obstacles.empty() && !setup.scene.contact) return;
  local.contact_offset.assign(local.phyxels.size(), -1);
  const auto touches = [&](std::size_t b) {
    return whole.bodies[b].size > 0 && touches_anything(setup.scene, b);
  };
  std::vector<std::vector<double>> distances, spacings;
  std::vector<std::int64_t> counts;  // of each body, on its surface and beside it
  setup.ranks.collectively([&] {
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      const BodyRequest& request = setup.scene.bodies[b];
      const Surface& surface = whole.surfaces[b];
      if (touches(b)) naming(request, [&] { check_touches(request, surface.triangle); });
      const std::span<const double> support =
          of_range(local.model.neighbourhood.support, local.bodies[b]);
      spacings.push_back(tabulated(support.size(), [&](std::size_t k) {
        return local_spacing(request.neighbourhood, support[k]);
      }));
      distances.push_back(distances_from_surface(of_range(local.model.position, local.bodies[b]),
                                                 spacings.back(), surface.position,
                                                 surface.triangle, 0));
      LayerCounts of_body;
      for (std::size_t k = 0; k < support.size(); ++k) {
        const auto i = static_cast<std::size_t>(local.bodies[b].begin) + k;
        if (owns(local, i)) of_body.add(distances[b][k], spacings[b][k]);
      }
      counts.insert(counts.end(), {of_body.on, of_body.beside});
    }
  });
  setup.ranks.add(counts);
  setup.ranks.collectively([&] {
    for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
      if (touches(b)) check_layer(setup.scene.bodies[b], {counts[2 * b], counts[2 * b + 1]});
    }
  });
  for (std::size_t b = 0; b < whole.bodies.size(); ++b) {
    if (!touches(b)) continue;
    const bool has_layer = LayerCounts{counts[2 * b], counts[2 * b + 1]}.has_layer();
    for (std::size_t k = 0; k < distances[b].size(); ++k) {
      local.contact_offset[static_cast<std::size_t>(local.bodies[b].begin) + k] =
          contact_offset(distances[b][k], spacings[b][k], has_layer);
    }
  }
}

}  // namespace phyxel
