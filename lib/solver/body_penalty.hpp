/// Contact of bodies with each other in searches by Newton's method.
#pragma once

#include <span>
#include <vector>

#include "exact_sum.hpp"
#include "model/owned_vectors.hpp"
#include "phyxel/model.hpp"
#include "solver/anderson.hpp"
#include "solver/body_contacts.hpp"
#include "solver/slip.hpp"

namespace phyxel {

/// The contact of bodies with each other by penalties. Between two calls of `linearise`, normals
/// and shares stay what they were, so that forces are the derivative of an energy:
///   E = Σ ½ k g²  over g < 0,   g = g₀ + n̄ · (d_p - Σ r_k d_k),
/// with displacements d since then. Friction has a potential of the slips then
/// (`friction_penalty`), which are the same but along surfaces (`slip_share`), since the start of a
/// stage.
class BodyPenalty {
 public:
  using Vector = OwnedVectors::Vector;

  /// @param model must outlive this
  explicit BodyPenalty(const Model& model);

  /// True in scenes whose bodies do not touch each other.
  bool empty() const { return !model_.body_contact.acts(); }
  /// True if the contact of some bodies has friction.
  bool rubs() const { return rubs_; }
  /// Finds which points are near other bodies, and how. Of a share: collective, as all that follow.
  /// @param u displacements [m]. @param slip what slip is; not used without friction
  /// @param gradient of displacement, shape [n, 3, 3]
  void linearise(const Vector& u, const SlipMeasure& slip, const std::vector<Mat3d>& gradient);
  /// Moves the points to displacements u, with gaps by the linear form of the last `linearise`.
  void move_to(const Vector& u, const SlipMeasure& slip);
  /// The farthest way of a point from its place at `linearise` to displacements u, as a share of
  /// the largest one up to which normals are kept. Of this rank's points.
  double way_to(const Vector& u) const;
  /// Begins a search anew: points, normals and gaps of earlier searches have no influence on it, so
  /// that a restart gives the same bits.
  void forget() {
    knows_points_ = false;
    far_ = 0.01;
    renewals_ = 0;
    record_.forget();
  }
  /// As of `RubbingRecord`, and sets friction anew.
  void renew_normals(double share) {
    record_.renew(share);
    mix_friction();
  }
  std::pair<double, double> unrest() const { return record_.unrest(); }
  /// As of `ContactPenalty`.
  bool begin_sliding();
  /// Replaces the gaps at u, the displacements of `linearise`, by those from which the next step of
  /// Newton's method is most likely to lead to a place where gaps are what it takes them for: they
  /// depend on deformation in ways that the stiffness does not know.
  /// @returns true if that changes forces
  bool mix(const Vector& u, double share);
  /// Adds the forces at displacements u [N].
  void add(const Vector& u, Vector& force) const;
  /// Adds the energies of this rank's points at displacements u [J].
  void add_energy(const Vector& u, ExactSum& sum) const;
  /// Adds the squared normal forces on this rank's points, as they were at `linearise` [N²].
  void add_squares(ExactSum& sum) const;
  /// Adds the stiffness at `linearise` times v [N].
  void add_stiffness_times(const Vector& v, Vector& out) const;
  /// Calls each(i, block) with the stiffness at `linearise` of this rank's phyxels i in contact
  /// against themselves [N/m], ascending. Not collective.
  template <class Each>
  void for_each_block(Each&& each) const {
    for (std::size_t p = 0; p < blocks_.size(); ++p) {
      const Mat3d& block = blocks_[p];
      if (block(0, 0) + block(1, 1) + block(2, 2) > 0) each(phyxel(p), block);
    }
  }
  /// The depths of this rank's points of each body in other bodies at `linearise`, as of
  /// `BodyContacts::depths`, and the largest one as a share of the point's support.
  struct Depths {
    std::vector<double> of_body;
    double share = 0;
  };
  Depths depths() const;
  /// Adds to the sums of each body what the forces at u, the displacements of `linearise`, do over
  /// a time [s].
  /// @param velocity of each phyxel in that time [m/s]. @param sums of the bodies (`ContactTerms`)
  void add_to(const Vector& u, const Vector& velocity, double time, std::span<ExactSum> sums) const;

 private:
  std::size_t count() const { return points_.own().size(); }
  Index phyxel(std::size_t p) const { return model_.body_contact.layer.phyxels[points_.own()[p]]; }
  /// True if the point of a row is of this rank.
  bool is_own(std::size_t r) const { return points_.rows()[r].point < static_cast<Index>(count()); }
  /// Calls each(p, share) for the points that carry the point of a row.
  template <class Each>
  void for_each_carrier(std::size_t r, Each&& each) const {
    const Offset* start = points_.near().offsets.data() + contact_threads * r;
    for (Offset e = start[0]; e < start[contact_threads]; ++e) {
      each(points_.near().indices[e], carries_[e]);
    }
  }
  void find_points(const Vector& u);
  void find_touches();
  /// True if a row pushes, or would at once.
  bool is_held(std::size_t r) const;
  void find_blocks();
  void add_friction_to_blocks();
  /// Vectors of the points, from those of phyxels.
  std::vector<Vec3d> of_points(const Vector& of_phyxels) const;
  /// The part along a row's normal of the vector of its point relative to those that carry it.
  double along_normal(std::size_t r, const std::vector<Vec3d>& of_points) const;
  /// Forces along normals that rows exert, on this rank's points.
  std::vector<Vec3d> spread(const std::vector<double>& push) const;
  RubbingRecord::Key key(std::size_t r) const {
    const ContactRow& row = points_.rows()[r];
    const auto bodies = static_cast<Index>(fields_.size());
    return {points_.ids()[row.point], row.patch * bodies + row.body};
  }
  /// Finds the slips at `linearise`, and friction by the present gaps.
  void find_rubbing(SlipMeasure measure);
  /// Sets friction anew where gaps have changed.
  void mix_friction();
  /// The slip of a row's point, from the motions of all points [m].
  Vec3d slip(std::size_t r, const std::vector<Vec3d>& moved) const;
  /// Calls each(r, friction) for the rows that rub, at displacements u. Collective on a share.
  template <class Each>
  void for_each_friction(const Vector& u, Each&& each) const;
  void add_friction_energy(const Vector& u, ExactSum& sum) const;
  /// Adds forces along surfaces on the points of rows, and their reactions, to this rank's points.
  void add_friction(const std::vector<Vec3d>& of_rows, std::vector<Vec3d>& force) const;
  /// Friction at displacements u on this rank's points [N], shape [own points].
  std::vector<Vec3d> friction(const Vector& u) const;
  /// Gaps at displacements u [m]; of points that are not near other bodies, what they were.
  std::vector<double> gaps(const Vector& u) const;
  /// The force along the normal of a row at a gap [m] [N].
  double push_at(std::size_t r, double gap) const;
  /// Forces along the normals at displacements u [N].
  std::vector<double> pushes(const Vector& u) const;

  const Model& model_;
  SurfaceLayer layer_;
  TouchingPoints points_;
  std::vector<PlacedDistances> fields_;  // of each body of the scene
  std::vector<double> modulus_;          // of pressure waves, of each point [Pa]
  std::vector<Vec3d> found_at_;          // places of the layer when points were found [m]
  std::vector<Vec3d> shaped_at_;         // places of own points when normals were found [m]
  std::vector<Vec3d> start_;             // displacements of the points to which gaps belong [m]
  std::vector<Vec3d> renewed_at_;        // displacements of the points at `linearise` [m]
  std::vector<SurfaceMotion> motion_;    // shape [points]
  std::vector<SurfaceTouch> touches_;    // shape [rows], as all others of rows
  std::vector<SurfaceShare> carries_;    // shape [entries]
  std::vector<double> gap_;              // g₀ of each row [m]
  std::vector<double> expected_;         // gaps at `linearise` by the linear form before it [m]
  std::vector<double> stiffness_;        // k of each row [N/m]
  std::vector<Mat3d> blocks_;            // of this rank's points [N/m]
  AndersonMixing mixing_;
  // Of friction; empty without it.
  bool rubs_ = false, has_two_frictions_ = false;
  double slip_share_ = 0;  // as of `SlipMeasure`
  RubbingRecord record_;
  std::vector<Vec3d> shape_place_;       // places of all points when normals were found [m]
  std::vector<Vec3d> slip_from_;         // displacements of all points as the stage starts [m]
  std::vector<RubbingContact> rubbing_;  // shape [rows]
  int renewals_ = 0;                     // in the search
  double stiff_reach_ = 0;               // gap of points with stiffness, as a share of ranges
  /// The way as a share of ranges from which on normals are found anew. They jump where a point
  /// passes an edge: it grows in a search, so that it comes to an end.
  double far_ = 0.01;
  // Whether points, normals and expected gaps belong to this search; the same on all ranks.
  bool knows_points_ = false, knows_shapes_ = false, knows_expected_ = false;
};

}  // namespace phyxel
