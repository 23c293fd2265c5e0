/// Host access to the arrays of the 2008 program: textures, slots and copies.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "check.hpp"
#include "cu_body.cuh"
#include "phyxel/neighbourhood.hpp"

namespace phyxel::paper {

/// A texture over linear device memory.
class Texture {
 public:
  Texture() = default;
  /// A texture whose elements are Texels; none for an empty array.
  template <class Texel, class T>
  static Texture over(const DeviceArray<T>& array) {
    Texture texture;
    if (array.size() == 0) return texture;
    cudaResourceDesc resource{};
    resource.resType = cudaResourceTypeLinear;
    resource.res.linear.devPtr = array.data();
    resource.res.linear.desc = cudaCreateChannelDesc<Texel>();
    resource.res.linear.sizeInBytes = array.bytes();
    cudaTextureDesc how{};
    how.readMode = cudaReadModeElementType;
    PHYXEL_CUDA(cudaCreateTextureObject(&texture.object_, &resource, &how, nullptr));
    return texture;
  }
  Texture(Texture&& other) noexcept { std::swap(object_, other.object_); }
  Texture& operator=(Texture&& other) noexcept {
    std::swap(object_, other.object_);
    return *this;
  }
  ~Texture() {
    if (object_) cudaDestroyTextureObject(object_);
  }
  cudaTextureObject_t object() const { return object_; }

 private:
  cudaTextureObject_t object_ = 0;
};

/// The rows of a CSR as slots, shape [most, rows]: entry k of row r is at k·rows + r; unused slots
/// are `no_neighbor`.
inline std::vector<unsigned short> slots_of(const Csr& csr, int most) {
  const auto rows = static_cast<std::size_t>(csr.rows());
  std::vector<unsigned short> slots(rows * static_cast<std::size_t>(most), no_neighbor);
  for (std::size_t r = 0; r < rows; ++r) {
    const auto row = csr.row(static_cast<Index>(r));
    for (std::size_t k = 0; k < row.size(); ++k) {
      slots[k * rows + r] = static_cast<unsigned short>(row[k]);
    }
  }
  return slots;
}

/// Length of the longest row.
inline int longest_row(const Csr& csr) {
  Index longest = 0;
  for (Index r = 0; r < csr.rows(); ++r) longest = std::max(longest, csr.length(r));
  return longest;
}

/// Copy of a device array.
template <class Real>
std::vector<Real> copy_of(const DeviceArray<Real>& array) {
  std::vector<Real> values(array.size());
  array.download(values.data());
  return values;
}

/// Stores a vector at three consecutive numbers.
template <class Real>
void set3(std::vector<Real>& to, std::size_t at, Vec3d v) {
  to[at] = static_cast<Real>(v.x);
  to[at + 1] = static_cast<Real>(v.y);
  to[at + 2] = static_cast<Real>(v.z);
}

/// The vector at three consecutive numbers.
template <class Real>
Vec3d at3(const std::vector<Real>& from, std::size_t at) {
  return {from[at], from[at + 1], from[at + 2]};
}

/// Row-major 3×3 matrices from consecutive numbers.
template <class Real>
std::vector<Mat3d> matrices(const std::vector<Real>& values) {
  std::vector<Mat3d> list(values.size() / 9);
  for (std::size_t k = 0; k < values.size(); ++k) {
    list[k / 9](static_cast<int>(k % 9) / 3, static_cast<int>(k % 3)) = values[k];
  }
  return list;
}

}  // namespace phyxel::paper
