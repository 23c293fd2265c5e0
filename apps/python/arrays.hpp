/// Conversions between NumPy arrays and the library's vectors.
#pragma once

#include <fmt/format.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "phyxel/cloud.hpp"
#include "phyxel/error.hpp"
#include "phyxel/types.hpp"

namespace pybind11::detail {

/// Conversion of a vector to (x, y, z).
template <>
struct type_caster<phyxel::Vec3d> {
  PYBIND11_TYPE_CASTER(phyxel::Vec3d, const_name("tuple[float, float, float]"));
  bool load(handle source, bool) {
    if (!isinstance<sequence>(source) && !isinstance<array>(source)) return false;
    const auto numbers = reinterpret_borrow<sequence>(source);
    if (len(numbers) != 3) return false;
    value = {float_(numbers[0]), float_(numbers[1]), float_(numbers[2])};
    return true;
  }
  static handle cast(const phyxel::Vec3d& v, return_value_policy, handle) {
    return make_tuple(v.x, v.y, v.z).release();
  }
};

}  // namespace pybind11::detail

namespace phyxel::python {

namespace py = pybind11;

using Shape = std::vector<py::ssize_t>;

/// A NumPy array of memory that `owner` keeps alive.
template <class T>
py::array over(const T* data, Shape shape, py::handle owner) {
  // NumPy does not accept a null pointer, even for an empty array.
  if (data == nullptr) return py::array_t<T>(std::move(shape));
  return py::array(py::dtype::of<T>(), std::move(shape), data, owner);
}
inline py::array over(const std::vector<Vec3d>& vectors, py::handle owner) {
  return over(vectors.empty() ? nullptr : &vectors.front().x,
              {static_cast<py::ssize_t>(vectors.size()), 3}, owner);
}
inline py::array over(const std::vector<Mat3d>& matrices, py::handle owner) {
  return over(matrices.empty() ? nullptr : &matrices.front().a[0][0],
              {static_cast<py::ssize_t>(matrices.size()), 3, 3}, owner);
}
inline py::array over(const std::vector<Triangle>& triangles, py::handle owner) {
  return over(triangles.empty() ? nullptr : triangles.front().data(),
              {static_cast<py::ssize_t>(triangles.size()), 3}, owner);
}
template <class T>
py::array over(const std::vector<T>& values, py::handle owner) {
  return over(values.data(), {static_cast<py::ssize_t>(values.size())}, owner);
}

/// A read-only NumPy view of memory that belongs to `owner`.
template <class... What>
py::array view(What&&... what) {
  py::array array = over(std::forward<What>(what)...);
  array.attr("flags").attr("writeable") = false;
  return array;
}

/// A NumPy array that takes ownership of a vector, without a copy.
template <class T>
py::array taken(std::vector<T>&& values) {
  auto* kept = new std::vector<T>(std::move(values));
  const py::capsule owner(kept, [](void* p) { delete static_cast<std::vector<T>*>(p); });
  return over(*kept, owner);
}

/// An owner of NumPy arrays that keeps an object alive.
template <class T>
py::capsule keeper(std::shared_ptr<T> kept) {
  return py::capsule(new std::shared_ptr<T>(std::move(kept)),
                     [](void* p) { delete static_cast<std::shared_ptr<T>*>(p); });
}

/// The shape of an array as text, e.g. "(5, 2)".
inline std::string shape_words(const py::array& array) {
  return py::str(array.attr("shape")).cast<std::string>();
}

/// Rows of three finite numbers from an array. @param rows required number of rows; -1 for any
/// @throws InputError naming `what`
inline std::vector<Vec3d> vectors_from(const py::handle& object, const char* what,
                                       py::ssize_t rows = -1) {
  const auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(object);
  if (!array) {
    PyErr_Clear();
    throw InputError(fmt::format("{}: not an array of numbers; allowed: shape ({}, 3)", what,
                                 rows < 0 ? "n" : std::to_string(rows)));
  }
  if (array.ndim() != 2 || array.shape(1) != 3 || (rows >= 0 && array.shape(0) != rows)) {
    throw InputError(fmt::format("{}: shape {} found; allowed: ({}, 3)", what, shape_words(array),
                                 rows < 0 ? "n" : std::to_string(rows)));
  }
  std::vector<Vec3d> vectors(static_cast<std::size_t>(array.shape(0)));
  const auto values = array.unchecked<2>();
  for (py::ssize_t i = 0; i < array.shape(0); ++i) {
    const Vec3d v{values(i, 0), values(i, 1), values(i, 2)};
    if (!is_finite(v)) {
      throw InputError(fmt::format("{}: [{}, {}, {}] found in row {}; allowed: finite numbers",
                                   what, v.x, v.y, v.z, i));
    }
    vectors[static_cast<std::size_t>(i)] = v;
  }
  return vectors;
}

/// Numbers from an array of shape (rows,). @throws InputError naming `what`
inline std::vector<double> numbers_from(const py::handle& object, const std::string& what,
                                        py::ssize_t rows) {
  const auto array = py::array_t<double, py::array::c_style | py::array::forcecast>::ensure(object);
  if (!array || array.ndim() != 1 || array.shape(0) != rows) {
    PyErr_Clear();
    throw InputError(fmt::format("{}: {} found; allowed: shape ({},)", what,
                                 array ? "shape " + shape_words(array) : "no array of numbers",
                                 rows));
  }
  return {array.data(), array.data() + rows};
}

void add_clouds(py::module_& module);
void add_files(py::module_& module);
void add_simulation(py::module_& module);

}  // namespace phyxel::python
