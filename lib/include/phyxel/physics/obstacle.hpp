/// The interface of an obstacle's shape: a rigid body with a signed distance. A shape is a struct
/// in a file of its own under `physics/obstacles/`, named once in the list of
/// `physics/obstacles.hpp`. In its own coordinates, before it is turned and moved, it has
///
///   static constexpr const char* name, *meaning;    its name in scenes, and one sentence for users
///   static constexpr ObstacleLength lengths[];      the lengths that a user gives
///   the same lengths, in their order, as the only data members [m], each a `double`; or, for a
///                                                   surface from a file, its `DistanceField`
///   gap(x)                       distance of a point from the surface, and the direction away from
///   it
///   solid()                      volume, centre and moments, of shapes that may be free bodies
///   for_each_tip(each)           balls by which it touches other rigid bodies; likewise
#pragma once

#include <array>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "phyxel/physics/distance_field.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// One length of an obstacle's shape, as users give it.
struct ObstacleLength {
  const char* name;     ///< The key in scenes.
  const char* meaning;  ///< One sentence for the reference of scenes.
};

/// Keys of lengths. The three components of `size` are three lengths of a shape.
inline constexpr ObstacleLength obstacle_size[] = {
    {"size", "along x"}, {"size", "along y"}, {"size", "along z"}};
inline constexpr ObstacleLength obstacle_radius{"radius", "Radius."};
inline constexpr ObstacleLength obstacle_length{"length", "Length along z."};

/// The largest number of lengths of a shape.
inline constexpr int most_obstacle_lengths = 3;

/// An obstacle's shape, chosen at run time.
struct ObstacleForm {
  int shape = 0;                                        ///< Index in `ObstacleShapes`.
  std::array<double, most_obstacle_lengths> lengths{};  ///< Of the shape, in its order [m].
  DistanceField field{};                                ///< Of a surface from a file.
};

/// Volume of a solid, and how that is spread, in the shape's own coordinates.
struct SolidMoments {
  double volume = 0;  ///< [m³]
  Vec3d first;        ///< ∫ x dV [m⁴].
  Sym3d second;       ///< ∫ x xᵀ dV [m⁵].

  /// The moments of a solid that is symmetric about the planes x = 0, y = 0 and z = 0.
  /// @param squares means of x², y² and z² [m²]
  static SolidMoments about_origin(double volume, Vec3d squares) {
    return {volume, {}, {volume * squares.x, 0, 0, volume * squares.y, 0, volume * squares.z}};
  }
};

/// The distance from a convex shape given by a point's distances beyond its faces along two or
/// three orthogonal directions [m], negative inside: that to the nearest point of an edge or corner
/// if the point is beyond several faces, that to the nearest face inside.
/// @param beyond distance beyond the face along each direction. @param direction unit vectors
template <int n>
PHYXEL_HD Gap gap_of_faces(const double (&beyond)[n], const Vec3<double> (&direction)[n]) {
  double square = 0;
  Vec3<double> way{};
  int nearest = 0;
  for (int k = 0; k < n; ++k) {
    if (beyond[k] > beyond[nearest]) nearest = k;
    if (beyond[k] <= 0) continue;
    square += beyond[k] * beyond[k];
    way += beyond[k] * direction[k];
  }
  if (square == 0) return {beyond[nearest], direction[nearest]};
  const double distance = std::sqrt(square);
  return {distance, (1 / distance) * way};
}

/// The distance from a sphere about the origin. At its centre, where no direction is nearest, z is.
PHYXEL_HD Gap gap_of_sphere(Vec3<double> x, double radius) {
  const double r = std::sqrt(dot(x, x));
  return {r - radius, r > 0 ? (1 / r) * x : Vec3<double>{0, 0, 1}};
}

/// The shapes of obstacles: `with` selects one at run time by its index.
template <class... Shapes>
struct ObstacleList {
  static constexpr int count = sizeof...(Shapes);

  /// Calls visit(std::type_identity<Shape>{}) for each shape, in the order of the list.
  template <class Visit>
  static void for_each(Visit&& visit) {
    (visit(std::type_identity<Shapes>{}), ...);
  }
  /// Returns apply(shape) for a shape.
  template <class Apply>
  static auto with(const ObstacleForm& form, Apply&& apply) {
    return with_from<0, Apply, Shapes...>(form, apply);
  }

 private:
  template <class Shape>
  static Shape made(const ObstacleForm& form) {
    Shape shape{};
    if constexpr (requires { shape.field; }) {
      shape.field = form.field;
    } else if constexpr (!std::is_empty_v<Shape>) {
      static_assert(std::is_trivially_copyable_v<Shape>);
      std::memcpy(&shape, form.lengths.data(), sizeof(Shape));
    }
    return shape;
  }
  template <int first, class Apply, class Here, class... Rest>
  static auto with_from(const ObstacleForm& form, Apply& apply) {
    if constexpr (sizeof...(Rest) > 0) {
      if (form.shape != first) return with_from<first + 1, Apply, Rest...>(form, apply);
    }
    return apply(made<Here>(form));
  }
};

}  // namespace phyxel
