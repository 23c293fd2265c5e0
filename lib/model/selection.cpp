#include "model/selection.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "mesh/winding_number.hpp"
#include "model/assembly.hpp"
#include "model/box.hpp"
#include "model/closed_mesh.hpp"
#include "phyxel/error.hpp"
#include "sort_unique.hpp"
#include "tabulated.hpp"

namespace phyxel {
namespace {

template <class Inside>
std::vector<Index> indices_where(const Cloud& cloud, Inside&& inside) {
  std::vector<Index> chosen;
  for (std::size_t i = 0; i < cloud.position.size(); ++i) {
    if (inside(cloud.position[i])) chosen.push_back(static_cast<Index>(i));
  }
  return chosen;
}

std::vector<Index> of_region(const Selection& selection, const Cloud& cloud,
                             const std::string& body) {
  const auto found = cloud.regions.find(*selection.region);
  if (found != cloud.regions.end()) return found->second;
  throw InputError(fmt::format("{}: body \"{}\" has no region \"{}\"{}", selection.where, body,
                               *selection.region,
                               alternatives_to(*selection.region, cloud.regions)));
}

std::vector<Index> of_indices(const Selection& selection, const SomePhyxels& body,
                              const std::string& name) {
  for (const Index i : *selection.indices) {
    if (i < 0 || i >= body.size) {
      throw InputError(fmt::format("{}: phyxel {} is not in body \"{}\": allowed 0 to {}",
                                   selection.where, i, name, body.size - 1));
    }
  }
  std::vector<Index> chosen = *selection.indices;
  sort_unique(chosen);
  if (body.number.empty()) return chosen;
  std::vector<Index> here;
  for (const Index i : chosen) {
    const auto at = std::lower_bound(body.number.begin(), body.number.end(), i);
    if (at != body.number.end() && *at == i) {
      here.push_back(static_cast<Index>(at - body.number.begin()));
    }
  }
  return here;
}

/// The phyxels inside a closed surface or on it.
std::vector<Index> inside_mesh(const Selection& selection, const Cloud& cloud,
                               const BodyRequest& request) {
  Surface surface = read_closed_mesh(selection.mesh, selection.where);
  place(surface.position, request);
  // On a flat face the number is a half, on the edge of a cube a quarter, at its corner an eighth;
  // outside it is zero but for an error of about a hundredth.
  const WindingNumber winding(surface, 5);
  constexpr double on_or_inside = 0.06;
  const std::vector<char> inside = tabulated(cloud.position.size(), [&](std::size_t i) {
    return static_cast<char>(winding(cloud.position[i]) > on_or_inside);
  });
  return chosen(0, static_cast<Index>(inside.size()), [&](Index i) { return inside[i] != 0; });
}

}  // namespace

std::string alternatives_to(const std::string& name,
                            const std::map<std::string, std::vector<Index>>& named) {
  std::vector<std::string> names;
  for (const auto& [known, members] : named) names.push_back(known);
  return fmt::format("{}; it has: {}", did_you_mean(name, names),
                     names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", ")));
}

std::vector<Index> select(const Selection& selection, const SomePhyxels& body,
                          const BodyRequest& request, Faces faces) {
  const Cloud& cloud = body.cloud;
  if (selection.region) return of_region(selection, cloud, request.name);
  if (selection.indices) return of_indices(selection, body, request.name);
  if (!selection.mesh.empty()) return inside_mesh(selection, cloud, request);
  if (const std::optional<SpaceRegion> region =
          faces == Faces::laid ? acting_region(selection, cloud.cuts) : region_of(selection)) {
    return indices_where(cloud, [&](Vec3d p) {
      return region->distance(p) <= boundary_tolerance(*region, p, cloud.cuts);
    });
  }
  return indices_where(cloud, [](Vec3d) { return true; });
}

std::optional<SpaceRegion> region_of(const Selection& selection) {
  if (const auto& box = selection.box) return SpaceRegion{.low = box->low, .high = box->high};
  if (const auto& ball = selection.ball) {
    return SpaceRegion{.centre = ball->centre, .radius = ball->radius, .is_ball = true};
  }
  return std::nullopt;
}

std::optional<SpaceRegion> acting_region(const Selection& selection, const SupportCuts& cuts) {
  const std::optional<SpaceRegion> region = region_of(selection);
  if (!region) return region;
  const auto moved = std::ranges::find(cuts.moved, *region, &SupportCut::support);
  return moved == cuts.moved.end() ? region : moved->wall;
}

double boundary_tolerance(const SpaceRegion& region, Vec3d point, const SupportCuts& cuts) {
  // Coordinates of faces that a scene means may differ in their last digits.
  constexpr double digits = 1e-12;
  const double size = region.is_ball ? region.radius : norm(region.high - region.low);
  return std::max(2 * cuts.depth, digits * (norm(point) + std::min(size, norm(point))));
}

void refuse_selection(const Selection& selection, const std::string& name, const Box& box,
                      const char* more) {
  throw InputError(fmt::format(
      "{}: this selects no phyxel of body \"{}\", whose phyxels lie in [{:g}, {:g}, {:g}] to "
      "[{:g}, {:g}, {:g}] m{}",
      selection.where, name, box.low.x, box.low.y, box.low.z, box.high.x, box.high.y, box.high.z,
      more));
}

}  // namespace phyxel
