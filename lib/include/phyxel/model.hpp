/// Everything about a scene that does not change while it runs.
#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/cloud.hpp"
#include "phyxel/load_curve.hpp"
#include "phyxel/neighbourhood.hpp"
#include "phyxel/physics/contact.hpp"
#include "phyxel/rigid.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/share.hpp"
#include "phyxel/space_region.hpp"

namespace phyxel {

/// How long the lists of neighbours are.
struct ListLengths {
  Offset pairs = 0;  ///< Entries of all lists.
  Index fewest = 0, most = 0;
};

/// What is of one material in one body: phyxels [begin, end), surfels [surfel_begin, surfel_end).
/// Most bodies are one part; those with inclusions are several, side by side, of which the first
/// has the surfels. In a rank's share, the last `ghosts` phyxels are stepped by other ranks.
struct Part {
  std::string name;
  Index body = 0;  ///< Which body of the scene it belongs to.
  Index begin = 0, end = 0;
  Index ghosts = 0;
  Index surfel_begin = 0, surfel_end = 0;
  Material material;
  std::string neighbourhood;  ///< The rule in words, for summaries.
  ListLengths lists;          ///< Of the whole part.
  double closure = 0;         ///< Tolerance of closed gradients; 0: they are not closed.
  /// True if the scene does not ask for closed gradients: a body whose sums cannot be closed is
  /// left as it is.
  bool automatic_closure = false;
  bool kernel_volumes = false;  ///< Volumes by the 2004 kernel rule instead of the geometry.
  Index size = 0;               ///< Phyxels of the whole part.
  Index surfels = 0;            ///< Surfels of the whole part.
  Vec3d origin;                 ///< Its body's first phyxel at rest [m]: solvers count from it.
  double mass = 0, volume = 0;  ///< Of the whole part [kg, m³].
  Vec3d centre;                 ///< Of its body's mass, at rest [m].
  /// H [m] of the weights of pairs (`pair_weight`), the median support of its body; 0 if weights
  /// follow from the support of one phyxel.
  double pair_length = 0;
  double support_cubes = 0;  ///< Σ h³ of the whole part [m³], with weights of pairs.
  double farthest = 0;       ///< Largest coordinate of its body's phyxels at rest, unsigned [m].

  /// The first of its ghosts.
  Index owned_end() const { return end - ghosts; }
};

/// Phyxels whose neighbours do not span space.
struct Degenerate {
  std::vector<Index> isolated;    ///< No neighbour: moment matrix of rank 0.
  std::vector<Index> collinear;   ///< Rank 1.
  std::vector<Index> coplanar;    ///< Rank 2.
  std::vector<Index> coincident;  ///< At the same place as another phyxel.
  /// Whether every phyxel's neighbours span space.
  bool none() const;
  std::string describe() const;  ///< Counts and the first few indices of each kind.
};

/// Where a motion has phyxels go, by where they are at rest.
struct Path {
  Vec3d displacement;  ///< [m]
  Mat3d turn{};        ///< A rotation less the identity.
  Vec3d about;         ///< What it leaves in place [m].
  Vec3d at(Vec3d rest) const { return displacement + turn * (rest - about); }  ///< [m]
};

/// Phyxels that follow a path along some axes. Fixed phyxels are a motion with every term zero.
struct Motion {
  std::vector<Index> phyxels;
  Vec3d displacement{};
  Vec3d rotation{};  ///< Axis times angle [rad].
  Vec3d about{};
  double duration = 0;
  Vec3d velocity{};
  Vec3d amplitude{};
  double frequency = 0;
  Axes axes{};
  std::string body = {};  ///< Name of the body to which the phyxels belong.
  std::string set = {};   ///< Entry of that body in the scene, e.g. "fixed 1", "motion 2".
  /// Where it is at a time [s].
  Path path_at(double time) const;
  /// Mean of the displacements over the step from `time` [s] and over the step before, both of
  /// `dt` [s]; nothing moves before t = 0.
  Path mean_step(double time, double dt) const;
  /// Displacement over the step that leads to `time` [s].
  Path last_step(double time, double dt) const;
  /// Of displacement and rotation, so much of the way.
  Path path_after(double share) const;
  /// Whether it only holds.
  bool stands_still() const {
    return displacement == Vec3d{} && rotation == Vec3d{} && velocity == Vec3d{} &&
           amplitude == Vec3d{};
  }
  /// Of a phyxel that was at `free` if nothing moved it: `path` along the axes of this motion.
  Vec3d along_axes(Vec3d path, Vec3d free) const {
    return {axes.x ? path.x : free.x, axes.y ? path.y : free.y, axes.z ? path.z : free.z};
  }
};

struct DistanceArrays;

/// A rigid body that phyxels cannot enter, at rest or on a path.
struct Obstacle {
  std::string name;
  ObstacleForm form;
  /// Surface of a mesh, in its own coordinates; null for other shapes.
  std::shared_ptr<const Surface> surface;
  /// What `form.field` reads; null before `set_field`, and for other shapes.
  std::shared_ptr<const DistanceArrays> distances;
  bool hollow = false;  ///< True if phyxels are kept inside.
  Mat3d turn{};         ///< Its rotation into place at rest.
  Vec3d place;          ///< Where its origin is at rest [m].
  ContactLaw law;
  /// Stiffness of its penalties in Verlet's steps, over that of a layer of phyxels; 0: projected.
  double penalty = 0;
  Motion motion;  ///< Its path; no phyxels follow it.
  /// Set for a free rigid body, which has no path: forces move it.
  std::optional<RigidMass> free;
  RigidState start;  ///< Of a free body: its state at t = 0.

  /// True if it is where it is at rest at all times.
  bool stands_still() const { return !free && motion.stands_still(); }
  /// Where it is at the end of the step of `dt` [s] that begins at `time` [s], and how it moves. A
  /// free body is at rest.
  ObstacleStep step_from(double time, double dt) const;
  /// Where it is at the end of a step between two places on its path, and how it moves.
  /// @param dt size of the step [s]; 0: it is at the later place, and does not move
  ObstacleStep step_between(const Path& before, const Path& after, double dt) const;
  /// Where it is at the end of a stage of `span` [s] of an implicit step that ends at `time` [s],
  /// and how it moves then.
  ObstacleStep stage_to(double time, double span) const;
  /// Where a free body in a state is, and how it moves.
  ObstacleStep placed(const RigidState& state) const;
  /// Where a free body is at the end of the step between two states, and how it moves.
  /// @param dt size of the step [s]
  ObstacleStep step_between(const RigidState& before, const RigidState& after, double dt) const;
  /// Finds the distances from the surface of a mesh, without which it cannot be touched.
  /// @param spacing of nodes near the surface [m]; they are farther apart if that would be too many
  /// @param band distance from the surface up to which they are as near [m]
  /// @returns the spacing of the nodes [m], or 0 for other shapes
  double set_field(double spacing, double band);
  /// Shares the surface of an equal mesh, and the distances from it, with another obstacle.
  /// @returns the spacing of the nodes [m]
  double share_field(const Obstacle& other);
  /// True if it has an end on all sides, as all shapes have but planes.
  bool is_bounded() const;
  /// Radius of the largest ball inside what bodies cannot enter [m]; infinite for a plane, and for
  /// what is hollow.
  double inner_radius() const;
  /// The middle of that ball in the shape's own coordinates [m].
  Vec3d middle() const;
  /// Upper bound of the speeds of its points over a step [m/s]; of a plane, at its place.
  double largest_speed(const ObstacleStep& step) const;
};

/// The phyxels by which bodies touch obstacles: those on or beside their surfaces that are not held
/// or moved along all axes. Of a share: those that this rank steps. None in models without
/// obstacles.
struct ContactLayer {
  std::vector<Index> phyxels;  ///< Ascending.
  std::vector<double> offset;  ///< Distance of each from its body's surface [m]; 0: it lies on it.
};

/// A point of a body's surface that supports hold or move along all axes.
struct HeldPoint {
  Index id = 0;          ///< Index of its phyxel in the whole model.
  Index motion[3] = {};  ///< Number of the motion that it follows along each axis.
  Vec3d rest;            ///< [m]
  double offset = 0;     ///< As of `ContactLayer` [m].
  double support = 0;    ///< [m]
};

/// Distances from the surface of a body at rest. Bodies that are copies of each other share the
/// arrays.
struct BodyDistances {
  std::shared_ptr<const DistanceArrays> arrays;  ///< Null for a body that touches no other.
  Mat3d turn = identity<double>();               ///< Rotation of the arrays' field into place.
  Vec3d place;                                   ///< Where the field's origin is in place [m].

  explicit operator bool() const { return arrays != nullptr; }
  /// A view of the arrays in place.
  PlacedDistances view() const;
  /// A view of `field`, a copy of the arrays on a device, in place.
  PlacedDistances view(const DistanceField& field) const { return {field, turn, place}; }
  /// The place of the arrays' deepest point [m].
  Vec3d deepest() const;
};

/// How the bodies of a scene touch each other.
struct BodyContact {
  /// Two bodies of the scene with a law of their own.
  struct Pair {
    Index first = 0, second = 0;  ///< Numbers of bodies, the smaller one first.
    ContactLaw law;
  };
  ContactLaw law;           ///< Of other pairs.
  std::vector<Pair> pairs;  ///< Ascending.
  bool all = true;          ///< True if other pairs touch, too.
  bool self = false;        ///< True if parts of one body touch each other, too.
  int sweeps = 1;           ///< How often contact is resolved in each step.
  double penalty = 0;       ///< As of `Obstacle`.
  /// Those of each body, by its number. Empty in scenes without such contact.
  std::vector<BodyDistances> distances;
  /// The phyxels by which bodies touch each other, held and moved ones, too.
  ContactLayer layer;

  /// True if bodies touch each other.
  bool acts() const { return !distances.empty(); }
  /// The law of two bodies, which may be the same one; null if they do not touch.
  const ContactLaw* law_of(Index a, Index b) const;
};

/// Forces on some phyxels, times the factor of a curve. Their directions are constant, unless they
/// follow the surface.
struct Load {
  std::vector<Index> phyxels;
  std::vector<Vec3d> force;  ///< At rest [N], shape [phyxels].
  Vec3d total;               ///< Sum of the forces but for those by volume [N].
  Vec3d density;             ///< Force by volume [N/m³].
  LoadCurve curve = {};      ///< How the forces change with time.
  std::string body = {};     ///< Name of the body to which the phyxels belong.
  std::string set = {};      ///< Entry of that body in the scene, e.g. "load 1", "traction 2".
  Vec3d centroid;            ///< Centroid of the sizes of the forces on all ranks [m].
  bool on_surface = false;   ///< True of a traction, which follows the areas of phyxels.
  bool follows = false;      ///< True of a pressure on the deformed surface (physics/follower.hpp).
  bool closed = false;       ///< True if that surface has no edge: its force and torque vanish.
  double pressure = 0;       ///< Of a pressure at rest [Pa].
  std::optional<double> gas = {};  ///< γ of a gas in a cavity, whose pressure grows as V^-γ.
  /// Returns the share of the force that acts at a time [s].
  double scale_at(double time) const { return curve.at(time); }
};

/// Where a load that follows the surface acts on phyxels of this rank. The gradient of displacement
/// there, by which the surface has turned and grown, is that of a quadratic polynomial, which is
/// accurate to second order on a surface, too.
struct Following {
  std::size_t load = 0;            ///< Number of the load among the model's.
  std::vector<std::size_t> entry;  ///< Numbers of the phyxels among the load's.
  Csr near;                        ///< Row k: the phyxels of which the gradient at entry k knows.
  std::vector<Vec3d> slope;        ///< Their shares in the gradient [1/m], shape [entries of near].
};

/// A place in a body whose values are logged: points at rest, or the phyxels of a region.
struct Probe {
  std::string name;
  std::string body;            ///< Name of the body.
  std::vector<Vec3d> points;   ///< At rest [m]; none: the phyxels are meant.
  std::vector<Index> phyxels;  ///< In a share, those that are here.
  std::string where = {};      ///< "scene.toml:30:1", for errors.
};

/// Surfels and the phyxels that carry each.
struct Surfels {
  std::vector<Vec3d> position;  ///< At rest [m], shape [n_surfels, 3].
  std::vector<Vec3d> normal;    ///< At rest, unit.
  std::vector<Triangle> triangle;
  Csr carriers;         ///< Row s: phyxels near surfel s.
  Index unreached = 0;  ///< Surfels outside every support, carried by the nearest phyxel.
  /// Named groups of the triangles of each body, counted from its first; none in a share.
  std::vector<std::map<std::string, std::vector<Index>>> groups;

  /// The triangles of a body, in a model that is no share: there they stand body by body.
  std::span<const Triangle> triangles_of(const Part& first_part) const;
};

/// Which pairs of phyxels of a model may break.
struct Fracture {
  bool breaks = false;   ///< True if pairs of a body of the scene may break.
  bool notched = false;  ///< True if a body of the scene has notches.
  /// The critical growth of the pairs of each phyxel (physics/fracture.hpp), of ghosts, too, shape
  /// [n]; negative if they never break. Empty unless `breaks`.
  std::vector<double> growth;

  /// True if pairs break, or are broken from the start.
  bool acts() const { return notched || breaks; }
};

/// All bodies of a scene, concatenated, with neighbours, masses and inverse moments. Bodies never
/// neighbour each other; parts of a body do. Immutable after `build_model`; host memory, double
/// precision. Neighbour lists and moments are empty where a `Surveyor` left them to its device.
struct Model {
  std::vector<Part> parts;
  std::vector<Vec3d> position;  ///< Rest positions X [m], shape [n, 3].
  std::vector<double> volume;   ///< v [m^3], shape [n].
  std::vector<double> mass;     ///< m [kg], shape [n].
  std::vector<Sym3d>
      inverse_moment;                ///< Pseudo-inverse of A_i = sum_j w_ij x_ij x_ij^T, shape [n].
  std::vector<Vec3d> moment_offset;  ///< b_i = sum_j w_ij x_ij, shape [n, 3].
  std::vector<Vec3d> closing;  ///< ĉ of closed gradients [1/m], shape [n]; empty: no body has them.
  Neighbourhood neighbourhood;
  Surfels surfels;
  std::vector<Motion> motions;  ///< Fixed and prescribed phyxels.
  std::vector<Load> loads;
  std::vector<Obstacle> obstacles;
  ContactLayer contact;
  /// The points of surfaces at which supports stop free rigid bodies, by ascending ids; of a share,
  /// the points of all ranks. Empty in models without free rigid bodies.
  std::vector<HeldPoint> held_points;
  BodyContact body_contact;
  std::vector<Following> following;  ///< Of loads that follow the surface, in their order.
  std::vector<Probe> probes;
  Fracture fracture;
  std::vector<Walls> walls;  ///< Of each body.
  Vec3d gravity;             ///< [m/s^2]
  Degenerate degenerate;
  std::vector<std::string> warnings;   ///< For the summary.
  std::shared_ptr<const Share> share;  ///< Null: this is the whole model.

  /// Phyxels, n; of a share with its ghosts.
  Index size() const { return static_cast<Index>(position.size()); }
  /// Whether a body has more than one part.
  bool has_inclusions() const;
  /// All parts of the body of a part of this model.
  std::span<const Part> parts_of_body(const Part& part) const;
  /// Phyxels of the whole model.
  Index global_count() const { return share ? share->global_count : size(); }
  /// Surfels of the whole model.
  Index global_surfel_count() const;
  /// Index of phyxel i in the whole model.
  Index global_id(Index i) const { return share ? share->global_id[i] : i; }
  /// Whether phyxel i is no ghost.
  bool owns(Index i) const { return !share || share->owned[i]; }
  /// Whether neighbour lists are here.
  bool has_lists() const { return neighbourhood.neighbours.rows() == size(); }
  /// This model, for whoever needs the lists. @throws InputError if they were left to a device.
  const Model& with_lists() const;
  /// Entries of all lists, whoever has them.
  Offset pairs() const;
};

/// Checks that the arrays of a model fit together: sizes agree, indices name existing phyxels and
/// surfels, neighbours belong to one body, and values are finite. Every backend calls it once, when
/// it is made.
/// @throws InputError naming the array, the value found, and what is allowed
void check_model(const Model& model);

/// Whether each phyxel is held in place along all axes by a motion that stands still, shape [n].
std::vector<char> held_phyxels(const Model& model);

/// The axes along which motions hold or move each phyxel (`Axes::bits`), shape [n].
std::vector<char> prescribed_axes(const Model& model);

/// True for each phyxel that motions hold or move along all axes, shape [n].
std::vector<char> supported_phyxels(const Model& model);

/// A number that tells two models apart: rest positions, supports, geometric volumes, materials,
/// motions and loads, and the surfaces of bodies with closed gradients, from which all else
/// follows; so it is the same whatever device built them. A checkpoint carries it, so that a state
/// never continues on another body. The digest of a share is that of the whole model, and
/// collective (see `SharedModel::digest`).
/// @param surfaces of the bodies of a share with closed gradients, which has no whole surface
/// itself
std::uint64_t model_digest(const Model& model, std::span<const Surface> surfaces = {});
/// The digest that checkpoints before version 4 hold: without gravity.
std::uint64_t model_digest_before_4(const Model& model, std::span<const Surface> surfaces = {});

/// The rest cloud of one body of a scene: shape, mesh or file; scaled, rotated, moved into place.
Cloud make_cloud(const BodyRequest& request);

/// The clouds of all bodies of a scene, in place. @param named those that bodies name as `cloud`
/// @throws InputError for a name that is not among them
std::vector<Cloud> make_clouds(const Scene& scene, const std::map<std::string, Cloud>& named);

/// Builds the model: clouds, neighbours, masses, volumes, moments, selections.
/// @throws InputError for a scene that `validate` refuses, naming the scene's line for selections
///   that match nothing, and for clouds that cannot carry the physics: places or volumes that are
///   not finite, volumes of nothing, phyxels farther from the origin than a scene's lengths may be.
Model build_model(const Scene& scene);

/// The same from clouds already in place, one for each body of the scene (whose source, scale,
/// rotation and translation are then unused).
Model build_model(const Scene& scene, std::span<const Cloud> clouds);

/// What a device has found out about the neighbourhoods of one body, phyxels counted from 0. The
/// lists themselves stay there, or are found again when they are needed.
struct Survey {
  std::vector<double> support;     ///< h_i [m], shape [n].
  std::vector<double> spacing;     ///< r̄_i [m], shape [n], where kernel volumes are wanted.
  std::vector<double> kernel_sum;  ///< r̄_i³ w_ii + Σ_j r̄_j³ w_ij, shape [n], likewise.
  ListLengths lists;
  Degenerate degenerate;
};
/// A device's search: finds neighbourhoods, leaves their lists there.
using Surveyor = std::function<Survey(std::span<const Vec3d> position,
                                      const NeighbourhoodRule& rule, bool kernel_volumes)>;

/// Leaves neighbours and moments to the device behind `survey`, whose backend finds them.
Model build_model(const Scene& scene, const Surveyor& survey);
/// The same from clouds already in place, one for each body of the scene.
Model build_model(const Scene& scene, std::span<const Cloud> clouds, const Surveyor& survey);

}  // namespace phyxel
