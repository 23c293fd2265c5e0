/// The values of a whole model, chunk by chunk, for the writers of files.
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
  stress,
  principal_stress,
  strain,
  boundary,
  broken,           ///< Broken share of the pairs.
  fragment,         ///< Number of the fragment (`fragment_numbers`).
  surfel_position,  ///< Deformed.
  surfel_normal,
  history  ///< The first column of a state's history; further ones follow (`history_quantity`).
};

/// From here on, quantities of phyxels as surfels have them.
inline constexpr std::size_t first_on_surface = std::size_t{1} << 20;
/// A quantity of phyxels as surfels have it (`OutputFields`).
constexpr Quantity on_surface(Quantity of_phyxels) {
  return static_cast<Quantity>(first_on_surface + static_cast<std::size_t>(of_phyxels));
}
/// True for a quantity that surfels have from phyxels.
constexpr bool is_on_surface(Quantity quantity) {
  return static_cast<std::size_t>(quantity) >= first_on_surface;
}

/// Column k of a state's history.
constexpr Quantity history_quantity(std::size_t k) {
  return static_cast<Quantity>(static_cast<std::size_t>(Quantity::history) + k);
}
/// True for a column of a state's history.
constexpr bool is_history(Quantity quantity) {
  return quantity >= Quantity::history && !is_on_surface(quantity);
}
/// Which one.
constexpr std::size_t history_column(Quantity quantity) {
  return static_cast<std::size_t>(quantity) - static_cast<std::size_t>(Quantity::history);
}

/// The components of a quantity.
constexpr std::size_t width_of(Quantity quantity) {
  if (is_on_surface(quantity)) {
    return width_of(static_cast<Quantity>(static_cast<std::size_t>(quantity) - first_on_surface));
  }
  if (is_history(quantity)) return 1;
  switch (quantity) {
    case Quantity::mass:
    case Quantity::volume:
    case Quantity::von_mises:
    case Quantity::volume_ratio:
    case Quantity::boundary:
    case Quantity::broken:
    case Quantity::fragment:
      return 1;
    case Quantity::stress:
    case Quantity::strain:
      return 6;
    default:
      return 3;
  }
}
/// True for a quantity of surfels, false for one of phyxels.
constexpr bool is_of_surfels(Quantity quantity) {
  return quantity == Quantity::surfel_position || quantity == Quantity::surfel_normal ||
         is_on_surface(quantity);
}

/// An array of an HDF5 file: the sum of some quantities of so many phyxels, or surfels.
struct FileArray {
  std::string path;
  bool as_float = false;
  Index count = 0;
  std::vector<Quantity> terms;
};

/// A source of a whole model's values: on one rank its arrays; on several the ranks, each of which
/// sends its part of a chunk, so that none holds the values of the whole model.
class ChunkedSource {
 public:
  /// 24 MB of vectors: long enough for messages and writes to be efficient, short beside what a
  /// rank holds anyway.
  static constexpr Index usual_length = 1 << 20;

  /// @param length of a chunk, at most
  explicit ChunkedSource(Index length = usual_length) : length_(length) {}
  virtual ~ChunkedSource() = default;
  ChunkedSource(const ChunkedSource&) = default;
  ChunkedSource& operator=(const ChunkedSource&) = default;

  /// The most phyxels, surfels or triangles of a chunk.
  Index length() const { return length_; }
  /// True if the source has this quantity.
  virtual bool has(Quantity quantity) const = 0;
  /// The values of phyxels, or surfels, [begin, end) of the whole model. Valid until the next call.
  virtual std::span<const double> values(Quantity quantity, Index begin, Index end) = 0;
  /// All triangles of the whole model.
  virtual std::span<const Triangle> triangles() const = 0;

  /// True if all ranks write an array of `count` rows themselves, each its own values.
  virtual bool writes_collectively(Index) const { return false; }
  /// Lets all ranks write an array into a file that is laid out. The rest of the file must be
  /// written again.
  virtual void write_collectively(const std::filesystem::path&, const FileArray&) {}

 private:
  Index length_;
};

}  // namespace phyxel
