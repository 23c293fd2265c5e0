/// One instant of a run as a VTKHDF file.
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

/// Attribute of the group /phyxel of frames whose positions a float would hold too coarsely.
inline constexpr const char* far_attribute = "positions_need_double";

/// Whose positions a frame holds.
enum class Points : std::uint8_t { phyxels, surfels };
/// Whether floats hold the positions of a model's points: in every body the distance between two
/// neighbouring floats, at the largest coordinate that the body may have, is at most a thousandth
/// of the distance between two of its points. The answer follows from figures of the whole bodies
/// and of the whole model, so that it is the same on any number of ranks and after a restart.
/// @param displacement the largest of any phyxel [m]
bool floats_hold_positions(const Model& model, double displacement, Points points);

/// A number of `Diagnostics`, as a column of the energy log and an attribute of every frame.
struct DiagnosticColumn {
  const char* name;
  const char* unit;
  double (*value)(const Diagnostics&);
};
std::span<const DiagnosticColumn> diagnostic_columns();

/// VTKHDF UnstructuredGrid 1.0, what every ParaView since 5.10 opens: one poly-vertex cell a body.
/// Positions in the precision of the run's state, and in double where floats do not hold them.
/// `model` may be a rank's share.
void write_phyxel_frame(const std::filesystem::path& file, const Model& model, const Scene& scene,
                        const Diagnostics& diagnostics, ChunkedSource& values);

/// The same for the deformed surface: triangles, with normals.
void write_surface_frame(const std::filesystem::path& file, const Model& model, const Scene& scene,
                         const Diagnostics& diagnostics, ChunkedSource& values);

/// Values of an array's rows. @param values_of those of one of its terms
template <class ValuesOf>
std::vector<double> sum_of_terms(const FileArray& array, ValuesOf&& values_of) {
  const auto first = values_of(array.terms[0]);
  // Not added to zero, which would lose the sign of another.
  std::vector<double> sum(first.begin(), first.end());
  for (std::size_t t = 1; t < array.terms.size(); ++t) {
    const auto more = values_of(array.terms[t]);
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += more[k];
  }
  return sum;
}

class Hdf5Writer;
/// An array that comes when the file is written.
void write_later(Hdf5Writer& out, const FileArray& array, ChunkedSource& values);

}  // namespace phyxel
