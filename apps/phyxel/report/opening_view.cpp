#include "report/opening_view.hpp"

#include <algorithm>
#include <cmath>

#include "scene/upright.hpp"

namespace phyxel::app {
namespace {

using Json = nlohmann::ordered_json;

Json numbers(Vec3d v) { return {v.x, v.y, v.z}; }

/// The outermost points of all frames [m], as if the followed body did not move.
Outermost outermost_of(const std::vector<Instance>& instances, const std::vector<Vec3d>& way) {
  Outermost found;
  for (std::size_t k = 0; k < instances.size(); ++k) {
    for (const auto* points : {&instances[k].surfels, &instances[k].phyxels}) {
      for (const Vec3d p : *points) found.include(way.empty() ? p : p - way[k]);
    }
  }
  return found;
}

}  // namespace

Json opening_view(const CameraWishes& wishes, const std::vector<Instance>& instances,
                  const Extent& extent, const std::vector<Vec3d>& way) {
  const auto scaled = [&](Vec3d v) { return (1 / extent.radius) * v; };
  const CameraRequest& camera = wishes.camera;
  const Vec3d ahead = normalised(wishes.view);
  Vec3d pivot = camera.target.value_or(extent.centre());
  Json page;
  const auto axes = upright_axes(wishes.up);
  const auto along = [&](int axis) { return -dot(wishes.view, axes[axis]); };
  Json& view = page["view"];
  view = {{"yaw", std::atan2(along(1), along(0))},
          {"pitch", std::atan2(along(2), std::hypot(along(0), along(1)))},
          {"field_of_view", camera.field_of_view},
          {"orbit", camera.orbit},
          {"centred", camera.position || camera.target}};
  if (camera.position) {
    // Without a target, the view turns around the point ahead that is nearest to the centre.
    const double ahead_to_centre = dot(pivot - *camera.position, ahead);
    const double distance = camera.target ? norm(pivot - *camera.position)
                                          : std::max(0.1 * extent.radius, ahead_to_centre);
    pivot = *camera.position + distance * ahead;
    view["distance"] = distance / extent.radius;
  }
  view["pivot"] = numbers(scaled(pivot - extent.centre()));
  for (const Vec3d axis : axes) page["axes"].push_back(numbers(axis));
  const Outermost outermost = outermost_of(instances, way);
  for (const Vec3d p : outermost.points()) {
    page["outermost"].push_back(numbers(scaled(p - extent.centre())));
  }
  page["centre"] = numbers(extent.centre());
  page["radius"] = extent.radius;
  for (const Span& side : extent.box) {
    page["scale"].push_back(side.width() / Span::steps / extent.radius);
    page["low"].push_back(-side.width() / 2 / extent.radius);
  }
  for (const Vec3d w : way) page["follow"].push_back(numbers(scaled(w)));
  return page;
}

}  // namespace phyxel::app
