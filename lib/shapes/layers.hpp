/// The layers of phyxels along one axis of a lattice.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace phyxel {

/// Layers perpendicular to an axis, at places that ascend. They are equally far apart in each
/// stretch between two planes on which layers must lie. Numbers of layers are integers, as doubles
/// because they may overflow.
class Layers {
 public:
  Layers() = default;
  /// Lays layers about `spacing` [m] apart from `low` to `low + length` [m].
  /// @param on_end true for an end on which a layer lies; the outermost layer beside any other end
  /// is half a distance from it
  /// @param planes places between the ends on which layers lie, ascending [m]
  Layers(double low, double length, double spacing, std::array<bool, 2> on_end,
         std::span<const double> planes = {});

  /// Number of layers.
  double count() const { return stretches_.back().end; }
  /// The place of a layer [m].
  double place(double layer) const;
  /// Distance between layers just above a layer, or below the uppermost [m].
  double spacing(double layer) const { return stretches_[stretch_of(layer)].spacing; }
  /// The part of the body below and above a layer that it stands for [m]: half the distance to the
  /// next layer, or the distance to the end.
  std::array<double, 2> shares(double layer) const;
  /// True if a layer lies on an end or a plane.
  bool is_laid(double layer) const;
  /// The first layer above a place; `count()` if there is none.
  double first_above(double place) const;

 private:
  struct Stretch {
    double low;         ///< Lower end [m].
    double spacing;     ///< [m]
    double within;      ///< Distance of the first layer from the lower end, 0 or 0.5 spacings.
    double first, end;  ///< Layers from its lower end on, up to that of the next stretch.
  };
  std::size_t stretch_of(double layer) const;

  std::vector<Stretch> stretches_;
  bool on_high_ = false;  ///< True if the uppermost layer lies on the upper end.
};

}  // namespace phyxel
