/// The CPU backend: two passes over the neighbour lists, W phyxels at a time.
///
/// Memory moved per phyxel and step, float, k neighbours, one body with symmetric lists:
///   pass 1 reads  one 32-byte record (X, 1/h², u) per neighbour, mostly from cache, 4 k of
///   indices,
///          24 of A⁻¹, 4 of v, and writes 36 of a 64-byte record (Q beside X, 1/h²);
///   pass 2 reads  one 64-byte record per neighbour, mostly from cache, 4 k of indices, 12 of b,
///          4 of 1/m, reads and writes 24 of (u, v) and writes 12 of the first record.
#include <fmt/format.h>
#include <omp.h>

#include <cmath>
#include <optional>

#include "phyxel/backend.hpp"
#include "phyxel/custom_law.hpp"
#include "phyxel/error.hpp"
#include "phyxel/law_table.hpp"
#include "phyxel/physics/closing.hpp"
#include "phyxel/physics/force.hpp"
#include "phyxel/physics/hourglass.hpp"
#include "phyxel/physics/strain.hpp"
#include "phyxel/physics/verlet.hpp"
#include "phyxel/physics/weight.hpp"
#include "solver/cpu_layout.hpp"
#include "solver/cpu_surfels.hpp"
#include "solver/first_error.hpp"
#include "solver/hourglass.hpp"
#include "solver/pack.hpp"
#include "timeline.hpp"

namespace phyxel {
namespace {

/// What the first pass reads of a phyxel, and where each value stands in its record.
struct PointRecord {
  static constexpr int size = 8;
  enum { position = 0, inverse_h_squared = 3, displacement = 4 };
};
/// What the second pass reads of a phyxel.
struct StressRecord {
  static constexpr int size = 16;
  enum { pair_stress = 0, closing_stress = 9, position = 12, inverse_h_squared = 15 };
};

/// A caller's law for the phyxels of a pack, one by one. What it throws is kept until the threads
/// have met.
template <class P>
struct LaneByLane {
  const CustomLaw& law;
  FirstError& error;

  Mat3<P> first_piola_stress(const Mat3<P>& grad_u) const {
    constexpr int width = sizeof(P) / sizeof(grad_u(0, 0)[0]);
    Mat3<P> stress;
    for (int l = 0; l < width; ++l) {
      Mat3d of_lane;
      for (int e = 0; e < 9; ++e) of_lane(e / 3, e % 3) = grad_u(e / 3, e % 3)[l];
      of_lane = error.caught([&] { return law.first_piola_stress(of_lane); });
      for (int e = 0; e < 9; ++e) {
        auto& lanes = stress(e / 3, e % 3).lanes;
        lanes[l] = static_cast<std::decay_t<decltype(lanes[0])>>(of_lane(e / 3, e % 3));
      }
    }
    return stress;
  }
};

template <class Real, class StateReal>
class CpuBackend final : public Backend {
  static constexpr int W = static_cast<int>(simd_bytes / sizeof(Real));
  using P = Pack<Real, W>;
  using S = Pack<StateReal, W>;

 public:
  CpuBackend(const Model& model, int threads)
      : model_(model.with_lists()),
        threads_(threads > 0 ? threads : omp_get_max_threads()),
        boundary_(boundary_phyxels(model)),
        layout_(model, boundary_, W),
        boundary_runs_(find_runs(&Layout::boundary)),
        interior_runs_(find_runs(&Layout::interior)),
        lists_(model.neighbourhood.neighbours, layout_) {
    if (!model.neighbourhood.symmetric)
      inverse_ = PackedLists(model.neighbourhood.inverse(), layout_);
    const auto slots = static_cast<std::size_t>(layout_.slots());
    points_.assign(slots * PointRecord::size, Real(0));
    stresses_.assign(slots * StressRecord::size, Real(0));
    inverse_moment_.assign(slots * 6, Real(0));
    moment_offset_.assign(slots * 3, Real(0));
    volume_.assign(slots, Real(0));
    inverse_mass_.assign(slots, Real(0));
    displacement_.assign(slots * 3, StateReal(0));
    velocity_.assign(slots * 3, StateReal(0));
    if (!model.loads.empty()) load_.assign(slots * 3, Real(0));
    if (has_hourglass_control(model)) pull_.assign(slots * 3, Real(0));
    if (!model.closing.empty()) closing_.assign(slots * 3, Real(0));
    for (std::size_t p = 0; p < model.parts.size(); ++p) pack_part(p);
    model_loads(0);
    cut_interior();
  }

  std::string name() const override {
    const char* precision = sizeof(Real) == 8        ? "double"
                            : sizeof(StateReal) == 8 ? "mixed"
                                                     : "float";
    return fmt::format("cpu, {}, {} thread{}, {} lanes", precision, threads(),
                       threads() == 1 ? "" : "s", W);
  }
  int threads() const override {
    int used = 1;  // small bodies leave threads alone
    for (const auto& runs : {boundary_runs_, interior_runs_}) {
      for (const Run& run : runs) used = std::max(used, threads_for(run.range));
    }
    return used;
  }
  Index size() const override { return model_.size(); }

  void upload(const State& state) override {
    check_sizes(state, model_.size());
    for (Index i = 0; i < model_.size(); ++i)
      set_state(i, state.displacement[i], state.velocity[i]);
  }

  void download(State& state) const override {
    state.displacement.resize(static_cast<std::size_t>(model_.size()));
    state.velocity.resize(static_cast<std::size_t>(model_.size()));
    for (Index i = 0; i < model_.size(); ++i) {
      state.displacement[i] = get3(displacement_, layout_.slot(i));
      state.velocity[i] = get3(velocity_, layout_.slot(i));
    }
  }

  std::optional<StateView> view() const override {
    return StateView{displacement_.data(),
                     velocity_.data(),
                     sizeof(StateReal) == sizeof(float),
                     W,
                     layout_.packs(),
                     {layout_.slot_of_phyxel(), static_cast<std::size_t>(model_.size())}};
  }

  void set_external_forces(std::span<const Vec3d> force) override {
    if (!force.empty() && force.size() != static_cast<std::size_t>(model_.size())) {
      throw InputError(fmt::format("{} external forces for {} phyxels: allowed are {} or none",
                                   force.size(), model_.size(), model_.size()));
    }
    external_force_.assign(force.begin(), force.end());
    external_.resize(force.empty() ? 0 : static_cast<std::size_t>(layout_.slots()) * 3);
#pragma omp parallel for schedule(static) num_threads(threads())
    for (Index i = 0; i < static_cast<Index>(force.size()); ++i) {
      set3(external_, layout_.slot(i), force[i]);
    }
  }
  std::span<const Vec3d> external_forces() const override { return external_force_; }

  void stress() override {
    const Phase phase("stresses");
    pass(stress_records(), [&](const std::vector<Run>& runs) { find_stresses(runs); });
  }

  void advance(double time, double dt) override {
    const Phase phase("forces, motion");
    if (!load_.empty()) model_loads(time);
    pass(displacement_records(), [&](const std::vector<Run>& runs) {
      for (const Run& run : runs) advance_run(run, dt);
      if (&runs == &boundary_runs_) follow_motions(time, dt, true);  // before they are sent
    });
    follow_motions(time, dt, false);
  }

  void internal_forces(std::vector<Vec3d>& force) override {
    stress();
    force.resize(static_cast<std::size_t>(model_.size()));
    std::vector<Vec3d> by_slot(static_cast<std::size_t>(layout_.slots()));
#pragma omp parallel for schedule(static) num_threads(threads_)
    for (Index p = 0; p < layout_.packs(); ++p) {
      Vec3<P> f = closing_.empty() ? force_of<false>(p) : force_of<true>(p);
      if (!pull_.empty()) f += vec3_of<P>(pull_, p);
      for (int l = 0; l < W; ++l) by_slot[p * W + l] = {f.x[l], f.y[l], f.z[l]};
    }
    for (Index i = 0; i < model_.size(); ++i) force[i] = by_slot[layout_.slot(i)];
  }

  void displacement_gradients(std::vector<Mat3d>& gradient) override {
    std::vector<Mat3d> by_slot(static_cast<std::size_t>(layout_.slots()));
#pragma omp parallel for schedule(static) num_threads(threads_)
    for (Index p = 0; p < layout_.packs(); ++p) {
      const Mat3<P> g = whole_gradient_of(p);
      for (int l = 0; l < W; ++l) {
        for (int e = 0; e < 9; ++e) by_slot[p * W + l](e / 3, e % 3) = g(e / 3, e % 3)[l];
      }
    }
    gradient.resize(static_cast<std::size_t>(model_.size()));
    for (Index i = 0; i < model_.size(); ++i) gradient[i] = by_slot[layout_.slot(i)];
  }

  void fit_residuals(std::vector<double>& residual) override {
    std::vector<double> by_slot(static_cast<std::size_t>(layout_.slots()));
#pragma omp parallel for schedule(static) num_threads(threads_)
    for (Index p = 0; p < layout_.packs(); ++p) {
      const Mat3<P> grad_u = displacement_gradient_of<false>(p, nullptr);
      P sum(Real(0));
      visit_neighbours(
          p, [&](Vec3<P> x_ij, Vec3<P> u_ij, P w) { add_residual(sum, u_ij, grad_u, x_ij, w); });
      for (int l = 0; l < W; ++l) by_slot[p * W + l] = sum[l];
    }
    residual.resize(static_cast<std::size_t>(model_.size()));
    for (Index i = 0; i < model_.size(); ++i) residual[i] = by_slot[layout_.slot(i)];
  }

  void update_surfels() override { advect_surfels(moved_surfels_); }
  void advect_surfels(SurfelState& out) override {
    if (!surfels_) surfels_.emplace(model_, layout_);
    AlignedVector<StateReal> records(static_cast<std::size_t>(layout_.slots()) *
                                     CarrierRecord::size);
#pragma omp parallel for schedule(static) num_threads(threads_)
    for (Index p = 0; p < layout_.packs(); ++p) {
      const Mat3<P> grad_u = whole_gradient_of(p);
      const Vec3<P> x = point_of(p, PointRecord::position);
      const Vec3<S> u = vec3_of<S>(displacement_, p);
      for (int l = 0; l < W; ++l) {
        StateReal* record = &records[static_cast<std::size_t>(p * W + l) * CarrierRecord::size];
        for (int e = 0; e < 9; ++e) {
          record[CarrierRecord::gradient + e] = grad_u(e / 3, e % 3)[l];
        }
        const Real at[] = {x.x[l], x.y[l], x.z[l]};
        const StateReal moved[] = {u.x[l], u.y[l], u.z[l]};
        for (int c = 0; c < 3; ++c) {
          record[CarrierRecord::position + c] = at[c];
          record[CarrierRecord::displacement + c] = moved[c];
        }
      }
    }
    if (model_.share) {
      refresh(records_of(records, CarrierRecord::size, 0, CarrierRecord::size));
    }
    surfels_->advect(records, threads_, out);
  }

  std::optional<Exchanges> exchanges() const override {
    if (!model_.share) return std::nullopt;
    return Exchanges{"MPI", model_.share->transport->traffic()};
  }

  std::vector<ArrayBytes> memory() const override {
    std::vector<ArrayBytes> list{
        {"point records", points_.size() * sizeof(Real)},
        {"stress records", stresses_.size() * sizeof(Real)},
        {"inverse moments", inverse_moment_.size() * sizeof(Real)},
        {"moment offsets", moment_offset_.size() * sizeof(Real)},
        {"volumes and masses", (volume_.size() + inverse_mass_.size()) * sizeof(Real)},
        {"displacements and velocities",
         (displacement_.size() + velocity_.size()) * sizeof(StateReal)},
        {"neighbour lists", lists_.bytes()}};
    if (!inverse_.start.empty()) list.push_back({"inverse neighbour lists", inverse_.bytes()});
    if (!load_.empty()) list.push_back({"loads", load_.size() * sizeof(Real)});
    if (!external_.empty()) {
      list.push_back({"external forces",
                      external_.size() * sizeof(Real) + external_force_.size() * sizeof(Vec3d)});
    }
    if (!pull_.empty()) list.push_back({"hourglass control", pull_.size() * sizeof(Real)});
    if (!closing_.empty()) list.push_back({"closing vectors", closing_.size() * sizeof(Real)});
    if (surfels_) list.push_back({"surfels", surfels_->bytes()});
    return list;
  }

  std::size_t step_traffic() const override {
    const auto slots = static_cast<std::size_t>(layout_.slots());
    const std::size_t pass_1 = lists_.bytes() +
                               slots * (PointRecord::size + 6 + 1 + 9) * sizeof(Real) +
                               3 * closing_.size() * sizeof(Real);  // b and ĉ read, t written
    const std::size_t pass_2 =
        (inverse_.start.empty() ? lists_ : inverse_).bytes() +
        slots * ((StressRecord::size + 3 + 1 + 3) * sizeof(Real) + 4 * 3 * sizeof(StateReal)) +
        (load_.size() + external_.size() + 2 * pull_.size()) * sizeof(Real);
    return pass_1 + pass_2;
  }

 private:
  // --- the two neighbour loops ------------------------------------------------------------------

  /// Calls visit(x_ij, u_ij, w_ij) for the neighbours of the phyxels of pack p.
  template <class Visit>
  PHYXEL_HD void visit_neighbours(Index p, Visit&& visit) const {
    const Vec3<P> x_i = point_of(p, PointRecord::position),
                  u_i = point_of(p, PointRecord::displacement);
    const P inverse_h_squared = own_point_value(p, PointRecord::inverse_h_squared);
    const Index* end = lists_.indices.data() + lists_.start[p + 1];
    for (const Index* j = lists_.indices.data() + lists_.start[p]; j != end; j += W) {
      P point[PointRecord::size];
      load_records<PointRecord::size>(points_.data(), j, point);
      const Vec3<P> x_ij = vec3_at(point, PointRecord::position) - x_i;
      const Vec3<P> u_ij = vec3_at(point, PointRecord::displacement) - u_i;
      visit(x_ij, u_ij, weight_shape(dot(x_ij, x_ij), inverse_h_squared));
    }
  }

  /// Pass 1: the linear fit of the phyxels of pack p and, where asked, how their neighbours pull.
  template <bool Pulled>
  PHYXEL_HD Mat3<P> displacement_gradient_of(Index p, [[maybe_unused]] Vec3<P>* pull) const {
    Mat3<P> sum;
    visit_neighbours(p, [&](Vec3<P> x_ij, Vec3<P> u_ij, P w) {
      add_gradient_term(sum, u_ij, w * x_ij);
      if constexpr (Pulled) add_pull(*pull, u_ij, w);
    });
    return displacement_gradient(sum, inverse_moment_of(p));
  }

  /// ∇u of the phyxels of pack p, as their stresses see it.
  Mat3<P> whole_gradient_of(Index p) const {
    if (closing_.empty()) return displacement_gradient_of<false>(p, nullptr);
    Vec3<P> pull = no_pull();
    const Mat3<P> fit = displacement_gradient_of<true>(p, &pull);
    return closed_gradient(fit, pull, vec3_of<P>(moment_offset_, p), vec3_of<P>(closing_, p));
  }
  PHYXEL_HD static Vec3<P> no_pull() { return {P(Real(0)), P(Real(0)), P(Real(0))}; }

  /// Pass 2: internal forces on the phyxels of pack p, but for how they are pulled.
  template <bool Closed>
  PHYXEL_HD Vec3<P> force_of(Index p) const {
    const PackedLists& lists = inverse_.start.empty() ? lists_ : inverse_;
    Index own[W];
    for (int l = 0; l < W; ++l) own[l] = p * W + l;
    P record[StressRecord::size];
    load_records<StressRecord::size>(stresses_.data(), own, record);
    const Vec3<P> x_i = vec3_at(record, StressRecord::position);
    Vec3<P> force = own_force(mat3_at(record), vec3_of<P>(moment_offset_, p));
    const Vec3<P> t_i = vec3_at(record, StressRecord::closing_stress);
    const Index* end = lists.indices.data() + lists.start[p + 1];
    for (const Index* j = lists.indices.data() + lists.start[p]; j != end; j += W) {
      load_records<StressRecord::size>(stresses_.data(), j, record);
      const Vec3<P> x_ij = vec3_at(record, StressRecord::position) - x_i;
      const P w_ji = weight_shape(dot(x_ij, x_ij), record[StressRecord::inverse_h_squared]);
      add_neighbour_force(force, mat3_at(record), x_ij, w_ji);
      if constexpr (Closed) {
        add_closing_force(force, t_i, vec3_at(record, StressRecord::closing_stress), w_ji);
      }
    }
    return force;
  }

  /// Neighbouring bodies of one material: one loop over all of them.
  struct Run {
    Material material;
    ChosenLaw law;     ///< Unused with a custom law.
    double hourglass;  ///< κ [N/m]
    PackRange range;
  };

  std::vector<Run> find_runs(const PackRange& (Layout::*range_of)(std::size_t) const) const {
    std::vector<Run> runs;
    for (std::size_t part = 0; part < model_.parts.size(); ++part) {
      const Material& material = model_.parts[part].material;
      const double hourglass = hourglass_stiffness(model_, model_.parts[part]);
      const PackRange range = (layout_.*range_of)(part);
      if (range.begin == range.end) continue;
      if (!runs.empty() && runs.back().material == material && runs.back().hourglass == hourglass) {
        runs.back().range.end = range.end;
      } else {
        const ChosenLaw law = material.custom_law ? ChosenLaw{} : chosen_law(material);
        runs.push_back({material, law, hourglass, range});
      }
    }
    return runs;
  }

  /// Threads worth waking: 400 phyxels take a thread some 10 microseconds, a barrier about one; but
  /// where other programs want the cores, a barrier waits for a thread that is not running.
  int threads_for(PackRange range) const {
    return std::clamp((range.end - range.begin) * W / 400, 1, threads_);
  }

  /// Interior packs in pieces, between which messages under way may advance; each is worth waking
  /// all threads for.
  void cut_interior() {
    constexpr Index most_pieces = 8, least_phyxels = 2000;
    Index packs = 0;
    for (const Run& run : interior_runs_) packs += run.range.end - run.range.begin;
    const Index each = std::max(packs / most_pieces + 1, least_phyxels * threads_ / W);
    Index room = 0;  // of the last piece
    for (Run run : interior_runs_) {
      const Index end = run.range.end;
      while (run.range.begin < end) {
        if (room == 0) {
          interior_pieces_.emplace_back();
          room = each;
        }
        run.range.end = std::min(end, run.range.begin + room);
        room -= run.range.end - run.range.begin;
        interior_pieces_.back().push_back(run);
        run.range.begin = run.range.end;
      }
    }
  }

  /// Does the work of a pass: first on the boundary, whose values other ranks wait for, then on the
  /// interior, while they travel. Ghosts have their owners' values when it returns.
  /// @param work(runs) finds the values
  template <class Work>
  void pass(const Records& values, Work&& work) {
    if (!model_.share) return work(interior_runs_);
    HaloTransport& halo = *model_.share->transport;
    work(boundary_runs_);
    halo.start(values);
    for (const std::vector<Run>& piece : interior_pieces_) {
      work(piece);
      halo.progress();
    }
    halo.finish();
  }

  /// Sets the phyxels that motions prescribe, those of the boundary or all others.
  void follow_motions(double time, double dt, bool of_boundary) {
    for (const Motion& motion : model_.motions) {
      const Path before = motion.path_at(time), after = motion.path_at(time + dt);
      for (const Index i : motion.phyxels) {
        if ((!boundary_.empty() && boundary_[i]) != of_boundary) continue;
        const Index slot = layout_.slot(i);
        const Vec3d x = model_.position[i], u = after.at(x);
        set_state(i, motion.along_axes(u, get3(displacement_, slot)),
                  motion.along_axes((u - before.at(x)) / dt, get3(velocity_, slot)));
      }
    }
  }

  /// Takes a step of the phyxels of a run, by the code for the terms that the scene has.
  void advance_run(const Run& run, double dt) {
    const bool damped = run.material.damping > 0;
    if (!closing_.empty()) {
      damped ? advance_run<true, true, true>(run, dt) : advance_run<false, true, true>(run, dt);
    } else if (load_.empty() && pull_.empty() && external_.empty()) {
      damped ? advance_run<true, false>(run, dt) : advance_run<false, false>(run, dt);
    } else {
      damped ? advance_run<true, true>(run, dt) : advance_run<false, true>(run, dt);
    }
  }

  /// Force, gravity and the Verlet step; with `More` what the scene has of loads and pulls.
  template <bool Damped, bool More, bool Closed = false>
  void advance_run(const Run& run, double dt) {
    const DampedFlow flow = damped_flow(run.material.damping, dt);
    const S keep(flow.keep), gain(flow.gain), step(dt);
    const Vec3<S> gravity{S(model_.gravity.x), S(model_.gravity.y), S(model_.gravity.z)};
    const PackRange range = run.range;
#pragma omp parallel for schedule(static) num_threads(threads_for(range))
    for (Index p = range.begin; p < range.end; ++p) {
      Vec3<P> force = force_of<Closed>(p);
      if constexpr (More) {
        if (!pull_.empty()) force += vec3_of<P>(pull_, p);
        if (!load_.empty()) force += vec3_of<P>(load_, p);
        if (!external_.empty()) force += vec3_of<P>(external_, p);
      }
      const Vec3<P> f_over_m = load<P>(&inverse_mass_[p * W]) * force;
      const Vec3<S> acceleration =
          Vec3<S>{convert<StateReal>(f_over_m.x), convert<StateReal>(f_over_m.y),
                  convert<StateReal>(f_over_m.z)} +
          gravity;
      Vec3<S> velocity = vec3_of<S>(velocity_, p);
      if constexpr (Damped) {
        velocity = verlet_velocity_damped(velocity, acceleration, keep, gain);
      } else {
        velocity = verlet_velocity(velocity, acceleration, step);
      }
      const Vec3<S> displacement = vec3_of<S>(displacement_, p) + step * velocity;
      store3(velocity_, p, velocity);
      store3(displacement_, p, displacement);
      const Vec3<P> u{convert<Real>(displacement.x), convert<Real>(displacement.y),
                      convert<Real>(displacement.z)};
      for (int l = 0; l < W; ++l) {
        Real* record = point_record(p * W + l) + PointRecord::displacement;
        record[0] = u.x[l];
        record[1] = u.y[l];
        record[2] = u.z[l];
      }
    }
  }

  void find_stresses(const std::vector<Run>& runs) {
    for_each_law(runs, [&](const auto& law, const Run& run) {
      if (!closing_.empty()) {
        find_stresses<true, true>(law, run);  // costs what the second alone does
      } else {
        run.hourglass > 0 ? find_stresses<true, false>(law, run)
                          : find_stresses<false, false>(law, run);
      }
    });
  }
  template <bool Controlled, bool Closed, class Law>
  void find_stresses(const Law& law, const Run& run) {
    const PackRange range = run.range;
    const P kappa(static_cast<Real>(run.hourglass));
#pragma omp parallel for schedule(static) num_threads(threads_for(range))
    for (Index p = range.begin; p < range.end; ++p) {
      Vec3<P> pull = no_pull();
      const Mat3<P> fit = displacement_gradient_of < Controlled || Closed > (p, &pull);
      const P volume = load<P>(&volume_[p * W]);
      Mat3<P> q;
      if constexpr (Closed) {
        const Vec3<P> b = vec3_of<P>(moment_offset_, p), closing = vec3_of<P>(closing_, p);
        const Mat3<P> stress = law.first_piola_stress(closed_gradient(fit, pull, b, closing));
        const Vec3<P> t = closing_stress(volume, stress, closing);
        q = closed_pair_stress(pair_stress(volume, stress, inverse_moment_of(p)), t, b,
                               inverse_moment_of(p));
        store_closing_stress(p, t);
      } else {
        q = pair_stress(volume, law.first_piola_stress(fit), inverse_moment_of(p));
      }
      if constexpr (Controlled) {
        q = with_hourglass(q, kappa, fit);
        if (!pull_.empty()) store3(pull_, p, pull_force(kappa, pull));
      }
      store_pair_stress(p, q);
    }
  }

  /// Calls apply(law, run) for each run of bodies, with the law its scene asks for: the one place
  /// where terms chosen at run time become code chosen at compile time.
  template <class Apply>
  static void for_each_law(const std::vector<Run>& runs, Apply&& apply) {
    for (const Run& run : runs) {
      const Material& m = run.material;
      const VolumeConservation<P> volume{P(m.volume_stiffness)};
      const auto apply_to = [&](const auto& law) {
        using Law = std::decay_t<decltype(law)>;
        m.volume_stiffness > 0 ? apply(SumOf<Law, VolumeConservation<P>>{law, volume}, run)
                               : apply(law, run);
      };
      if (!m.custom_law) {
        Laws::with<P>(run.law.index, run.law.constants.data(), apply_to);
        continue;
      }
      FirstError error;
      apply_to(LaneByLane<P>{*m.custom_law, error});
      error.rethrow();
    }
  }

  // --- arrays: [pack][component][lane]
  // ------------------------------------------------------------

  template <class Q, class T>
  PHYXEL_HD static Vec3<Q> vec3_of(const AlignedVector<T>& array, Index p) {
    const T* at = &array[static_cast<std::size_t>(p) * 3 * W];
    return {phyxel::load<Q>(at), phyxel::load<Q>(at + W), phyxel::load<Q>(at + 2 * W)};
  }
  template <class Q, class T>
  PHYXEL_HD static void store3(AlignedVector<T>& array, Index p, const Vec3<Q>& v) {
    T* at = &array[static_cast<std::size_t>(p) * 3 * W];
    phyxel::store(at, v.x);
    phyxel::store(at + W, v.y);
    phyxel::store(at + 2 * W, v.z);
  }
  template <class T>
  static T& component(AlignedVector<T>& array, Index slot, int c, int count) {
    return array[(static_cast<std::size_t>(slot / W) * count + c) * W + slot % W];
  }
  template <class T>
  static Vec3d get3(const AlignedVector<T>& array, Index slot) {
    const T* at = &array[static_cast<std::size_t>(slot / W) * 3 * W + slot % W];
    return {at[0], at[W], at[2 * W]};
  }
  template <class T>
  static void set3(AlignedVector<T>& array, Index slot, Vec3d v) {
    component(array, slot, 0, 3) = static_cast<T>(v.x);
    component(array, slot, 1, 3) = static_cast<T>(v.y);
    component(array, slot, 2, 3) = static_cast<T>(v.z);
  }
  PHYXEL_HD Sym3<P> inverse_moment_of(Index p) const {
    const Real* at = &inverse_moment_[static_cast<std::size_t>(p) * 6 * W];
    return {phyxel::load<P>(at),         phyxel::load<P>(at + W),     phyxel::load<P>(at + 2 * W),
            phyxel::load<P>(at + 3 * W), phyxel::load<P>(at + 4 * W), phyxel::load<P>(at + 5 * W)};
  }

  // --- records
  // --------------------------------------------------------------------------------------

  // An offset in records outgrows 32 bits long before a slot does.
  PHYXEL_HD Real* point_record(Index slot) {
    return points_.data() + std::ptrdiff_t{slot} * PointRecord::size;
  }
  PHYXEL_HD const Real* point_record(Index slot) const {
    return points_.data() + std::ptrdiff_t{slot} * PointRecord::size;
  }
  PHYXEL_HD Real* stress_record(Index slot) {
    return stresses_.data() + std::ptrdiff_t{slot} * StressRecord::size;
  }
  /// What ghosts take from their owners.
  Records displacement_records() {
    return records_of(points_, PointRecord::size, PointRecord::displacement, 3);
  }
  Records stress_records() {
    return records_of(stresses_, StressRecord::size, StressRecord::pair_stress, 9);
  }
  template <class T>
  Records records_of(AlignedVector<T>& array, int size, int first, int count) {
    T* const begin = array.empty() ? nullptr : array.data() + first;  // a rank may have nothing
    return {reinterpret_cast<std::byte*>(begin), sizeof(T) * size, sizeof(T) * count,
            layout_.slot_of_phyxel()};
  }
  void refresh(const Records& records) const {
    model_.share->transport->start(records);
    model_.share->transport->finish();
  }
  PHYXEL_HD static Vec3<P> vec3_at(const P* record, int first) {
    return {record[first], record[first + 1], record[first + 2]};
  }
  PHYXEL_HD static Mat3<P> mat3_at(const P* record) {
    Mat3<P> m;
    for (int e = 0; e < 9; ++e) m(e / 3, e % 3) = record[StressRecord::pair_stress + e];
    return m;
  }
  PHYXEL_HD P own_point_value(Index p, int which) const {
    P value;
    for (int l = 0; l < W; ++l) value.lanes[l] = point_record(p * W + l)[which];
    return value;
  }
  PHYXEL_HD Vec3<P> point_of(Index p, int first) const {
    return {own_point_value(p, first), own_point_value(p, first + 1),
            own_point_value(p, first + 2)};
  }
  PHYXEL_HD void store_pair_stress(Index p, const Mat3<P>& q) {
    for (int l = 0; l < W; ++l) {
      Real* record = stress_record(p * W + l) + StressRecord::pair_stress;
      for (int e = 0; e < 9; ++e) record[e] = q(e / 3, e % 3)[l];
    }
  }

  PHYXEL_HD void store_closing_stress(Index p, const Vec3<P>& t) {
    for (int l = 0; l < W; ++l) {
      Real* record = stress_record(p * W + l) + StressRecord::closing_stress;
      record[0] = t.x[l];
      record[1] = t.y[l];
      record[2] = t.z[l];
    }
  }

  // --- set-up and lists
  // -------------------------------------------------------------------------------

  /// Packs what does not change of one body. Positions are taken from the body's first phyxel, so
  /// that a body far from the origin keeps its digits in float.
  void pack_part(std::size_t p) {
    const Part& part = model_.parts[p];
    for (Index i = part.begin; i < part.end; ++i) {
      const Index slot = layout_.slot(i);
      const Vec3d x = model_.position[i] - part.origin;
      const double h = model_.neighbourhood.support[i];
      Real *point = point_record(slot), *stress = stress_record(slot);
      set_values(point + PointRecord::position, x);
      set_values(stress + StressRecord::position, x);
      point[PointRecord::inverse_h_squared] = stress[StressRecord::inverse_h_squared] =
          h > 0 ? static_cast<Real>(1 / (h * h)) : Real(0);
      const Sym3d& a = model_.inverse_moment[i];
      const double entries[] = {a.xx, a.xy, a.xz, a.yy, a.yz, a.zz};
      for (int e = 0; e < 6; ++e) {
        component(inverse_moment_, slot, e, 6) = static_cast<Real>(entries[e]);
      }
      set3(moment_offset_, slot, model_.moment_offset[i]);
      if (!closing_.empty()) set3(closing_, slot, model_.closing[i]);
      volume_[slot] = static_cast<Real>(model_.volume[i]);
      inverse_mass_[slot] = static_cast<Real>(1 / model_.mass[i]);
    }
  }
  static void set_values(Real* at, Vec3d v) {
    at[0] = static_cast<Real>(v.x);
    at[1] = static_cast<Real>(v.y);
    at[2] = static_cast<Real>(v.z);
  }

  void set_state(Index i, Vec3d u, Vec3d v) {
    const Index slot = layout_.slot(i);
    set3(displacement_, slot, u);
    set3(velocity_, slot, v);
    set_values(point_record(slot) + PointRecord::displacement, u);
  }

  /// Sums the loads at `time`; again only while one of them still grows.
  void model_loads(double time) {
    if (load_.empty() || time < 0) return;
    double scales = 0;
    for (const Load& load : model_.loads) scales += load.scale_at(time);
    if (scales == load_scales_) return;
    load_scales_ = scales;
    std::fill(load_.begin(), load_.end(), Real(0));
    for (const Load& load : model_.loads) {
      for (std::size_t k = 0; k < load.phyxels.size(); ++k) {
        const Index slot = layout_.slot(load.phyxels[k]);
        set3(load_, slot, get3(load_, slot) + load.scale_at(time) * load.force[k]);
      }
    }
  }

  const Model& model_;
  int threads_;
  std::vector<char> boundary_;  // of a share: whether each phyxel is exchanged
  Layout layout_;
  std::vector<Run> boundary_runs_, interior_runs_;
  std::vector<std::vector<Run>> interior_pieces_;
  PackedLists lists_, inverse_;            // inverse_ is empty when lists_ is its own inverse
  AlignedVector<Real> points_, stresses_;  // records, by slot
  AlignedVector<Real> inverse_moment_, moment_offset_, volume_, inverse_mass_;
  AlignedVector<StateReal> displacement_, velocity_;
  AlignedVector<Real> load_;      // empty unless the scene has loads
  AlignedVector<Real> pull_;      // of hourglass control; empty unless the scene has any
  AlignedVector<Real> closing_;   // of closed gradients; likewise
  AlignedVector<Real> external_;  // of the caller's own forces; likewise
  std::vector<Vec3d> external_force_;
  double load_scales_ = -1;
  std::optional<CpuSurfels<StateReal>> surfels_;  // once they have been asked for
  SurfelState moved_surfels_;                     // of `update_surfels`
};

}  // namespace

std::unique_ptr<Backend> make_cpu_backend(const Model& model, Precision precision, int threads) {
  switch (precision) {
    case Precision::single:
      return std::make_unique<CpuBackend<float, float>>(model, threads);
    case Precision::mixed:
      return std::make_unique<CpuBackend<float, double>>(model, threads);
    case Precision::double_:
      break;
  }
  return std::make_unique<CpuBackend<double, double>>(model, threads);
}

}  // namespace phyxel
