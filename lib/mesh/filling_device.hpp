/// Filling of closed surfaces with the help of a device.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "bulk.hpp"
#include "mesh/inside_samples.hpp"
#include "mesh/triangle.hpp"
#include "phyxel/mesh.hpp"

namespace phyxel {

/// Number of phyxels below which a host has filled a body before a device would have.
inline constexpr Index least_filled_by_device = 20'000;

/// True if a device can do a part of the work of a request: that of a body with phyxels on its
/// surface and the same distance between phyxels everywhere.
inline bool suits_device(const SampleRequest& request) {
  return !request.grading && request.on_surface.value_or(true);
}
/// True if it is then done sooner, too.
inline bool is_worth_device(const SampleRequest& request) {
  return suits_device(request) && request.phyxels >= least_filled_by_device;
}

/// Mean work of a winding number, `InsideSampler::winding_work`, above which the host tells sooner
/// than a device what is inside: it walks past few triangles where a device would visit most. A
/// scan takes a thousand, a disc of long thin triangles 10⁵.
inline constexpr Offset most_winding_work = 4000;

/// Nodes of a lattice inside a surface.
struct LatticeNodes {
  Bulk<Vec3d> position;   ///< [m]
  Bulk<float> clearance;  ///< In spacings, shape [n_nodes].
};

/// The points on the surface from which nodes keep a distance.
struct SurfaceMarks {
  std::span<const Vec3d> sites;    ///< Phyxels on the surface and on cuts [m].
  std::span<const Vec3d> samples;  ///< Sample points on the surface and on cuts [m].
  double spacing = 0;              ///< Lattice constant [m].
  /// Distance from a place on the surface to the nearest phyxel on it, at most [m].
  double farthest = 0;
};

/// Points that repel each other, and those that move.
struct RepelledPoints {
  std::span<const char> moves;  ///< Of the points after the first `fixed` ones: 1 if it moves.
  std::size_t fixed = 0;        ///< Number of the points on the surface and on cuts, which stay.
  Index on_surface = 0;         ///< Number of those on the surface, which come first.
  double spacing = 0;           ///< Lattice constant [m].
  double clear = 0;             ///< Radius of the largest balls without triangles [m].
  int sweeps = 0;
};

/// Points on the faces of a surface that are to be evened out, and what they lie on.
struct PointsOnFaces {
  const Surface& surface;
  std::span<const PointOn> samples;  ///< Spread over the surface, with their triangles.
  std::size_t fixed = 0;             ///< Number of the first points, which stay.
  double spacing = 0;                ///< Wanted distance between the points [m].
  int sweeps = 0;
};

/// A closed surface on a device. Results have the bits of the host's. There are none if the device
/// lacks memory, or if a winding number is too far from whole numbers to tell inside from outside:
/// then the host does the work.
class SurfaceOnDevice {
 public:
  virtual ~SurfaceOnDevice() = default;
  /// The candidates that `fill_with_darts` accepts, in random order [m].
  /// @param candidates in the order of their numbers, of which their ranks follow [m]
  /// @param before points accepted in advance [m]. @param gap least distance between points [m]
  virtual std::optional<std::vector<Vec3d>> darts(std::span<const Vec3d> candidates,
                                                  std::span<const Vec3d> before, double gap,
                                                  std::uint64_t seed) const = 0;
  /// Moves points on faces [m] as `relax_on_faces` does without a margin.
  /// @returns false if they are where they were
  virtual bool even_out(std::span<Vec3d> point, const PointsOnFaces& faces) const = 0;
  /// The nodes in the regions that are inside, in the order of the host.
  virtual std::optional<LatticeNodes> nodes(const InsideSampler::Regions& regions,
                                            const SurfaceMarks& marks) const = 0;
  /// Moves points [m] by sweeps of repulsion. @returns false if they are where they were
  virtual bool repel(std::span<Vec3d> point, const RepelledPoints& which) const = 0;
  /// The distance from each wanted point to the nearest other one [m]; others have 0.
  /// @param wanted 1 for each of the points whose distance is wanted
  virtual std::optional<std::vector<double>> gaps(std::span<const Vec3d> point, double spacing,
                                                  std::span<const char> wanted) const = 0;
  /// The number of sample points inside that each site is nearest to; see `NearestSite`.
  virtual std::optional<std::vector<std::uint32_t>> samples_of_sites(
      const InsideSampler::Regions& regions, std::span<const Vec3d> site, double spacing) const = 0;
};

/// A device that fills surfaces.
class FillingDevice {
 public:
  virtual ~FillingDevice() = default;
  /// Brings a surface to the device. @returns null if the host is faster, or the memory too small
  virtual std::unique_ptr<SurfaceOnDevice> take(const WindingNumber& surface,
                                                Index phyxels) const = 0;
};

/// A scope in which this thread fills surfaces with the help of a device.
class FillingScope {
 public:
  /// @param device null for the host alone
  explicit FillingScope(std::shared_ptr<const FillingDevice> device);
  FillingScope(const FillingScope&) = delete;
  FillingScope& operator=(const FillingScope&) = delete;
  ~FillingScope();
  /// The device of the innermost scope; null if there is none.
  static const FillingDevice* device();

 private:
  std::shared_ptr<const FillingDevice> device_;
  const FillingDevice* before_;
};

}  // namespace phyxel
