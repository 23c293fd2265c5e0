/// Frames: the state of a run at one time, as VTKHDF files.
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "phyxel/model.hpp"
#include "phyxel/recorder.hpp"
#include "phyxel/scene.hpp"

namespace phyxel {

inline constexpr const char* phyxel_frame_kind = "point frame";
inline constexpr const char* surface_frame_kind = "surface frame";

/// Attribute of the group /phyxel in frames for whose positions float is too coarse.
inline constexpr const char* far_attribute = "positions_need_double";

/// The points of a frame.
enum class Points : std::uint8_t { phyxels, surfels };
/// True if float is precise enough for the positions of a model's points: in each body the spacing
/// of floats at the body's largest coordinate is at most a thousandth of the distance between two
/// of its points. Only quantities of whole bodies and of the whole model enter, so that the result
/// does not depend on the number of ranks, nor on a restart.
/// @param displacement largest displacement of any phyxel [m]
bool floats_hold_positions(const Model& model, double displacement, Points points);

/// A quantity of `Diagnostics`: a column of the energy log and an attribute of each frame.
struct DiagnosticColumn {
  const char* name;
  const char* unit;
  double (*value)(const Diagnostics&);
};
std::span<const DiagnosticColumn> diagnostic_columns();

/// Writes the phyxels as VTKHDF UnstructuredGrid 1.0 (ParaView 5.10 and later), one poly-vertex
/// cell for each body. Positions have the precision of the run's state, or double if float is too
/// coarse. `model` may be a rank's share.
void write_phyxel_frame(const std::filesystem::path& file, const Model& model, const Scene& scene,
                        const Diagnostics& diagnostics, ChunkedSource& values);

/// Writes the deformed surface in the same format: triangles, with normals.
void write_surface_frame(const std::filesystem::path& file, const Model& model, const Scene& scene,
                         const Diagnostics& diagnostics, ChunkedSource& values);

/// Values of an array's rows: the sum of its terms.
/// @param values_of function that returns the values of one term
template <class ValuesOf>
std::vector<double> sum_of_terms(const FileArray& array, ValuesOf&& values_of) {
  const auto first = values_of(array.terms[0]);
  // The sum starts with the first term: adding to +0 would lose the sign of -0.
  std::vector<double> sum(first.begin(), first.end());
  for (std::size_t t = 1; t < array.terms.size(); ++t) {
    const auto more = values_of(array.terms[t]);
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += more[k];
  }
  return sum;
}

class Hdf5Writer;
/// Adds an array whose values are read from `values` when the file is written.
void write_later(Hdf5Writer& out, const FileArray& array, ChunkedSource& values);

}  // namespace phyxel
