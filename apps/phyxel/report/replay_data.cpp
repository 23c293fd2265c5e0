#include "report/replay_data.hpp"

#include <algorithm>
#include <cmath>

#include "phyxel/neighbourhood.hpp"

namespace phyxel::app {

Carriers carriers_of(const std::vector<Vec3d>& surfels, const std::vector<Vec3d>& phyxels,
                     double reach) {
  Carriers made;
  const std::vector<double> support(phyxels.size(), reach);
  const Csr rows = phyxels_near(surfels, phyxels, support);
  std::vector<std::pair<double, Index>> near;
  for (Index s = 0; s < rows.rows(); ++s) {
    near.clear();
    for (const Index i : rows.row(s)) {
      near.emplace_back(
          norm(phyxels[static_cast<std::size_t>(i)] - surfels[static_cast<std::size_t>(s)]) / reach,
          i);
    }
    std::sort(near.begin(), near.end());
    near.resize(std::min(near.size(), Carriers::each));
    double sum = 0;
    const auto weight = [](double q) { return std::pow(std::max(1e-3, 1 - q * q), 3); };
    for (const auto& [q, i] : near) sum += weight(q);
    int left = 255;
    for (std::size_t k = 0; k < Carriers::each; ++k) {
      const bool there = k < near.size();
      made.phyxel.push_back(static_cast<std::uint32_t>(near[there ? k : 0].second));
      const int share =
          there ? static_cast<int>(std::lround(255 * weight(near[k].first) / sum)) : 0;
      made.weight.push_back(static_cast<std::uint8_t>(std::min(left, share)));
      left -= made.weight.back();
    }
    made.weight[made.weight.size() - Carriers::each] += static_cast<std::uint8_t>(left);
  }
  return made;
}

void Span::include(double value) {
  if (!std::isfinite(value)) return;
  low = std::min(low, value);
  high = std::max(high, value);
}

std::uint16_t Span::step_of(double value) const {
  if (!std::isfinite(value)) return 0;
  return static_cast<std::uint16_t>(
      std::lround(std::clamp((value - low) / width(), 0.0, 1.0) * steps));
}

void Outermost::include(Vec3d p) {
  if (!std::isfinite(p.x + p.y + p.z)) return;
  for (std::size_t k = 0; k < found_.size(); ++k) {
    const double far = dot(p, direction(k));
    if (far > farthest_[k]) {
      farthest_[k] = far;
      found_[k] = p;
    }
  }
}

Vec3d Outermost::direction(std::size_t k) {
  const auto part = [&](std::size_t by) { return static_cast<double>(k / by % 3) - 1; };
  return {part(1), part(3), part(9)};
}

Extent extent_of(const std::vector<Instance>& instances) {
  Extent extent;
  extent.ranges.resize(instances.front().fields.size());
  for (const Instance& instance : instances) {
    for (const auto* points : {&instance.surfels, &instance.phyxels}) {
      for (const Vec3d p : *points) {
        extent.box[0].include(p.x);
        extent.box[1].include(p.y);
        extent.box[2].include(p.z);
        extent.outermost.include(p);
      }
    }
    for (std::size_t f = 0; f < instance.fields.size(); ++f) {
      for (const double value : instance.fields[f]) extent.ranges[f].include(value);
    }
  }
  double squared = 0;
  for (const Span& side : extent.box) squared += side.width() * side.width() / 4;
  extent.radius = std::sqrt(squared);
  return extent;
}

std::pair<double, double> bulk_of(std::vector<double> values) {
  if (values.empty()) return {0, 1};
  const auto at = [&](double share) {
    const auto place = values.begin() +
                       static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), place, values.end());
    return *place;
  };
  const double low = at(0.01);
  return {low, at(0.99)};
}

std::pair<double, double> bulk_of(const std::vector<Instance>& instances, std::size_t field) {
  std::size_t all = 0;
  for (const Instance& instance : instances) all += instance.fields[field].size();
  const std::size_t every = 1 + all / 1'000'000;
  std::vector<double> sample;
  std::size_t k = 0;
  for (const Instance& instance : instances) {
    for (const double value : instance.fields[field]) {
      if (k++ % every == 0 && std::isfinite(value)) sample.push_back(value);
    }
  }
  return bulk_of(std::move(sample));
}

std::vector<std::uint16_t> quantised(const Instance& instance, const Extent& extent) {
  std::vector<std::uint16_t> numbers;
  for (const auto* points : {&instance.surfels, &instance.phyxels}) {
    for (const Vec3d p : *points) {
      numbers.insert(numbers.end(), {extent.box[0].step_of(p.x), extent.box[1].step_of(p.y),
                                     extent.box[2].step_of(p.z)});
    }
  }
  for (std::size_t f = 0; f < instance.fields.size(); ++f) {
    for (const double value : instance.fields[f]) {
      numbers.push_back(extent.ranges[f].step_of(value));
    }
  }
  return numbers;
}

}  // namespace phyxel::app
