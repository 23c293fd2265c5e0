/// The production solver on one GPU.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <string>

#include "solver/body_contacts.cuh"
#include "solver/chosen_motions.cuh"
#include "solver/cuda_backend.hpp"
#include "solver/kept_motion.cuh"
#include "solver/launch_path.cuh"
#include "solver/passes.cuh"
#include "solver/step_graph.cuh"
#include "solver/stiffening.cuh"
#include "solver/surfels.cuh"
#include "solver/vibration.cuh"
#include "timeline.hpp"

namespace phyxel::cuda {

template <class Real, class StateReal>
class CudaBackend final : public Backend {
 public:
  CudaBackend(const Model& model, int device, CudaPath path, Transport transport)
      : m_(model, device),
        halo_(m_.share() ? std::make_unique<DeviceHalo<Real, StateReal>>(m_, transport) : nullptr),
        boundary_(m_),
        contacts_(m_),
        body_contacts_(m_),
        fracture_(m_),
        passes_(std::make_unique<Passes<Real, StateReal>>(m_, halo_.get(), fracture_)),
        path_(choose_path(m_, halo_.get(), boundary_, contacts_, path)),
        has_surfels_(!model.surfels.position.empty()) {
    if (m_.share()) has_surfels_ = m_.share()->communicator->largest(has_surfels_) > 0;
  }

  std::string name() const override {
    const std::string path =
        path_.residence
            ? path_.residence->describe()
            : "tiles of " + std::to_string(tile_size) +
                  (path_.recorded ? ", graphs of " + std::to_string(steps_together) + " steps"
                                  : "");
    return m_.device().name + ", " + precision_name(precision()) + ", " + path;
  }
  Precision precision() const override {
    if (m_.mixed) return Precision::mixed;
    return sizeof(Real) == 4 ? Precision::single : Precision::double_;
  }
  std::string path_reason() const override { return path_.reason; }
  Index size() const override { return m_.size(); }
  int threads() const override { return 0; }

  void put(const State& state) override {
    leave_steps();
    fracture_.put(state);
    m_.put(state);
    fracture_.remember_displacements();
    contacts_.put_rigid(state.rigid, state.dt);
    history_interval_ = state.history.empty() ? 0 : state.history_interval;
  }
  void download(State& state) const override {
    m_.use_device();
    passes_->receive_displacements();
    m_.wait();
    m_.take(state);
    state.history_interval = m_.has_history() ? history_interval_ : 0;
    state.rigid = contacts_.rigid_states();
    const BrokenPairs broken = fracture_.broken();
    state.broken = broken.pairs();
    state.worn = broken.worn();
  }

  void set_external_forces(std::span<const Vec3d> force) override {
    check_external_forces(force, m_.model());
    m_.use_device();
    m_.wait();  // steps in progress may read the previous forces
    const bool had_loads = m_.fields().load;
    std::vector<Real> values(force.empty() ? 0 : 3 * m_.places(), Real(0));
    for (Index i = 0; i < static_cast<Index>(force.size()); ++i) {
      const auto place = static_cast<std::size_t>(m_.tiling().place[i]);
      const Vec3<Real> f = to<Real>(force[i]);
      values[place] = f.x;
      values[m_.places() + place] = f.y;
      values[2 * m_.places() + place] = f.z;
    }
    external_force_.assign(force.begin(), force.end());
    boundary_.set_external(values);
    if (had_loads == static_cast<bool>(m_.fields().load)) return;
    // The choice of kernels depends on whether there are applied forces.
    passes_ = std::make_unique<Passes<Real, StateReal>>(m_, halo_.get(), fracture_);
    for (StepGraph& graph : graphs_) graph.forget();
  }
  std::span<const Vec3d> external_forces() const override { return external_force_; }

  void step(std::int64_t first, double dt, int count, bool move_surfels) override {
    m_.use_device();
    set_step(dt);
    const SurfelAdvection<Real, StateReal>* surfels =
        move_surfels && has_surfels_ ? &surfels_of_model() : nullptr;
    while (count > 0) {
      contacts_.prepare(dt, steps_together);
      fracture_.prepare(steps_together);
      const int launched = launch_steps(static_cast<double>(first) * dt, count, surfels);
      bound_queue(launched);
      if (halo_) halo_->count_steps(launched);
      first += launched;
      count -= launched;
    }
  }
  std::vector<std::int64_t> step_sums() const override {
    m_.use_device();
    StepSums sums =
        joined(joined(boundary_.support_work(), contacts_.sums()), body_contacts_.sums());
    if (fracture_.may_break()) sums.resize(sums_before_fracture(m_.model()));
    return words_of(joined(std::move(sums), fracture_.taken()));
  }
  std::optional<NextContacts> next_contacts(double time, double dt) override {
    if (!contacts_.acts() && !body_contacts_.acts()) return std::nullopt;
    m_.use_device();
    set_step(dt);
    contacts_.prepare(dt, 1);
    passes_->receive_displacements();
    const KeptMotion<Real, StateReal> motion(m_);
    const StepSums before = joined(contacts_.sums(), body_contacts_.sums());
    auto of_obstacles = contacts_.kept();
    StepSums of_bodies = body_contacts_.sums();
    add_loads(time);
    body_contacts_.begin_look(dt);
    passes_->stress(HistoryUse::trial, history_interval_);
    contacts_.remember_velocities();
    body_contacts_.begin_step(dt, *passes_);
    NextContacts next;
    next.depths = body_contacts_.depths();
    advance_among_contacts(time, false);
    StepSums sums = joined(contacts_.sums(), body_contacts_.sums());
    add_words(sums, words_of(before), -1);
    next.sums = words_of(std::move(sums));
    next.of_bodies = body_contacts_.forces();
    motion.put_back();
    contacts_.put_back(std::move(of_obstacles));
    body_contacts_.set_sums(std::move(of_bodies));
    m_.wait();
    // Another rank's next stresses must not arrive before all ranks have read these.
    if (m_.share()) m_.share()->communicator->largest(0);
    return next;
  }
  std::vector<RigidState> rigid_states() const override { return contacts_.rigid_states(); }
  int best_steps() const override {
    return path_.residence ? path_.residence->most_steps : path_.recorded ? steps_together : 1;
  }

  void wait() const override {
    const Phase phase("waiting for the GPU");
    m_.use_device();
    m_.wait();
  }

  void put_displacements(std::span<const Vec3d> displacement) override {
    check_displacements(displacement, size());
    leave_steps();
    m_.put_displacements(displacement);
  }
  void set_history_interval(double interval) override { history_interval_ = interval; }
  void commit_history() override {
    if (fracture_.may_break()) {
      m_.use_device();
      passes_->receive_displacements();
      fracture_.prepare(1);
      fracture_.break_pairs(false);
      m_.wait();
      // Another rank's next stresses differ, and must not arrive before all ranks have read these.
      if (m_.share()) m_.share()->communicator->largest(0);
    }
    if (!m_.has_history()) return;  // the same on all ranks
    m_.use_device();
    passes_->commit(history_interval_);
    history_interval_ = 0;
  }

  std::optional<Diagnostics> diagnostics(const Instant& now) override {
    m_.use_device();
    boundary_.sum_loads(now.time);
    if (Real* const following = m_.following()) {
      passes_->receive_displacements();
      PHYXEL_CUDA(cudaMemsetAsync(following, 0, 3 * m_.places() * sizeof(Real), m_.stream()));
      boundary_.following().add(now.time, following);
    }
    const DeviceArray<Real> forces = passes_->forces(HistoryUse::trial, history_interval_),
                            gradients = m_.fields().pull ? passes_->gradients_and_residuals()
                                                         : passes_->gradients();
    const Index tiles = m_.tiles();
    const DeviceArray<TileTotals> each(static_cast<std::size_t>(tiles), "sums of " + m_.subject());
    ExactTotals none{};
    none.fastest = none.first_bad = no_phyxel;
    const DeviceArray<ExactTotals> all = sent(std::vector{none}, "sums");
    if (tiles > 0) {
      diagnose_tiles<<<tiles, diagnose_threads, 0, m_.stream()>>>(
          m_.fields(), m_.materials(now.lag), history_interval_, boundary_.moved(), forces.data(),
          gradients.data(), m_.number_at(), each.data());
      m_.launched("diagnose_tiles", static_cast<unsigned>(tiles), diagnose_threads);
      m_.launch_each("add_tiles", add_tiles, tiles, each.data(), tiles, all.data());
      m_.launch_each("find_fastest", find_fastest, tiles, each.data(), tiles, all.data());
    }
    m_.wait();
    Totals totals = totals_of(fetched(all)[0]);
    if (m_.share()) totals.add_ranks(*m_.share()->communicator);
    return totals.values();
  }

  std::optional<Stiffening> stiffening() override {
    m_.use_device();
    const Index tiles = m_.tiles();
    // The array is kept for small bodies, for which an allocation costs as much as many steps.
    DeviceArray<Real> gradients = std::move(stiffening_gradients_);
    if (gradients.size() == 0) gradients = DeviceArray<Real>(9 * m_.places(), gradients_name());
    if (stiffest_.size() == 0 && tiles > 0) {
      stiffest_ = DeviceArray<TileStiffening>(static_cast<std::size_t>(tiles), gradients_name());
    }
    passes_->put_gradients({gradients.data(), m_.places(), nullptr}, tiles);
    std::vector<TileStiffening> found(static_cast<std::size_t>(tiles));
    if (tiles > 0) {
      find_stiffest<<<tiles, diagnose_threads, 0, m_.stream()>>>(
          m_.fields(), m_.materials(m_.dt() / 2), gradients.data(), m_.number_at(),
          stiffest_.data());
      m_.launched("find_stiffest", static_cast<unsigned>(tiles), diagnose_threads);
    }
    m_.wait();
    stiffest_.download(found.data());
    if (m_.places() <= most_kept) stiffening_gradients_ = std::move(gradients);
    Stiffest all;
    for (const TileStiffening& tile : found) {
      if (tile.phyxel >= 0) all.look_at(tile.ratio, tile.stretch, tile.phyxel);
    }
    return all.values();
  }

  void internal_forces(std::vector<Vec3d>& force, HistoryUse use) override {
    m_.use_device();
    const DeviceArray<Real> forces = passes_->forces(use, history_interval_);
    wait();
    // Another rank's next stresses may differ from these, and must not arrive before all ranks have
    // read these.
    if (m_.share() && m_.has_history()) m_.share()->communicator->largest(0);
    const std::vector<Real> values = fetched(forces);
    force.resize(static_cast<std::size_t>(size()));
    for (Index i = 0; i < size(); ++i) {
      const auto place = static_cast<std::size_t>(m_.tiling().place[i]);
      force[i] = {values[place], values[m_.places() + place], values[2 * m_.places() + place]};
    }
  }

  void displacement_gradients(std::vector<Mat3d>& gradient) override {
    m_.use_device();
    const DeviceArray<Real> gradients = passes_->gradients();
    wait();
    const std::vector<Real> values = fetched(gradients);
    gradient.resize(static_cast<std::size_t>(size()));
    for (Index i = 0; i < size(); ++i) {
      for (int e = 0; e < 9; ++e) {
        gradient[i](e / 3, e % 3) =
            values[static_cast<std::size_t>(e) * m_.places() + m_.tiling().place[i]];
      }
    }
  }

  std::vector<PhyxelMotion> motions_of(std::span<const Index> phyxels) override {
    m_.use_device();
    return chosen_motions(m_, passes_->gradients(), phyxels);
  }

  void fit_residuals(std::vector<double>& residual) override {
    m_.use_device();
    const DeviceArray<Real> rows = passes_->gradients_and_residuals();
    wait();
    const std::vector<Real> values = fetched(rows);
    residual.resize(static_cast<std::size_t>(size()));
    for (Index i = 0; i < size(); ++i) {
      residual[i] = values[9 * m_.places() + static_cast<std::size_t>(m_.tiling().place[i])];
    }
  }

  std::optional<Breakage> breakage() const override {
    if (!fracture_.acts()) return std::nullopt;
    m_.use_device();
    passes_->receive_displacements();
    return fracture_.breakage();
  }

  std::unique_ptr<Vibration> vibration() override {
    m_.use_device();
    passes_->receive_displacements();
    return std::make_unique<CudaVibration<Real, StateReal>>(m_, *passes_, boundary_.moved());
  }
  std::unique_ptr<Vibration> vibration_at_present(double distance) override {
    m_.use_device();
    return std::make_unique<CudaDeformedVibration<Real, StateReal>>(m_, *passes_, boundary_.moved(),
                                                                    distance);
  }

  void update_surfels() override {
    if (!has_surfels_) return;
    m_.use_device();
    if (fracture_.acts()) {
      surfels_of_model().cut({m_.model(), joined_pairs(m_.model(), fracture_.broken().pairs())});
    }
    surfels_of_model().launch(*passes_);
  }
  void advect_surfels(SurfelState& out) override {
    update_surfels();
    wait();
    if (surfels_) {
      surfels_->download(out);
    } else {
      out = {};
    }
  }

  std::vector<ArrayBytes> memory() const override {
    std::vector<ArrayBytes> list;
    m_.add_memory(list);
    if (path_.residence) {
      list.push_back({"what stays in shared memory", path_.residence->bytes()});
    }
    if (boundary_.following().bytes() > 0) {
      list.push_back({"loads that follow the surface", boundary_.following().bytes()});
    }
    if (const std::size_t bytes = contacts_.bytes() + body_contacts_.bytes(); bytes > 0) {
      list.push_back({"contact", bytes});
    }
    if (fracture_.acts()) list.push_back({"fracture", fracture_.bytes()});
    if (boundary_.work_bytes() > 0) list.push_back({"work of supports", boundary_.work_bytes()});
    if (surfels_) list.push_back({"surfels", surfels_->bytes()});
    if (halo_) list.push_back({"exchange", halo_->bytes()});
    if (stiffest_.size() > 0) {
      list.push_back({"looks at stiffening", stiffening_gradients_.bytes() + stiffest_.bytes()});
    }
    const std::size_t rows = m_.fields().pull ? 13 : 12;
    list.push_back({"while energies are summed", rows * sizeof(Real) * m_.places()});
    return list;
  }
  std::size_t step_traffic() const override { return m_.step_traffic(); }
  std::optional<Exchanges> exchanges() const override {
    if (!halo_) return std::nullopt;
    m_.use_device();
    return Exchanges{halo_->describe(), halo_->traffic()};
  }

 private:
  /// Most tile slots for which gradients stay allocated between two looks at stiffening.
  static constexpr std::size_t most_kept = 1'000'000;
  std::string gradients_name() const { return "displacement gradients of " + m_.subject(); }
  using Advection = SurfelAdvection<Real, StateReal>;

  /// Waits until steps in progress have ended on all ranks, before displacements are replaced.
  void leave_steps() {
    m_.use_device();
    passes_->receive_displacements();
    m_.wait();
    if (m_.share()) m_.share()->communicator->largest(0);  // a barrier of the ranks
    fresh_ = true;
    body_contacts_.forget_ways();
  }
  /// Launches the next steps that can be launched together, at most `left`, from a time [s].
  /// @param surfels surfels to move after each step, or null
  /// @returns the number of steps
  int launch_steps(double time, int left, const Advection* surfels) {
    // The first step after an upload uses the uploaded positions of fixed phyxels, and then resets
    // them. The first step of another size takes strain rates over a step of the previous size.
    const bool alike = !fresh_ && (!m_.has_history() || history_interval_ == m_.dt());
    if (alike && path_.residence) {
      const int steps = std::min(left, surfels ? steps_together : path_.residence->most_steps);
      path_.residence->launch(m_.dt(), steps,
                              surfels ? surfels->trail() : Trail<Real, StateReal>{});
      if (surfels) surfels->launch_trail(steps);
      return steps;
    }
    if (alike && left >= steps_together && graph_serves(surfels)) {
      graphs_[2 * fracture_.parity() + (surfels != nullptr)].launch(m_.stream(), [&] {
        for (int s = 0; s < steps_together; ++s) launch_step(time, surfels, s > 0);
      });
      return steps_together;
    }
    launch_step(time, surfels);
    return 1;
  }
  /// True if a graph can do the next steps.
  bool graph_serves(const Advection* surfels) const {
    if (!path_.recorded || launches_are_waited_for()) return false;
    if (surfels && m_.share()) return false;  // the host combines the surfels of shares
    // A graph begins as it ends: with displacements in transit.
    return !halo_ || halo_->is_under_way(Sent::displacements);
  }
  /// Launches one step of the present size from a time [s].
  /// @param follows true right after another step of the same graph
  void launch_step(double time, const Advection* surfels, bool follows = false) {
    add_loads(time);
    body_contacts_.begin_look(m_.dt());
    passes_->stress(HistoryUse::commit, history_interval_);
    history_interval_ = m_.dt();
    if (fresh_ || boundary_.changes() || contacts_.acts() || body_contacts_.acts()) {
      if (!follows || contacts_.pushes()) contacts_.remember_velocities();
      body_contacts_.begin_step(m_.dt(), *passes_);
      advance_among_contacts(time, true);
      passes_->send_displacements();
    } else {
      passes_->advance_and_send(m_.dt());
    }
    fresh_ = false;
    if (fracture_.may_break()) {
      passes_->receive_displacements();
      fracture_.break_pairs(true);
    }
    if (surfels) surfels->launch(*passes_);
  }
  /// Sums the loads of a step from a time [s].
  void add_loads(double time) {
    boundary_.sum_loads(time);
    if (boundary_.following().empty()) return;
    passes_->receive_displacements();
    boundary_.following().add(time, m_.loads());
  }
  /// Launches the second pass of a step from a time [s], with supports, obstacles and other bodies.
  /// @param counts_work as of `Boundary::follow_paths`
  void advance_among_contacts(double time, bool counts_work) {
    body_contacts_.push_apart();
    contacts_.push_phyxels(time);
    passes_->advance(m_.dt());
    boundary_.follow_paths(time, m_.dt(), counts_work);
    if (fresh_) boundary_.put_held_at_rest();
    body_contacts_.keep_apart();
    contacts_.keep_phyxels_out(time);
  }
  /// Prepares for steps of `dt` [s].
  void set_step(double dt) {
    if (dt == m_.dt()) return;
    for (StepGraph& graph : graphs_) graph.forget();
    m_.send_constants(dt);
  }
  /// The sums of both.
  static StepSums joined(StepSums sums, const StepSums& more) {
    sums.insert(sums.end(), more.begin(), more.end());
    return sums;
  }
  /// Returns the surfels, which are uploaded on the first call.
  Advection& surfels_of_model() {
    if (!surfels_) surfels_.emplace(m_, path_.residence ? steps_together : 0);
    return *surfels_;
  }

  /// Lets the host run ahead of the GPU by some ten milliseconds of steps rather than the hundreds
  /// that the queue can hold, since a run that is stopped by a signal must wait for all of them.
  void bound_queue(int steps) {
    const int most = path_.residence ? 2 * path_.residence->most_steps : 128;
    const auto ahead = static_cast<int>(std::clamp<std::size_t>(
        50'000'000 / std::max<std::size_t>(m_.places(), 1), 1, static_cast<std::size_t>(most)));
    if ((steps_since_mark_ += steps) < ahead) return;
    steps_since_mark_ = 0;
    const Phase phase("ahead of the GPU");
    const Event& mark = marks_[batches_++ % 2];
    PHYXEL_CUDA(cudaEventSynchronize(mark.get()));  // returns at once without an earlier batch
    PHYXEL_CUDA(cudaEventRecord(mark.get(), m_.stream()));
  }

  DeviceModel<Real, StateReal> m_;
  std::unique_ptr<DeviceHalo<Real, StateReal>> halo_;  // null if the model is whole
  Boundary<Real, StateReal> boundary_;
  Contacts<Real, StateReal> contacts_;
  DeviceBodyContacts<Real, StateReal> body_contacts_;
  DeviceFracture<Real, StateReal> fracture_;
  std::unique_ptr<Passes<Real, StateReal>> passes_;
  LaunchPath<Real, StateReal> path_;
  std::vector<Vec3d> external_force_;
  std::optional<Advection> surfels_;        // created on first use
  bool has_surfels_;                        // on any rank
  bool fresh_ = true;                       // true if no step has been taken since the last upload
  double history_interval_ = 0;             // time from the histories to the displacements [s]
  StepGraph graphs_[4];                     // without and with surfels, by `DeviceFracture::parity`
  DeviceArray<Real> stiffening_gradients_;  // of small bodies, created by the first look
  DeviceArray<TileStiffening> stiffest_;    // per tile, likewise
  Event marks_[2];
  int steps_since_mark_ = 0;
  unsigned batches_ = 0;
};

}  // namespace phyxel::cuda
