/// Values of a whole model, brought to whoever writes a file, so many at a time.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "phyxel/cloud.hpp"

namespace phyxel {

/// What files hold of each phyxel, or of each surfel.
enum class Quantity {
  position,  ///< At rest.
  mass,
  volume,
  displacement,
  velocity,
  von_mises,
  volume_ratio,
  surfel_position,  ///< Deformed.
  surfel_normal
};

/// Numbers of one phyxel or surfel.
constexpr std::size_t width_of(Quantity quantity) {
  switch (quantity) {
    case Quantity::mass:
    case Quantity::volume:
    case Quantity::von_mises:
    case Quantity::volume_ratio:
      return 1;
    default:
      return 3;
  }
}
/// Whether surfels have it; else phyxels do.
constexpr bool is_of_surfels(Quantity quantity) {
  return quantity == Quantity::surfel_position || quantity == Quantity::surfel_normal;
}

/// An array of an HDF5 file: the sum of some quantities of so many phyxels, or surfels.
struct FileArray {
  std::string path;
  bool as_float = false;
  Index count = 0;
  std::vector<Quantity> terms;
};

/// Where a file's values come from: on one rank the arrays themselves; on several, wherever they
/// are, so that no rank holds those of the whole model.
class Stretches {
 public:
  /// 24 MB of vectors: long enough for messages and writes to be efficient, short beside what a
  /// rank holds anyway.
  static constexpr Index usual_length = 1 << 20;

  /// @param length of what is asked for at a time, at most
  explicit Stretches(Index length = usual_length) : length_(length) {}
  virtual ~Stretches() = default;
  Stretches(const Stretches&) = default;
  Stretches& operator=(const Stretches&) = default;

  /// Phyxels, surfels or triangles asked for at a time, at most.
  Index length() const { return length_; }
  /// Whether there are such values.
  virtual bool has(Quantity quantity) const = 0;
  /// Those of the whole model's phyxels, or surfels, `begin` to `end`. Valid until the next call.
  virtual std::span<const double> values(Quantity quantity, Index begin, Index end) = 0;
  /// All of the whole model.
  virtual std::span<const Triangle> triangles() const = 0;

  /// Whether an array of so many is written by all who have its values, instead of being asked for.
  virtual bool writes_together(Index) const { return false; }
  /// Has them write it into a file that is laid out. What else is in the file must be written anew.
  virtual void write_together(const std::filesystem::path&, const FileArray&) {}

 private:
  Index length_;
};

}  // namespace phyxel
