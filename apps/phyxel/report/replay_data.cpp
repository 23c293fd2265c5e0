#include "report/replay_data.hpp"

#include <algorithm>
#include <cmath>

#include "phyxel/neighbourhood.hpp"

namespace phyxel::app {

double carrier_reach(double spacing) { return spacing > 0 ? 1.6 * spacing : 1; }

double carrier_weight(double q) { return std::pow(std::max(1e-3, 1 - q * q), 3); }

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
    for (const auto& [q, i] : near) sum += carrier_weight(q);
    int left = 255;
    for (std::size_t k = 0; k < Carriers::each; ++k) {
      const bool there = k < near.size();
      made.phyxel.push_back(static_cast<std::uint32_t>(near[there ? k : 0].second));
      const int share =
          there ? static_cast<int>(std::lround(255 * carrier_weight(near[k].first) / sum)) : 0;
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

std::vector<double> sample_of(const std::vector<Instance>& instances, std::size_t field) {
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
  return sample;
}

double liveliness(const std::vector<double>& values, const ColourRange& range) {
  double sum = 0, squares = 0, count = 0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    const double share = range.share_of(value);
    sum += share;
    squares += share * share;
    ++count;
  }
  if (count == 0) return 0;
  const double mean = sum / count;
  return mean * std::sqrt(std::max(0.0, squares / count - mean * mean));
}

Opening opening_of(const std::vector<Instance>& instances, const std::vector<std::string>& names,
                   const std::vector<ColourRange>& ranges) {
  // Uniformly spread colours have 0.14; bodies at rest of which a twentieth moves, about 0.01.
  constexpr double enough = 0.01;
  std::vector<std::pair<double, Opening>> liveliest;
  for (std::size_t f = 0; f < names.size(); ++f) {
    liveliest.push_back({-1, {0, f}});
    for (std::size_t k = 0; k < instances.size(); ++k) {
      const double found = liveliness(instances[k].fields[f], ranges[f]);
      if (found > liveliest.back().first) liveliest.back() = {found, {k, f}};
    }
  }
  for (const char* wanted : {"stress", "speed", "displacement"}) {
    for (std::size_t f = 0; f < names.size(); ++f) {
      if (names[f].starts_with(wanted) && liveliest[f].first >= enough) return liveliest[f].second;
    }
  }
  Opening opening;
  double most = 0;
  for (const auto& [found, place] : liveliest) {
    if (found <= most) continue;
    most = found;
    opening = place;
  }
  return opening;
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
