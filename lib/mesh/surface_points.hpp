/// Points spread evenly over a surface.
#pragma once

#include <cstdint>
#include <vector>

#include "bulk.hpp"
#include "mesh/spacing_field.hpp"
#include "mesh/triangle.hpp"
#include "phyxel/cloud.hpp"

namespace phyxel {

/// The area of a triangle, along its normal [m²].
Vec3d area_of(const Surface& surface, Index triangle);

/// Numbers of points that pieces get in turn, rounded so that any run of pieces gets its share.
class Shares {
 public:
  explicit Shares(double size_of_one) : one_(size_of_one) {}
  std::int64_t next(double size) {
    size_ += size;
    const auto before = given_;
    given_ = static_cast<std::int64_t>(size_ / one_ + 0.5);
    return given_ - before;
  }

 private:
  double one_, size_ = 0;
  std::int64_t given_ = 0;
};

/// Points evenly spread over the triangles of a surface, in their order: `on_square` of them on
/// each square of the spacing. Each has the index of its triangle.
/// Source of the sequence: Roberts 2018 (R2), folded from a square into the triangle.
Bulk<PointOn> points_over(const Surface& surface, const SpacingField& spacing, double on_square,
                          std::uint64_t seed);

}  // namespace phyxel
