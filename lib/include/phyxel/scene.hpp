/// A validated request for one simulation: what a scene file says, with units and defaults.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "phyxel/grading.hpp"
#include "phyxel/load_curve.hpp"
#include "phyxel/material.hpp"
#include "phyxel/neighbourhood.hpp"
#include "phyxel/shapes.hpp"
#include "phyxel/types.hpp"

namespace phyxel {

/// Arithmetic of a run. `mixed`: state in double, forces in float.
enum class Precision { single, double_, mixed };

/// Time integration of a scene. `verlet`: explicit steps below the stability limit. `implicit`:
/// steps of any size, each the solution of a balance of forces. `equilibrium`: the state of rest,
/// found directly.
enum class Method { verlet, implicit, equilibrium };

/// Contact in Verlet's steps. `projected`: points are moved out of what a step has led them into.
/// `penalty`: springs push them back, whose energy is kept.
enum class ContactMethod { projected, penalty };

/// Stiffness of penalties by default, as a share of that of a layer of phyxels.
inline constexpr double default_contact_stiffness = 0.1;

/// "float", "double" or "mixed".
const char* precision_name(Precision precision);

/// The precision with this name; `nullopt` if there is none.
std::optional<Precision> precision_named(std::string_view name);

/// "verlet", "implicit" or "equilibrium".
const char* method_name(Method method);

/// The method with this name; `nullopt` if there is none.
std::optional<Method> method_named(std::string_view name);

/// A selection of phyxels, in rest coordinates after placement. Exactly one member is set.
struct Selection {
  struct Box {
    Vec3d low, high;
  };  ///< [m]
  struct Ball {
    Vec3d centre;
    double radius = 0;
  };                                          ///< [m]
  std::optional<std::string> region;          ///< A named region of the cloud.
  std::optional<std::vector<Index>> indices;  ///< Phyxel indices within the body.
  std::optional<Box> box;
  std::optional<Ball> ball;
  /// A file with a closed surface, which is placed as the body is: what lies inside or on it.
  std::filesystem::path mesh;
  bool all = false;   ///< The whole body.
  std::string where;  ///< "scene.toml:12:3", for errors.
};

/// The axes along which a phyxel is fixed or prescribed; along the other axes it is free, as on
/// rollers.
struct Axes {
  bool x = true, y = true, z = true;
  /// True if the phyxel is constrained along every axis.
  bool all() const { return x && y && z; }
  /// One bit for each axis, x lowest.
  char bits() const { return static_cast<char>(x | y << 1 | z << 2); }
  bool operator==(const Axes&) const = default;
};

/// Phyxels of another material than their body's.
struct InclusionRequest {
  Selection select;
  Material material;
};

/// Fixed phyxels.
struct FixRequest {
  Selection select;
  Axes axes{};
};

/// The normal of a plane of symmetry: an axis of the scene.
enum class PlaneNormal { x, y, z };

/// A plane of symmetry, at which the body ends: its phyxels there are held along the normal, unless
/// another entry holds or moves them along it.
struct SymmetryRequest {
  PlaneNormal normal = PlaneNormal::x;
  double at = 0;           ///< Coordinate of the plane, once the body is in place [m].
  std::string where = {};  ///< "scene.toml:30:1", for errors.
};

/// Phyxels with a prescribed displacement:
/// u(t) = displacement * smoothstep(t / duration) + velocity * t + amplitude * sin(2 pi frequency
/// t), turned about a point by rotation * smoothstep(t / duration).
struct MotionRequest {
  Selection select;
  Vec3d displacement;    ///< [m]
  Vec3d rotation;        ///< Axis times angle [degrees]; any number of turns.
  Vec3d about;           ///< A point of that axis [m].
  double duration = 0;   ///< Duration of displacement and rotation [s].
  Vec3d velocity;        ///< [m/s]
  Vec3d amplitude;       ///< [m]
  double frequency = 0;  ///< [Hz]
  Axes axes{};
};

/// A force on phyxels: either `force`, the total [N] shared out by mass, or `force_density`
/// [N/m^3]. It changes with time by `ramp` or `curve`. In a box or a ball it acts on the space
/// there: its centroid, and with `force_density` its total, are those of the part of the body's
/// inside that lies in the region, if the body has a closed surface and one material.
struct LoadRequest {
  Selection select;
  Vec3d force;          ///< [N]
  Vec3d force_density;  ///< [N/m^3]
  double ramp = 0;      ///< Time of linear growth from zero [s]; 0: the force acts at once.
  std::vector<LoadCurve::Point> curve = {};  ///< Factors by time, in place of a ramp; or empty.
};

/// A force on a part of a body's surface: either `traction`, along a direction, or `pressure`,
/// against the outward normals. It keeps its size and direction while the body deforms, unless it
/// follows the surface, and changes with time by `ramp` or `curve`.
struct TractionRequest {
  Selection select;       ///< By box, ball or all: the triangles, or parts of them, that lie there.
  Vec3d traction;         ///< [Pa]
  double pressure = 0;    ///< [Pa]
  bool follower = false;  ///< True of a pressure on the deformed surface, against its normals.
  /// Set for the gas in a cavity, around which the selected surface is: γ of its pressure,
  /// pressure (V₀/V)^γ.
  std::optional<double> gas;
  Vec3d normal;       ///< If not zero, only where the outward normal is nearly along it.
  double angle = 45;  ///< Largest angle between the two [degrees].
  double ramp = 0;    ///< Time of linear growth from zero [s]; 0: the force acts at once.
  std::vector<LoadCurve::Point> curve = {};  ///< Factors by time, in place of a ramp; or empty.
};

/// A place whose values a run logs at each frame: points of a body at rest, or phyxels of it over
/// which values are averaged.
struct ProbeRequest {
  std::string name;
  std::vector<Vec3d> points;        ///< At rest [m]; of a line, from its start to its end.
  std::optional<Selection> select;  ///< Set if there are no points.
  std::string where;                ///< "scene.toml:30:1", for errors.
};

/// The source of a body's rest shape. Exactly one of `shape.name`, `mesh`, `file` and `cloud` is
/// set.
struct BodySource {
  ShapeRequest shape;
  std::filesystem::path mesh;  ///< Surface to fill with `phyxels` phyxels.
  std::filesystem::path file;  ///< body.h5 written by `phyxel sample`.
  std::string cloud;           ///< Name of a cloud that the calling program supplies.
  Index phyxels = 0;           ///< Mesh: exact count. Lattice shapes: about this many.
  std::uint64_t seed = 1;
  int relaxations = 30;
  /// Mesh: true puts phyxels on the surface, too; unset: wherever the surface allows it.
  std::optional<bool> on_surface;
  /// Mesh: unset for the same distance between phyxels everywhere. Its finer regions are those of
  /// the body (`BodyRequest::finer`), before it is placed.
  std::optional<Grading> grading;
  bool operator==(const BodySource&) const = default;
};

/// A box or a ball in which the phyxels of a graded body are nearer to each other.
struct FinerRequest {
  Selection select;
  double by = 1;  ///< The coarsest distance between neighbours over the one here.
};

/// Tolerance of closed gradients of a body that does not ask for one. Displacements are then within
/// a tenth of a per mille of those of gradients closed entirely; stresses within some percent.
inline constexpr double automatic_closure = 0.01;

/// Brittle fracture of a body: pairs of phyxels break that are stretched too far.
struct FractureRequest {
  /// Energy that a crack takes by its area, G_c [J/m²].
  double energy_release_rate = 0;
  /// Stress across a body without cracks at which pairs break [Pa]; unset: that which follows from
  /// `energy_release_rate` and the distance between phyxels.
  std::optional<double> strength;
  /// Modulus of a Weibull distribution of critical stretches; unset: all are the same.
  std::optional<double> scatter;
  std::uint64_t seed = 1;              ///< Of the scatter.
  std::vector<Selection> unbreakable;  ///< Boxes and balls whose phyxels break from no other.
  std::string where = {};              ///< "scene.toml:30:1", for errors.
};

/// A disc or a surface along which a body is cut before it moves, once the body is in place.
struct NotchRequest {
  Vec3d centre;                     ///< [m]
  Vec3d normal;                     ///< Not zero.
  double radius = 0;                ///< [m]
  std::filesystem::path mesh = {};  ///< In place of the disc: triangles, placed as the body is.
  std::string where = {};           ///< "scene.toml:30:1", for errors.
};

/// One body of a scene.
struct BodyRequest {
  std::string name;
  BodySource source;
  double scale = 1;   ///< Applied first, about the origin.
  Vec3d rotation;     ///< Axis times angle [degrees], applied second.
  Vec3d translation;  ///< [m], applied last.
  Vec3d velocity;     ///< Initial velocity [m/s].
  Vec3d spin;         ///< Initial angular velocity about the centre of mass [rad/s].
  Material material;
  NeighbourhoodRule neighbourhood;
  VolumeRule volume_rule = VolumeRule::automatic;
  /// Tolerance of the integration constraint of closed gradients (phyxel/physics/closing.hpp), as a
  /// share of the surface's areas; 0: gradients are not closed. Closed gradients need a closed
  /// surface and symmetric lists of neighbours. Unset: `automatic_closure` where these are given,
  /// the body is no regular lattice, and its volumes are not the kernel's; else 0.
  std::optional<double> closure;
  /// Inclusions; where several contain a phyxel, the last one counts. The strength of hourglass
  /// control is the body's.
  std::vector<InclusionRequest> inclusions;
  std::vector<FinerRequest> finer;
  std::vector<FixRequest> fixed;
  std::vector<SymmetryRequest> symmetries;
  std::vector<MotionRequest> motions;
  std::vector<LoadRequest> loads;
  std::vector<TractionRequest> tractions;
  std::vector<ProbeRequest> probes;
  std::optional<FractureRequest> fracture;  ///< Unset: no pair breaks.
  std::vector<NotchRequest> notches;
  std::string where;  ///< "scene.toml:7:1", for errors.
};

/// A rigid body that others cannot enter, at rest, on a given path, or free.
struct ObstacleRequest {
  std::string name;
  std::string shape;            ///< A name in `ObstacleShapes` (phyxel/physics/obstacles.hpp).
  std::filesystem::path mesh;   ///< A file with a closed surface, for the shape "mesh".
  double scale = 1;             ///< Of that surface, about its origin.
  Vec3d size;                   ///< Extents of a box [m].
  double radius = 0;            ///< Of a sphere, cylinder or capsule [m].
  double length = 0;            ///< Of a cylinder, or between the centres of a capsule's ends [m].
  std::optional<Vec3d> normal;  ///< Direction that a plane faces; unset: z, turned by `rotation`.
  bool hollow = false;          ///< True if bodies are kept inside instead of outside.
  Vec3d rotation;               ///< Axis times angle [degrees], applied first.
  Vec3d translation;            ///< [m], applied last.
  double friction = 0;          ///< Coulomb's coefficient of points at rest on it.
  std::optional<double> kinetic_friction;  ///< The same of sliding points; unset: `friction`.
  double restitution = 0;  ///< Speed of a surface point after an impact over that before.
  std::optional<ContactMethod> method;  ///< Unset: that of the scene's `ContactRequest`.
  std::optional<double> stiffness;      ///< Of penalties, likewise.
  /// How it moves, but for the selection and the axes; nothing set: it is at rest.
  MotionRequest motion;
  std::optional<double> density;  ///< Of a free rigid body [kg/m³]; unset: forces do not move it.
  Vec3d velocity;                 ///< Of the centre of mass of a free body at t = 0 [m/s].
  Vec3d spin;                     ///< Angular velocity of a free body at t = 0 [rad/s].
  std::string where;              ///< "scene.toml:30:1", for errors.
};

/// Two bodies that touch each other in a way of their own.
struct ContactPairRequest {
  std::string first, second;  ///< Names of bodies.
  /// As of `ContactRequest`; unset: as there.
  std::optional<double> friction, kinetic_friction, restitution;
  std::string where;  ///< "scene.toml:30:1", for errors.
};

/// How the bodies of a scene touch each other.
struct ContactRequest {
  double friction = 0;                     ///< Coulomb's coefficient of points that stick.
  std::optional<double> kinetic_friction;  ///< The same of sliding points; unset: `friction`.
  double restitution = 0;  ///< Speed of a surface point after an impact over that before.
  bool self = false;       ///< True if parts of one body touch each other, too.
  int sweeps = 4;          ///< How often contact is resolved in each step, if projected.
  ContactMethod method = ContactMethod::projected;
  double stiffness = default_contact_stiffness;  ///< Of penalties, over that of a layer of phyxels.
  std::vector<ContactPairRequest> pairs;
  /// Whether all bodies touch each other, not only those of `pairs`; unset: if there are no pairs.
  std::optional<bool> all;
  std::string where;  ///< "scene.toml:30:1", for errors.
};

/// Simulated time and step size.
struct TimeRequest {
  double end = 0;  ///< Simulated time [s].
  std::optional<double>
      step;             ///< Step size [s]; unset: found from the spectral radius of the stiffness.
  double safety = 0.8;  ///< Fraction of the largest stable step, 0 to 1.
};

/// Method, device and precision of the solver.
struct SolverRequest {
  Method method = Method::verlet;
  std::string device = "auto";  ///< "auto", "cpu" or "cuda".
  Precision precision = Precision::single;
  int threads = 0;  ///< 0: OpenMP's choice.
};

/// Output of a run: families of files, fields, folder and intervals.
struct OutputRequest {
  std::filesystem::path directory;  ///< Default: out/<scene file's name>.
  double frames_per_second = 25;    ///< Frames per simulated second; 0: last frame only.
  bool phyxels = true;              ///< Write the phyxel family.
  bool surface = true;              ///< Write the deformed surface family.
  /// Phyxel fields beside the positions: "displacement", "velocity", "mass", "volume", "body",
  /// "history", and the computed ones (`point_fields`).
  std::vector<std::string> fields = {"displacement", "velocity"};
  bool recovery = true;  ///< Recovers gradients on the surface for computed fields (`Recovery`).
  double checkpoint_every = 300;  ///< Wall-clock seconds between checkpoints; 0: only at the end.
  /// True if `fields` contains the field.
  bool wants(std::string_view field) const;
};

/// Pictures at the end of a run.
struct RenderRequest {
  bool pictures = false;  ///< Write PNG pictures at the end of a run.
  int count = 6;          ///< Number of frames drawn, evenly spread, first and last included.
  int width = 960, height = 720;
  Vec3d view{-1, 2, -0.6};  ///< Direction the camera looks along; a scene's turns with `up`.
  Vec3d up{0, 0, 1};  ///< Upward direction; by default against the scene's gravity, if it has any.
};

/// A complete simulation request, the input of `build_model`.
struct Scene {
  std::string title;
  std::filesystem::path file;  ///< Where it was read from; may be empty.
  std::string text;            ///< The file's text, kept in checkpoints and outputs.
  Vec3d gravity;               ///< [m/s^2], zero if the scene names none.
  TimeRequest time;
  SolverRequest solver;
  OutputRequest output;
  RenderRequest render;
  std::vector<BodyRequest> bodies;
  std::vector<ObstacleRequest> obstacles;
  std::optional<ContactRequest> contact;  ///< Unset: bodies pass through each other.
};

/// Default strength of hourglass control: 0.1, the most accurate value (docs/accuracy.md); 0 for
/// the bodies of Farias et al. 2008, which follow the paper, and for bodies whose supports vary,
/// which cannot have hourglass control.
double default_hourglass(const BodyRequest& body);

/// Default law of a body: `usual_law` (phyxel/law_table.hpp); St Venant-Kirchhoff's for the bodies
/// of Farias et al. 2008, which follow the paper.
const char* default_law(const BodyRequest& body);

/// The law of a material of a body: its own, or else that of the body.
std::string law_of(const BodyRequest& body, const Material& material);

/// Checks every value of a scene against the table of scene keys (docs/scenes.md): its range,
/// chosen so that double precision suffices, its finiteness, the laws of materials and their
/// parameters, and that each selection has exactly one member. `build_model` checks every scene,
/// read from a file or made in code.
/// @throws InputError naming the body, the key, its value and what is allowed
void validate(const Scene& scene);

/// A value of a scene by name, as text.
struct Parameter {
  std::string name;   ///< e.g. "body.material.young of body 2 (\"beam\")"
  std::string value;  ///< As TOML writes it; lists of more than 16 indices as a hash.
  bool operator==(const Parameter&) const = default;
};

/// Every value of a scene that changes what a run computes or writes, in the scene's order. Keys
/// that a resumed run may change (`free_on_resume` of lib/scene/scene_parameters.cpp) are not among
/// them, nor are those that are left at nothing. Bodies beyond the first 64 share one value, a
/// hash.
std::vector<Parameter> scene_parameters(const Scene& scene);

/// The differences between the parameters of two scenes in words: "gravity: [0, 0, -9.81] then,
/// [0, 0, 9.81] now", one line each, at most eight; empty if there are none.
std::string parameter_differences(const std::vector<Parameter>& then,
                                  const std::vector<Parameter>& now);

/// Reads and validates a scene file (TOML). Relative paths are resolved from its folder.
/// @throws InputError with file, line and column for anything missing, unknown or out of range.
Scene read_scene(const std::filesystem::path& file);

/// The same from text; `file` is used in messages and to resolve paths.
Scene parse_scene(const std::string& text, const std::filesystem::path& file);

/// The pictures that a scene's text asks for, whatever its bodies are: files they name may be gone.
/// @throws InputError likewise
RenderRequest parse_render(const std::string& text, const std::filesystem::path& file);

/// One line per key: name, type, unit, default, allowed range and meaning, as Markdown; made from
/// the same table that parses, so that the documentation cannot drift.
std::string scene_reference();

}  // namespace phyxel
