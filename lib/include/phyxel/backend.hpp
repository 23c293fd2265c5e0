/// The work of one device, at the granularity of one kernel.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "phyxel/model.hpp"
#include "phyxel/physics/law.hpp"
#include "phyxel/share.hpp"
#include "phyxel/state.hpp"

namespace phyxel {

/// Bytes a backend holds, by array.
struct ArrayBytes {
  std::string name;
  std::size_t bytes = 0;
};

/// How a share's values travel between ranks.
struct Exchanges {
  std::string transport;  ///< e.g. "MPI".
  Traffic traffic;        ///< Of this rank, since the start.
};

/// What broken pairs have left of each phyxel. Values of ghosts are not valid.
struct Breakage {
  std::vector<double> broken;   ///< Broken share of a phyxel's pairs, shape [n].
  std::vector<double> carried;  ///< Share of its volume that carries stress, likewise.
  std::vector<double> closed;   ///< Energy of its closed cracks [J], likewise.
};

/// The contact of one rank in a step that is tried and taken back.
struct NextContacts {
  /// Words of exact sums, as of `Backend::step_sums` without those of motions.
  std::vector<std::int64_t> sums;
  std::vector<double> depths;  ///< Now, as of `BodyContacts::depths`, shape [2, bodies].
  /// Forces of other bodies on each phyxel that a step finds only at its end [N], shape [n]; empty
  /// if bodies do not touch each other.
  std::vector<Vec3d> of_bodies;
};

/// A model, at rest or deformed, as Lanczos' iteration sees it: three vectors of three numbers a
/// phyxel, on one device, and S = M^-1/2 K M^-1/2, whose eigenvalues are the squared
/// eigenfrequencies. K and M are those of the free components: supports prescribe the others, whose
/// entries are zero in all vectors. If no component is free, all count. `current` starts as a unit
/// vector, `previous` as zero.
class Vibration {
 public:
  virtual ~Vibration() = default;
  /// next = S current - beta previous. @returns next · current [1/s²]
  virtual double apply(double beta) = 0;
  /// next -= alpha current. @returns |next|
  virtual double subtract(double alpha) = 0;
  /// previous = current, current = next / norm
  virtual void advance(double norm) = 0;
};

/// The live state of a CPU backend, without a copy and read-only: it shows the present state after
/// every step, as long as the backend lives. Phyxels are renumbered and `lanes` of them lie side by
/// side: component c of phyxel i is at [(slot[i] / lanes * 3 + c) * lanes + slot[i] % lanes]. Lanes
/// that no phyxel has hold zeros.
struct StateView {
  const void* displacements = nullptr;  ///< u(t) [m], of `float` or `double`.
  const void* velocities = nullptr;     ///< v(t - dt/2) [m/s], likewise.
  bool single = false;                  ///< Whether they are `float`.
  int lanes = 1;                        ///< Phyxels side by side.
  Index packs = 0;                      ///< Both arrays have shape [packs, 3, lanes].
  std::span<const Index> slot;          ///< Where each phyxel is, shape [n].

  /// u(t) of phyxel i [m].
  Vec3d displacement(Index i) const { return vector(displacements, i); }
  /// v(t - dt/2) of phyxel i [m/s].
  Vec3d velocity(Index i) const { return vector(velocities, i); }

 private:
  Vec3d vector(const void* array, Index i) const {
    const std::ptrdiff_t at = std::ptrdiff_t{slot[i] / lanes} * 3 * lanes + slot[i] % lanes;
    const auto of = [&](const auto* values) {
      return Vec3d{values[at], values[at + lanes], values[at + 2 * lanes]};
    };
    return single ? of(static_cast<const float*>(array)) : of(static_cast<const double*>(array));
  }
};

/// How a phyxel moves at the present time.
struct PhyxelMotion {
  Vec3d displacement;  ///< u(t) [m].
  Vec3d velocity;      ///< v(t - dt/2) [m/s].
  Mat3d gradient;      ///< ∇u of the fit of its neighbours.
};

/// Owns the live arrays of one device and the kernels over them. `upload` and `download` copy all
/// of a state in and out; on the CPU `view` shows it where it is. `step` alone changes the state;
/// all other verbs evaluate it as it is, and leave what laws remember untouched.
class Backend {
 public:
  virtual ~Backend() = default;

  /// e.g. "cpu, float, 2 threads, 16 lanes".
  virtual std::string name() const = 0;
  /// The precision of its arithmetic.
  virtual Precision precision() const = 0;
  /// Why steps are launched as `name` says, in words; empty where there is no choice.
  virtual std::string path_reason() const { return {}; }
  /// Phyxels of the model, n; of a share with its ghosts.
  virtual Index size() const = 0;
  /// Threads of the CPU that share the work; 0: it is another device's.
  virtual int threads() const = 0;
  /// Copies a state in: shapes [n, 3], in the order of the model's phyxels, and its history: none
  /// is the virgin material.
  /// @throws InputError for another number of phyxels, a value that is not finite, or a history of
  ///   other laws
  void upload(const State& state);
  /// Copies a state in without checking displacements and velocities: for states that the library's
  /// own methods have computed. The history is checked as in `upload`.
  virtual void put(const State& state) = 0;
  /// Copies the present displacements, velocities, history and broken pairs out.
  virtual void download(State& state) const = 0;
  /// The state where it is; nothing where that is no memory of the CPU.
  virtual std::optional<StateView> view() const { return std::nullopt; }

  /// Forces of the caller's own, which act in every step, beside the scene's loads, until others
  /// are set: as they are when a step begins. Their work is the caller's to count: energies leave
  /// it out, and a `StabilityWatch` knows nothing of them.
  /// @param force [N], shape [n], copied; of a share's ghosts it is not looked at. Empty: none, and
  ///   then they cost nothing.
  /// @throws InputError if there are neither n nor none, if one is not finite, or if this backend
  ///   takes none (those of the 2008 program)
  virtual void set_external_forces(std::span<const Vec3d> force);
  /// Those that act [N], shape [n] or empty.
  virtual std::span<const Vec3d> external_forces() const { return {}; }

  /// Takes `count` steps of Verlet's method of `dt` [s], the first of them from t = first * dt.
  /// Each has two passes: displacements -> gradient -> stress -> pair stress Q of each phyxel, and
  /// Q gathered over the inverse neighbourhood -> forces, gravity and loads -> Verlet -> motions.
  /// Stresses commit history. The bits of the result do not depend on how steps are divided into
  /// calls. Steps may be under way when it returns.
  /// @param move_surfels whether surfels are brought along after each step (`update_surfels`)
  virtual void step(std::int64_t first, double dt, int count = 1, bool move_surfels = false) = 0;

  /// What supports and obstacles have done to the phyxels of this rank, in all steps that this
  /// backend has taken: words of exact sums. First the work [J] of each motion, shape [motions,
  /// words], then the sums of each obstacle (`ContactTerms`). A step from t to
  /// t + dt adds its reactions times half the displacements over both steps beside t. Empty if no
  /// phyxel moves on a prescribed path, and then steps cost nothing more.
  virtual std::vector<std::int64_t> step_sums() const { return {}; }
  /// Tries the step of `dt` [s] from `time` [s], takes it back, and returns its contact; returns
  /// nothing where the host finds that itself (`next_step`). Of a share: collective.
  virtual std::optional<NextContacts> next_contacts([[maybe_unused]] double time,
                                                    [[maybe_unused]] double dt) {
    return std::nullopt;
  }
  /// The states of the free rigid bodies, as of `State::rigid`; the same on all ranks.
  virtual std::vector<RigidState> rigid_states() const { return {}; }

  /// The most steps that one call of `step` makes cheaper: a device is busy with them while the
  /// caller does something else.
  virtual int best_steps() const { return 1; }

  /// Waits for steps that are under way. @throws DeviceError
  virtual void wait() const {}

  /// Puts phyxels elsewhere for evaluations, and leaves velocities and history as they are.
  /// @param displacement [m], shape [n], of a share with its ghosts'; values are not checked
  /// @throws InputError for another number of phyxels
  virtual void put_displacements(std::span<const Vec3d> displacement);
  /// Sets the time from the history to the present displacements [s], over which evaluations take
  /// rates, for methods that find displacements by themselves.
  virtual void set_history_interval([[maybe_unused]] double interval) {}
  /// Ends a step of such a method: the history becomes that of the present displacements, the
  /// interval 0, and pairs break that are stretched too far.
  virtual void commit_history() {}
  /// Internal forces [N] at the present displacements, shape [n, 3] (runs both passes).
  /// @param use `trial`: as the next step will find them; `frozen`: the derivative of the energy
  ///   that is stored
  virtual void internal_forces(std::vector<Vec3d>& force, HistoryUse use = HistoryUse::trial) = 0;
  /// Displacement gradients at the present displacements, shape [n].
  virtual void displacement_gradients(std::vector<Mat3d>& gradient) = 0;
  /// The motions of some phyxels, shape [phyxels], of which alone a device tells the host: for
  /// pictures of large bodies. Of a share: collective.
  /// @param phyxels their numbers, in any order
  virtual std::vector<PhyxelMotion> motions_of(std::span<const Index> phyxels);
  /// Σ_j w_ij |u_j - u_i - ∇u_i x_ij|² at the present displacements [m²], shape [n]: what hourglass
  /// control holds small.
  /// @throws InputError if this backend has no such control.
  virtual void fit_residuals(std::vector<double>& residual);
  /// Energies, momenta and the rest of the present state where the device sums them itself; nothing
  /// where that is left to the host (see `diagnose`).
  virtual std::optional<Diagnostics> diagnostics([[maybe_unused]] const Instant& now) {
    return std::nullopt;
  }
  /// The stiffest phyxel of this rank at the present displacements; nothing where that is left to
  /// the host (see `find_stiffening`).
  virtual std::optional<Stiffening> stiffening() { return std::nullopt; }
  /// Passive surfel advection, equation (6): brings the surfels to the present displacements. They
  /// stay on the device, and may be under way when it returns.
  virtual void update_surfels() = 0;
  /// What broken pairs have left of each phyxel; nothing if the model's pairs cannot break and were
  /// not cut.
  virtual std::optional<Breakage> breakage() const { return std::nullopt; }
  /// Brings them to the host, too.
  virtual void advect_surfels(SurfelState& surfels) = 0;

  /// For the step limit; nothing where that is left to the host. It may use the arrays of this
  /// backend: a state is to be uploaded after.
  virtual std::unique_ptr<Vibration> vibration() { return nullptr; }
  /// A vibration about the present displacements, found by differences of forces. Its destructor
  /// restores the displacements. Nothing where that is left to the host.
  /// @param distance to the displaced states of which the forces are found [m]
  virtual std::unique_ptr<Vibration> vibration_at_present([[maybe_unused]] double distance) {
    return nullptr;
  }

  /// Of a share: how it exchanges values with the others, and what that has cost it.
  virtual std::optional<Exchanges> exchanges() const { return std::nullopt; }

  /// What it holds, array by array.
  virtual std::vector<ArrayBytes> memory() const = 0;
  /// Bytes one step must move at the least: each array once for every pass that reads or writes it.
  virtual std::size_t step_traffic() const = 0;
};

/// Checks that a state has a finite displacement and velocity for each phyxel.
/// @throws InputError with the counts, or the first value that is not finite, and what is allowed
void check_state(const State& state, Index phyxels);

/// Checks that a backend can be the one of a model: that both have as many phyxels.
/// @throws InputError with both counts
void check_fits(const Model& model, const Backend& backend);

/// Checks that there is one displacement for each phyxel.
/// @throws InputError with both counts and the one that is allowed
void check_displacements(std::span<const Vec3d> displacement, Index phyxels);

/// Checks that there is a finite external force for each phyxel that this rank owns, or none.
/// @throws InputError with the counts, or the first force that is not finite, and what is allowed
void check_external_forces(std::span<const Vec3d> force, const Model& model);

/// The CPU backend: OpenMP over SIMD packs of phyxels. The model must outlive it.
/// @param threads 0: OpenMP's choice.
std::unique_ptr<Backend> make_cpu_backend(const Model& model, Precision precision, int threads = 0);

}  // namespace phyxel
