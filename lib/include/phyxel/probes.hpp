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

/// The probes of a model, ready to be read. At a point, each value is that of a quadratic
/// polynomial, fitted by weighted least squares to the values of the phyxels of the same material
/// within the support of the nearest one, on the same side of each wall (`shares_at`). Stress and
/// strain are the fields of `find_fields`. Readings are the same on any number of ranks.
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

  /// True if there are no probes.
  bool empty() const { return probes_.empty(); }
  /// Reads all probes at the backend's present state, in their order. Collective on a share.
  /// @param recovery for stresses and strains (`find_fields`), or null
  std::vector<ProbeReading> read(Backend& backend, const Recovery* recovery = nullptr) const;

 private:
  /// A point, and the phyxels of this rank with their shares in a value there.
  struct Point {
    std::size_t probe = 0;
    Index number = 0;
    Vec3d place;
    std::vector<Index> phyxels;
    std::vector<double> share;  // of each phyxel
  };
  void add_points();

  const Model& model_;
  std::vector<Probe> probes_;
  std::vector<Point> points_;
};

}  // namespace phyxel
