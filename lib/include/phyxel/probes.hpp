/// Values at points and over regions of bodies.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "phyxel/backend.hpp"
#include "phyxel/model.hpp"
#include "phyxel/recovery.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// The values at one point of a probe, or the means over its region by volume.
struct ProbeReading {
  std::string probe;             ///< Its name.
  Index number = 0;              ///< Of the point, from 0.
  Vec3d place;                   ///< At rest; of a region, its centroid [m].
  Vec3d displacement, velocity;  ///< [m], [m/s]
  /// Cauchy stress [Pa] and Green's strain: xx, yy, zz, xy, yz, xz.
  std::array<double, 6> stress{}, strain{};
  double von_mises = 0;  ///< Of the stress at a point; over a region, the mean [Pa].
};

/// A number of a reading: a column of `probes.csv`.
struct ProbeColumn {
  const char* name;
  const char* unit;  ///< "" if it has none.
  double (*value)(const ProbeReading&);
};
/// The numbers of a reading, in the order of the columns.
std::span<const ProbeColumn> probe_columns();

/// The probes of a model, ready to be read. At a point, displacement and its gradient are those of
/// a quadratic polynomial, fitted by weighted least squares to the thirty nearest phyxels of the
/// same material, on the same side of each wall: of second order, on the surface as well. Stress
/// follows from the gradient by the law; that of a law with a history is fitted itself. Directions
/// that the phyxels do not span have no derivatives, and where they are too few for a quadratic
/// polynomial, the fit is linear. Readings are the same on any number of ranks.
class Probes {
 public:
  /// The probes of the model's scene. Collective on a share.
  /// @param model must outlive this
  /// @throws InputError for a point that is farther from the nearest phyxel of its body than half
  /// that
  ///   one's support radius, about a spacing
  explicit Probes(const Model& model) : Probes(model, model.probes) {}
  /// Other probes. @throws InputError likewise, and for a body that the model lacks
  Probes(const Model& model, std::vector<Probe> probes);

  bool empty() const { return probes_.empty(); }
  /// Reads all probes at the backend's present state, in their order. Collective on a share.
  /// @param recovery for the stresses and strains over regions (`find_fields`), or null
  std::vector<ProbeReading> read(Backend& backend, const Recovery* recovery = nullptr) const;

 private:
  /// A point, and the phyxels of this rank with their shares in the value and the gradient there.
  struct Point {
    std::size_t probe = 0;
    Index number = 0;
    Vec3d place;
    std::size_t part = 0;
    std::vector<Index> phyxels;
    std::vector<double> value;    // of each phyxel
    std::vector<Vec3d> gradient;  // of each phyxel [1/m]
  };
  void add_points();

  const Model& model_;
  std::vector<Probe> probes_;
  std::vector<Point> points_;
};

}  // namespace phyxel
