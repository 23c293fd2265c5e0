#include "mesh/spacing_field.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace phyxel {
namespace {

/// Sources of a leaf that are not worth another division.
constexpr std::size_t few_sources = 8;
constexpr int deepest = 14;

/// The middle of a cube's child.
Vec3d middle_of_child(Vec3d middle, double half, int child) {
  const auto side = [&](int bit) { return child & bit ? 0.5 * half : -0.5 * half; };
  return middle + Vec3d{side(1), side(2), side(4)};
}

}  // namespace

SpacingCone::SpacingCone(std::span<const SpacingSource> sources, double growth, double least,
                         double most, const Box& box)
    : sources_(sources.begin(), sources.end()), growth_(growth), least_(least), most_(most) {
  std::erase_if(sources_, [&](const SpacingSource& s) { return !(s.spacing < most); });
  nodes_.emplace_back();
  if (sources_.empty()) return;
  middle_ = 0.5 * (box.low + box.high);
  half_ = 0.5 * box.extent() + least;
  std::vector<std::uint32_t> all(sources_.size());
  for (std::size_t k = 0; k < all.size(); ++k) all[k] = static_cast<std::uint32_t>(k);
  divide(0, middle_, half_, std::move(all), 0);
}

void SpacingCone::divide(std::size_t node, Vec3d middle, double half,
                         std::vector<std::uint32_t> sources, int depth) {
  const double radius = std::numbers::sqrt3 * half;
  double best = most_;
  const auto in_middle = [&](std::uint32_t k) {
    return sources_[k].spacing + growth_ * norm(middle - sources_[k].place);
  };
  for (const std::uint32_t k : sources) best = std::min(best, in_middle(k));
  // A source wins over the best of the middle only if it is within that of it by what both change
  // inside the cube.
  const double limit = best + 2 * growth_ * radius * (1 + 1e-9);
  std::erase_if(sources, [&](std::uint32_t k) {
    return in_middle(k) > limit || in_middle(k) - growth_ * radius >= most_;
  });
  if (sources.size() <= few_sources || half < 0.25 * std::max(best, least_) || depth == deepest) {
    nodes_[node].begin = static_cast<std::uint32_t>(listed_.size());
    listed_.insert(listed_.end(), sources.begin(), sources.end());
    nodes_[node].end = static_cast<std::uint32_t>(listed_.size());
    return;
  }
  const std::size_t first = nodes_.size();
  nodes_[node].first_child = static_cast<std::int32_t>(first);
  nodes_.resize(first + 8);
  for (int child = 0; child < 8; ++child) {
    divide(first + static_cast<std::size_t>(child), middle_of_child(middle, half, child),
           0.5 * half, sources, depth + 1);
  }
}

double SpacingCone::at(Vec3d place) const {
  const auto within = [&](double at, double middle_of_cube) {
    return std::clamp(at, middle_of_cube - half_, middle_of_cube + half_);
  };
  const Vec3d inside{within(place.x, middle_.x), within(place.y, middle_.y),
                     within(place.z, middle_.z)};
  if (sources_.empty()) return most_;
  if (!(inside == place)) return std::min(most_, at(inside) + growth_ * norm(place - inside));
  std::size_t node = 0;
  Vec3d middle = middle_;
  double half = half_;
  while (nodes_[node].first_child >= 0) {
    const int child =
        (place.x > middle.x ? 1 : 0) + (place.y > middle.y ? 2 : 0) + (place.z > middle.z ? 4 : 0);
    middle = middle_of_child(middle, half, child);
    half *= 0.5;
    node = static_cast<std::size_t>(nodes_[node].first_child + child);
  }
  double spacing = most_;
  for (std::uint32_t at = nodes_[node].begin; at < nodes_[node].end; ++at) {
    const SpacingSource& source = sources_[listed_[at]];
    spacing = std::min(spacing, source.spacing + growth_ * norm(place - source.place));
  }
  return spacing;
}

double SpacingField::at(Vec3d place, double of_sources) const {
  if (is_uniform()) return coarsest_;
  double spacing = std::min(coarsest_, of_sources);
  for (const FinerRegion& finer : regions_) {
    const double beyond = std::max(0.0, finer.region.distance(place));
    spacing = std::min(spacing, coarsest_ / finer.ratio + growth_ * beyond);
  }
  return std::max(spacing, finest());
}

SpacingField SpacingField::with_coarsest(double coarsest) const {
  SpacingField other = *this;
  other.coarsest_ = coarsest;
  return other;
}

}  // namespace phyxel
