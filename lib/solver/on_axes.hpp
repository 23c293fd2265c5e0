/// Matrices of displacements that are free along some axes alone.
#pragma once

#include <Eigen/Dense>

#include "phyxel/types.hpp"

namespace phyxel {

/// A matrix without the rows and columns of axes that are not free.
/// @param rows,columns 1 along free axes, 0 along others
inline Mat3d on_axes(const Mat3d& matrix, Vec3d rows, Vec3d columns) {
  const double r[] = {rows.x, rows.y, rows.z}, c[] = {columns.x, columns.y, columns.z};
  Mat3d found;
  for (int e = 0; e < 9; ++e) found(e / 3, e % 3) = r[e / 3] * c[e % 3] * matrix(e / 3, e % 3);
  return found;
}

/// The inverse of a matrix on free axes, 0 on others; 0 if its diagonal has no positive sum.
inline Mat3d inverse_on_axes(const Mat3d& matrix, Vec3d free) {
  if (!(matrix(0, 0) + matrix(1, 1) + matrix(2, 2) > 0)) return {};
  const Mat3d own = on_axes(matrix, free, free);
  const double held[] = {1 - free.x, 1 - free.y, 1 - free.z};
  Eigen::Matrix3d all;
  for (int e = 0; e < 9; ++e) {
    all(e / 3, e % 3) = own(e / 3, e % 3) + (e % 4 == 0 ? held[e / 3] : 0);
  }
  const Eigen::Matrix3d inverse = all.inverse();
  Mat3d found;
  for (int e = 0; e < 9; ++e) found(e / 3, e % 3) = inverse(e / 3, e % 3);
  return on_axes(found, free, free);
}

}  // namespace phyxel
