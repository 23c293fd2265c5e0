#include "mesh/repulsion.hpp"

#include <algorithm>

#include "tabulated.hpp"

namespace phyxel {
namespace {

/// Largest number of points whose neighbours are found together: more need fewer searches, but have
/// more neighbours to choose from.
constexpr std::size_t together = 32;

}  // namespace

GradedRepulsion::GradedRepulsion(std::span<const Vec3d> point, std::size_t fixed,
                                 const SpacingField& spacing)
    : fixed_(fixed),
      spacing_(spacing),
      tree_(point, together),
      point_(tabulated(point.size(),
                       [&](std::size_t k) {
                         const Index index = tree_.order()[k];
                         return Placed{point[index], spacing.at(point[index]), index};
                       })),
      moves_(tabulated(tree_.leaves(), [&](std::size_t leaf) {
        const auto begin = point_.begin() + static_cast<std::ptrdiff_t>(tree_.first_of(leaf)),
                   end = point_.begin() + static_cast<std::ptrdiff_t>(tree_.first_of(leaf + 1));
        return static_cast<std::uint8_t>(std::any_of(begin, end, [&](const Placed& p) {
          return static_cast<std::size_t>(p.index) >= fixed;
        }));
      })) {
  move_to(point);
}

void GradedRepulsion::move_to(std::span<const Vec3d> point) {
#pragma omp parallel for schedule(static)
  for (std::size_t k = 0; k < point_.size(); ++k) {
    Placed& placed = point_[k];
    if (placed.place == point[placed.index]) continue;
    placed.place = point[placed.index];
    placed.spacing = spacing_.at(placed.place);
  }
  tree_.move_to(point);
  coarsest_ = tree_.summaries([&](std::size_t k) { return point_[k].spacing; },
                              [](double a, double b) { return std::max(a, b); });
}

/// Finds the points whose forces may reach one of a leaf.
void GradedRepulsion::find_near(std::size_t leaf, std::vector<Placed>& near) const {
  const std::size_t self = tree_.node_of(leaf);
  const Box& box = tree_.box(self);
  const auto reaches = [&](double distance2, double spacing) {
    const double reach = 0.5 * repulsion_reach * (coarsest_[self] + spacing);
    return distance2 < reach * reach;
  };
  near.clear();
  constexpr double all = 0;
  tree_.search(
      [&](std::size_t node) {
        return reaches(distance2(box, tree_.box(node)), coarsest_[node]) ? all : HUGE_VAL;
      },
      all,
      [&](std::size_t k) {
        if (reaches(distance2(point_[k].place, box), point_[k].spacing)) near.push_back(point_[k]);
      });
}

}  // namespace phyxel
