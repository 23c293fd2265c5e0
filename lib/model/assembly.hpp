/// What models are put together from, by whoever has all of a body or a part of it.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "exact_sum.hpp"
#include "model/box.hpp"
#include "model/cloud_check.hpp"
#include "model/cloud_piece.hpp"
#include "model/loads.hpp"
#include "model/selection.hpp"
#include "model/symmetry.hpp"
#include "model/walls.hpp"
#include "phyxel/model.hpp"

namespace phyxel {

/// The motion along the path of a request, without phyxels, axes and names.
Motion motion_along(const MotionRequest& request);

/// True if the neighbour lists of a body cannot be left to a device, which can close gradients.
bool needs_lists_on_host(const BodyRequest& request);
/// True likewise, for a body whose cloud the caller has made.
bool needs_lists_on_host(const BodyRequest& request, const Cloud& cloud);

/// The rest cloud of a source, before it is scaled and moved. Only meshes and lattices have phyxels
/// where they are cut.
Cloud rest_cloud(const CutSource& from);
/// True if a source is a lattice: a shape, but neither fitted nor one of the paper's bodies.
bool is_lattice(const BodySource& source);
/// True if there may be phyxels on the boundary of a support and inside it.
bool has_rooms(const CutSource& from);
/// A piece of a lattice, before it is scaled and moved.
CloudPiece lattice_piece(const CutSource& from, Piece piece = {});

/// Rotation by |r| about r (Rodrigues).
Mat3d rotation_by(Vec3d radians);

/// The rotation of a body.
Mat3d rotation_of(const BodyRequest& request);

/// Scales, turns and moves points as asked.
void place(std::vector<Vec3d>& points, const BodyRequest& request);
/// Scales, turns and moves a cloud as asked.
void place(Cloud& cloud, const BodyRequest& request);

/// Strength of a body's hourglass control: what it asks for, or the default.
double hourglass_of(const BodyRequest& request);

/// @throws InputError if a body asks for terms that do not go together
void check_terms(const BodyRequest& request);

/// Lists of bodies with supports of pairs are made on the host.
/// @throws InputError if a surveyor is to find those of a body. @param rule resolved
void refuse_pairs_surveyed(const BodyRequest& request, const NeighbourhoodRule& rule);

/// Whether the volumes of a body follow from the kernel.
/// @throws InputError if it can have none as asked
bool wants_kernel_volumes(const BodyRequest& request, bool has_volumes, std::size_t phyxels);

/// r̄_i³ w_ii + Σ_j r̄_j³ w_ij of each phyxel [begin, begin + spacing.size()) of a neighbourhood.
/// @param pairwise true if the weight of a pair has the mean of its supports
std::vector<double> kernel_sums(std::span<const Vec3d> position, const Neighbourhood& hood,
                                const std::vector<double>& spacing, bool pairwise, Index begin = 0);

struct Masses {
  std::vector<double> mass, volume;
};
/// The 2004 rule: m_i = s r̄_i³ ρ with s such that the mean kernel density Σ_j m_j w_ij is ρ
/// (the phyxel itself included), v_i = m_i / ρ_i. Source: Mueller et al. 2004, section 4.2.
/// @param kernel_sum kernel density over ρ, for s = 1. @param mean of those of the body
Masses kernel_masses(const std::vector<double>& spacing, const std::vector<double>& kernel_sum,
                     double mean, double density);
/// Phyxels that lie all in one place have no volume by the kernel rule, and so no mass.
/// @throws InputError with the first phyxel whose mass or volume is zero or not finite
void check_masses(const BodyRequest& request, const Masses& masses);
/// The same of phyxel i of a body alone. @param mass [kg] @param volume [m³]
void check_mass(const BodyRequest& request, Index i, double mass, double volume);
Masses geometric_masses(const std::vector<double>& volume, double density);
/// Gives the phyxels [begin, end) of a body their inclusion's density. Volumes stay: by both rules
/// they follow from positions alone.
/// @param masses of the body, all by the density of its own material, `own_density` [kg/m³]
void give_density(Masses& masses, Index begin, Index end, double density, double own_density,
                  bool kernel_volumes);

/// "uniform support, 1.8 x the mean distance to the 10 nearest"
std::string in_words(const NeighbourhoodRule& rule);

/// Appends rows; moves them if there are none before.
/// @param shift what the indices of the rows are counted from
void append_rows(Csr& to, Csr&& rows, Index shift);
/// Appends a body's lists, which are moved if it is the first body. Inverse ones are stored for all
/// bodies as soon as one needs them.
void append_lists(Neighbourhood& all, Neighbourhood&& hood, Index shift);

/// @param shift what the indices found are counted from
void append(Degenerate& to, const Degenerate& found, Index shift);

/// Moments A_i, their pseudo-inverses and the offsets b_i; notes the degenerate phyxels, except
/// those that are supported and have only supported neighbours. Nothing where the lists are left to
/// a device.
void find_moments(Model& model);

/// What the summary shall warn of, once all bodies are in. @param surfels of the whole model
void add_warnings(Model& model, std::size_t surfels);

/// Σ h³ of some phyxels [m³]. @param support of each [m]
ExactSum sum_of_cubes(std::span<const double> support);

/// Mass, volume and centre of a body, in exact sums.
struct BodySums {
  ExactSum mass, volume;
  ExactVector moment;
  void add(const Model& model, Index begin, Index end) {
    for (Index i = begin; i < end; ++i) add(model.mass[i], model.volume[i], model.position[i]);
  }
  void add(double m, double v, Vec3d x) {
    mass.add(m);
    volume.add(v);
    moment.add(m * x);
  }
  void add(const BodySums& other) {
    mass.add(other.mass);
    volume.add(other.volume);
    moment.add(other.moment);
  }
  void tell(Part& part) const;
};

/// What a body's boundary selects, entry by entry: what is fixed, then motions, then loads, then
/// regions of probes, as the scene has them.
std::vector<const Selection*> selections_of(const BodyRequest& request);

/// The axes of the fixed and moved entries of a body, in the order of `selections_of`.
std::vector<Axes> axes_of_supports(const BodyRequest& request);

/// Which phyxels of a cloud each entry of the boundary of its body concerns.
struct BoundaryChoice {
  std::vector<std::vector<Index>> chosen;  ///< [entry], ascending, counted in the cloud.
  std::vector<std::vector<Index>> left;    ///< [support], phyxels that it leaves to others.
  std::size_t first_load = 0, first_probe = 0;
  std::vector<SymmetryPlane> planes;         ///< Planes of symmetry.
  std::vector<std::vector<Index>> at_plane;  ///< [plane], as `chosen`.

  /// A choice in which no entry of a body has phyxels yet.
  static BoundaryChoice empty_of(const BodyRequest& request);

  /// The phyxels that an entry selects, with those that it leaves to others, ascending.
  std::vector<Index> selected(std::size_t entry) const;

  /// The faces by which the next entry selects: those laid for a support, or those asked for.
  Faces faces_of_next() const { return chosen.size() < first_load ? Faces::laid : Faces::asked; }

  /// Leaves each phyxel that several supports share, and each of its axes, to one of these: to the
  /// one that holds or moves more axes, among them all of the other's; and of equal ones to the
  /// first in space. Supports at rest share what they both choose; others share faces, along which
  /// their regions touch. @param here as in `chosen`
  /// @throws InputError for supports that contradict each other there
  void share_boundaries(const BodyRequest& request, const SomePhyxels& here);
  /// Warns of supports whose faces have moved to the layers of a lattice.
  void warn_of_moved(const BodyRequest& request, const SupportCuts& cuts,
                     std::vector<std::string>& warnings) const;

  /// Warns of supports that move against each other, and between which the body is thinner than a
  /// spacing. @param box around the body's phyxels
  void warn_of_gaps(const BodyRequest& request, const SupportCuts& cuts, const Box& box,
                    std::vector<std::string>& warnings) const;

  /// Adds planes of symmetry. A phyxel that another entry, or an earlier plane, holds or moves
  /// along a plane's normal is left to that.
  void add_planes(const BodyRequest& request, std::span<const Vec3d> position,
                  std::vector<SymmetryPlane> symmetry);

  /// Phyxel i of the cloud is phyxel place[i] of the body.
  void renumber(const std::vector<Index>& place);
  /// The numbers of phyxels that each entry chooses, then of those that each support leaves.
  std::vector<std::int64_t> counts() const;
  /// Sums over the phyxels of each load. @param origin of positions in the sums [m]
  std::vector<LoadSums> load_sums(const Model& model, Index shift, Vec3d origin) const;
  /// @param counts of each entry, in the whole body. @throws InputError for one of nothing
  void refuse_empty(const BodyRequest& request, const std::vector<std::int64_t>& counts,
                    const Box& box) const;
  /// Warns of boxes and balls that hold or move one or two phyxels.
  /// @param counts of each entry, in the whole body
  void warn_of_few(const BodyRequest& request, const std::vector<std::int64_t>& counts,
                   std::vector<std::string>& warnings) const;
  /// @param loaded sums of each load, in the whole body, and the `origin` of their positions [m]
  /// @param pieces of the body that are loaded
  void add_to(Model& model, const BodyRequest& request, Index shift,
              const std::vector<LoadSums>& loaded, Vec3d origin,
              const std::vector<std::optional<BodyPiece>>& pieces) const;
};

/// @param number which phyxels of a body of `size` the cloud has, ascending; empty: all
/// @throws InputError naming the scene's line for unknown regions, indices out of range, and
///   phyxels that two entries move
BoundaryChoice choose_boundary(const BodyRequest& request, const Cloud& cloud,
                               std::span<const Index> number, Index size);

/// The name of the entry of a support, e.g. "motion 1". @param entry in `selections_of`
std::string name_of_support(const BodyRequest& request, std::size_t entry);

}  // namespace phyxel
