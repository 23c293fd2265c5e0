/// The CPU backend: drives the passes of `CpuPasses` and reports on them.
#include <fmt/format.h>
#include <omp.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "phyxel/backend.hpp"
#include "phyxel/error.hpp"
#include "solver/body_contacts.hpp"
#include "solver/cpu_fracture.hpp"
#include "solver/cpu_surfels.hpp"
#include "solver/following_loads.hpp"
#include "solver/step_contacts.hpp"
#include "timeline.hpp"

namespace phyxel {
namespace {

template <class Real, class StateReal>
class CpuBackend final : public Backend, private CpuFracture<Real, StateReal> {
  using Passes = CpuFracture<Real, StateReal>;
  using Passes::W;
  using typename Passes::P;
  using typename Passes::Run;
  using typename Passes::S;

 public:
  CpuBackend(const Model& model, int threads)
      : Passes(model, threads > 0 ? threads : omp_get_max_threads()) {
    apply_loads(0);
  }

  std::string name() const override {
    return fmt::format("cpu, {}, {} thread{}, {} lanes", precision_name(precision()), threads(),
                       threads() == 1 ? "" : "s", W);
  }
  Precision precision() const override {
    if (sizeof(Real) == 8) return Precision::double_;
    return sizeof(StateReal) == 8 ? Precision::mixed : Precision::single;
  }
  int threads() const override {
    int used = 1;  // small bodies use fewer threads
    for (const auto& runs : {boundary_runs_, interior_runs_}) {
      for (const Run& run : runs) used = std::max(used, this->threads_for(run.range));
    }
    return used;
  }
  Index size() const override { return model_.size(); }

  void put(const State& state) override {
    this->put_broken(state);
    this->put_state(state);
    this->remember_displacements();
    contacts_.put_rigid(state.rigid, state.dt);
  }
  void download(State& state) const override {
    this->get_state(state);
    state.rigid = contacts_.rigid_states();
    state.broken = this->broken_pairs().pairs();
    state.worn = this->broken_pairs().worn();
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
    check_external_forces(force, model_);
    external_force_.assign(force.begin(), force.end());
    applied_.clear();
    if (!force.empty() || !model_.loads.empty()) {
      applied_.assign(static_cast<std::size_t>(layout_.slots()) * 3, Real(0));
    }
    const double time = load_time_.value_or(0);
    load_time_.reset();
    apply_loads(time);
  }
  std::span<const Vec3d> external_forces() const override { return external_force_; }

  void step(std::int64_t first, double dt, int count, bool move_surfels) override {
    for (int s = 0; s < count; ++s) {
      find_stresses(HistoryUse::commit);
      advance(static_cast<double>(first + s) * dt, dt);
      history_interval_ = dt;
      this->break_pairs(true);
      if (move_surfels) update_surfels();
    }
  }

  std::vector<std::int64_t> step_sums() const override {
    StepSums sums = support_work_.sums();
    const StepSums of_obstacles = contacts_.sums();
    sums.insert(sums.end(), of_obstacles.begin(), of_obstacles.end());
    sums.insert(sums.end(), body_contacts_.sums().begin(), body_contacts_.sums().end());
    if (this->may_break()) {
      sums.resize(sums_before_fracture(model_));
      sums.push_back(this->fracture_energy());
    }
    return words_of(std::move(sums));
  }

  std::vector<RigidState> rigid_states() const override { return contacts_.rigid_states(); }

  void put_displacements(std::span<const Vec3d> displacement) override {
    check_displacements(displacement, model_.size());
    for (Index i = 0; i < model_.size(); ++i) {
      this->set_state(i, displacement[i], this->get3(velocity_, layout_.slot(i)));
    }
  }
  void set_history_interval(double interval) override { history_interval_ = interval; }
  void commit_history() override {
    this->break_pairs(false);
    if (this->history_columns_.empty()) return;  // the same on all ranks
    find_stresses(HistoryUse::commit);
    history_interval_ = 0;
  }

  void internal_forces(std::vector<Vec3d>& force, HistoryUse use) override {
    find_stresses(use);
    force.resize(static_cast<std::size_t>(model_.size()));
    std::vector<Vec3d> by_slot(static_cast<std::size_t>(layout_.slots()));
#pragma omp parallel for schedule(static) num_threads(threads_)
    for (Index p = 0; p < layout_.packs(); ++p) {
      Vec3<P> f = closing_.empty() ? this->template force_of<NoPairTerms>(p)
                                   : this->template force_of<WithClosing>(p);
      if (!pull_.empty()) f += this->template vec3_of<P>(pull_, p);
      for (int l = 0; l < W; ++l) by_slot[p * W + l] = {f.x[l], f.y[l], f.z[l]};
    }
    for (Index i = 0; i < model_.size(); ++i) force[i] = by_slot[layout_.slot(i)];
  }

  void displacement_gradients(std::vector<Mat3d>& gradient) override {
    std::vector<Mat3d> by_slot(static_cast<std::size_t>(layout_.slots()));
#pragma omp parallel for schedule(static) num_threads(threads_)
    for (Index p = 0; p < layout_.packs(); ++p) {
      const Mat3<P> g = this->whole_gradient_of(p);
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
      const Mat3<P> fit = displacement_gradient(this->template sums_of<false>(p).gradient,
                                                this->inverse_moment_of(p));
      P sum(Real(0));
      this->visit_neighbours(
          p, [&](Vec3<P> x_ij, Vec3<P> u_ij, P w) { add_residual(sum, u_ij, fit, x_ij, w); });
      for (int l = 0; l < W; ++l) by_slot[p * W + l] = sum[l];
    }
    residual.resize(static_cast<std::size_t>(model_.size()));
    for (Index i = 0; i < model_.size(); ++i) residual[i] = by_slot[layout_.slot(i)];
  }

  std::optional<Breakage> breakage() const override {
    if (!model_.fracture.acts()) return std::nullopt;
    return this->present_breakage();
  }

  void update_surfels() override { advect_surfels(moved_surfels_); }
  void advect_surfels(SurfelState& out) override {
    if (!surfels_) surfels_.emplace(model_, layout_);
    if (model_.fracture.acts()) {
      surfels_->cut(layout_, {model_, joined_pairs(model_, this->broken_pairs().pairs())});
    }
    AlignedVector<StateReal> records(static_cast<std::size_t>(layout_.slots()) *
                                     CarrierRecord::size);
#pragma omp parallel for schedule(static) num_threads(threads_)
    for (Index p = 0; p < layout_.packs(); ++p) {
      const Mat3<P> grad_u = this->whole_gradient_of(p);
      const Vec3<P> x = this->point_of(p, PointRecord::position);
      const Vec3<S> u = this->template vec3_of<S>(displacement_, p);
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
      this->refresh(this->records_of(records, CarrierRecord::size, 0, CarrierRecord::size));
    }
    surfels_->advect(records, threads_, out);
  }

  std::optional<Exchanges> exchanges() const override {
    if (!model_.share) return std::nullopt;
    return Exchanges{"MPI", model_.share->transport->traffic() - traffic_before_};
  }

  std::vector<ArrayBytes> memory() const override {
    std::vector<ArrayBytes> list;
    this->add_memory(list);
    if (!external_force_.empty()) {
      list.push_back({"external forces", external_force_.size() * sizeof(Vec3d)});
    }
    if (!following_.empty()) {
      list.push_back({"loads that follow the surface", followed_force_.size() * sizeof(Vec3d)});
    }
    if (support_work_.bytes() > 0) list.push_back({"work of supports", support_work_.bytes()});
    if (const std::size_t bytes = contacts_.bytes() + body_contacts_.bytes(); bytes > 0) {
      list.push_back({"contact", bytes});
    }
    if (model_.fracture.acts()) list.push_back({"fracture", this->fracture_bytes()});
    if (surfels_) list.push_back({"surfels", surfels_->bytes()});
    return list;
  }
  std::size_t step_traffic() const override { return this->traffic_of_step(); }

 private:
  using Passes::applied_;
  using Passes::boundary_;
  using Passes::boundary_runs_;
  using Passes::closing_;
  using Passes::displacement_;
  using Passes::history_interval_;
  using Passes::interior_runs_;
  using Passes::layout_;
  using Passes::model_;
  using Passes::pull_;
  using Passes::support_work_;
  using Passes::threads_;
  using Passes::velocity_;

  /// Traffic of the set-up, which `exchanges` leaves out.
  const Traffic traffic_before_ = model_.share ? model_.share->transport->traffic() : Traffic{};

  /// Runs pass 1 for all phyxels.
  void find_stresses(HistoryUse use) {
    const Phase phase("stresses");
    this->pass(this->stress_records(),
               [&](const std::vector<Run>& runs) { Passes::find_stresses(runs, use); });
    this->push_closed();
  }
  /// Runs pass 2 for all phyxels, from `time` [s] to `time` + `dt`.
  void advance(double time, double dt) {
    const Phase phase("forces, motion");
    apply_loads(time);
    contacts_.begin_step(time, dt, [&](Index i) { return velocity_of(i); });
    if (body_contacts_.acts()) return advance_apart(time, dt);
    contacts_.push(touched(), touch());
    this->pass(this->displacement_records(), [&](const std::vector<Run>& runs) {
      for (const Run& run : runs) this->advance_run(run, dt);
      if (&runs == &boundary_runs_) end_step(time, dt, true);  // before they are sent
    });
    end_step(time, dt, false);
    contacts_.end_step();
    this->clear_padding();
  }
  /// The same where bodies touch each other: phyxels of all ranks are led to the end of the step
  /// before any of them is moved out of another body.
  void advance_apart(double time, double dt) {
    const auto state_of = [&](Index i) {
      return SurfaceState{this->get3(displacement_, layout_.slot(i)), velocity_of(i)};
    };
    body_contacts_.begin_step(dt, state_of);
    set_contact_gradients();
    const auto set_state = [&](Index i, const SurfaceState& to) {
      this->set_state(i, to.displacement, to.velocity);
    };
    body_contacts_.push_apart(state_of, set_state);
    contacts_.push(touched(), touch());
    const auto advance_all = [&](const std::vector<Run>& runs) {
      for (const Run& run : runs) this->advance_run(run, dt);
    };
    advance_all(boundary_runs_);
    advance_all(interior_runs_);
    for (const bool of_boundary : {true, false}) this->follow_motions(time, dt, of_boundary);
    body_contacts_.keep_apart(state_of, set_state);
    contacts_.keep_out([](Index) { return true; }, touched(), touch());
    contacts_.end_step();
    if (model_.share) this->refresh(this->displacement_records());
    this->clear_padding();
  }
  /// Finds the gradients of displacement of phyxels that may touch other bodies.
  void set_contact_gradients() {
    if (contact_generation_ != body_contacts_.generation()) {
      contact_generation_ = body_contacts_.generation();
      contact_packs_.clear();
      for (std::size_t p = 0; p < body_contacts_.count(); ++p) {
        contact_packs_.emplace_back(layout_.slot(body_contacts_.phyxel(p)) / W, p);
      }
      std::sort(contact_packs_.begin(), contact_packs_.end());
    }
    const int threads = std::clamp(static_cast<int>(contact_packs_.size() / 400), 1, threads_);
#pragma omp parallel num_threads(threads)
    {
      Index pack = -1;  // whose gradients are known
      Mat3<P> gradient;
#pragma omp for schedule(static)
      for (std::size_t k = 0; k < contact_packs_.size(); ++k) {
        const auto [of_point, p] = contact_packs_[k];
        if (of_point != pack) gradient = this->whole_gradient_of(pack = of_point);
        const Index lane = layout_.slot(body_contacts_.phyxel(p)) % W;
        Mat3d of_lane;
        for (int e = 0; e < 9; ++e) of_lane(e / 3, e % 3) = gradient(e / 3, e % 3)[lane];
        body_contacts_.set_gradient(p, of_lane);
      }
    }
  }
  /// Moves phyxels along prescribed paths and out of obstacles, either those of the boundary or the
  /// others.
  void end_step(double time, double dt, bool of_boundary) {
    this->follow_motions(time, dt, of_boundary);
    contacts_.keep_out([&](Index i) { return (!boundary_.empty() && boundary_[i]) == of_boundary; },
                       touched(), touch());
  }
  /// Functions that return and replace the state of a phyxel at the end of a step.
  auto touched() const {
    return [this](Index i) {
      return Touched{this->get3(displacement_, layout_.slot(i)), velocity_of(i)};
    };
  }
  auto touch() {
    return [this](Index i, const Touched& to) { this->set_state(i, to.displacement, to.velocity); };
  }
  Vec3d velocity_of(Index i) const { return this->get3(velocity_, layout_.slot(i)); }
  /// Sums the forces that are applied at `time` [s]. Repeated calls sum again only while a load
  /// still changes or follows the surface.
  void apply_loads(double time) {
    if (applied_.empty()) return;
    std::vector<double> scales = load_scales(model_, time);
    const bool same = load_time_ && scales == load_scales_;
    load_time_ = time;
    if (same && following_.empty()) return;
    load_scales_ = std::move(scales);
    std::fill(applied_.begin(), applied_.end(), Real(0));
    const auto add = [&](Index i, Vec3d force) {
      const Index slot = layout_.slot(i);
      this->set3(applied_, slot, this->get3(applied_, slot) + force);
    };
    for (Index i = 0; i < static_cast<Index>(external_force_.size()); ++i) {
      add(i, external_force_[i]);
    }
    for_each_load(model_, false, time, add);
    if (following_.empty()) return;
    following_.add(
        time, [&](Index i) { return this->point_displacement(layout_.slot(i)); }, followed_force_);
    for_each_load(model_, true, time,
                  [&](Index i, Vec3d) { add(i, std::exchange(followed_force_[i], Vec3d{})); });
  }

  StepContacts contacts_{model_, threads_};
  BodyContacts body_contacts_{model_, threads_};
  // The packs of the phyxels that may touch other bodies, and the numbers of these among them.
  std::vector<std::pair<Index, std::size_t>> contact_packs_;
  std::int64_t contact_generation_ = 0;
  std::vector<Vec3d> external_force_;
  FollowingLoads following_{model_};
  // Forces of loads that follow the surface [N], shape [n], zero but while they are summed; empty
  // without such loads.
  std::vector<Vec3d> followed_force_ =
      std::vector<Vec3d>(following_.empty() ? 0 : model_.position.size());
  std::optional<double> load_time_;               // time of `applied_`; none before the first sum
  std::vector<double> load_scales_;               // of each load at that time
  std::optional<CpuSurfels<StateReal>> surfels_;  // created on the first `update_surfels`
  SurfelState moved_surfels_;                     // result of `update_surfels`
};

}  // namespace

std::unique_ptr<Backend> make_cpu_backend(const Model& model, Precision precision, int threads) {
  check_model(model);
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
