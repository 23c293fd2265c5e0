/// A scene that steps, under Python's control.
#pragma once

#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <mutex>
#include <optional>

#include "arrays.hpp"
#include "dicts.hpp"
#include "fair_mutex.hpp"
#include "files/frame_file.hpp"
#include "phyxel/backend.hpp"
#include "phyxel/device.hpp"
#include "phyxel/diagnostics.hpp"
#include "phyxel/gases.hpp"
#include "phyxel/history.hpp"
#include "phyxel/model.hpp"
#include "phyxel/open_surface.hpp"
#include "phyxel/output_fields.hpp"
#include "phyxel/reactions.hpp"
#include "phyxel/recorder.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/step_control.hpp"
#include "program_ranks.hpp"
#include "scene/scene_error.hpp"
#include "scene_overrides.hpp"
#include "simulation_view.hpp"
#include "stages.hpp"

namespace phyxel::python {

/// The live state of the CPU, as NumPy sees it.
struct Live {
  py::array displacement, velocity;  // (packs, 3, lanes)
  py::array pack, lane;              // of each phyxel, (n,)
};

class Simulation {
 public:
  Simulation(const Scene& scene, const std::map<std::string, Cloud>& clouds,
             const SceneOverrides& overrides)
      : scene_(with_overrides(scene, overrides)), unsafe_step_(overrides.unsafe_step) {
    device_ = choose_device(scene_.solver.device, "device");
    built_ = built(scene_, clouds);
    start(initial_state(built_->model(), scene_, built_->plan.dt));
  }

  ~Simulation() {
    if (view_) view_->stop();  // while all that it uses is there
  }
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  void step(std::int64_t count) {
    if (count < 0) throw InputError(fmt::format("steps: {} found; allowed: >= 0", count));
    const auto turn = my_turn_to_change();
    const py::gil_scoped_release others;
    take(count);
  }

  /// To the end of the scene, or until then.
  void run(std::optional<double> until, const py::object& progress) {
    if (until) check_positive("until", *until);
    const auto turn = my_turn_to_change();
    const double wanted = until ? std::ceil(*until / built_->plan.dt - 1e-9) : 0;
    if (wanted > 1e15) {
      throw InputError(fmt::format("until: {} found, which is {:.3g} steps; allowed: at most 1e15",
                                   *until, wanted));
    }
    std::int64_t last = until ? static_cast<std::int64_t>(wanted) : built_->plan.steps;
    const py::gil_scoped_release others;
    const RunProgress::Scope telling(told_, progress, scene_.solver.method, built_->solver->time(),
                                     static_cast<double>(last) * built_->plan.dt);
    while (built_->solver->steps() < last) {
      const std::int64_t frame = (built_->solver->steps() / built_->plan.steps_per_frame + 1) *
                                 built_->plan.steps_per_frame;
      const int halvings = built_->plan.halvings;
      take(std::min(last, frame) - built_->solver->steps());
      last = in_present_steps(last, built_->plan.halvings - halvings);
      if (recorder_) write_one();
      told_.reach_time(built_->solver->time());
    }
    look();
    told_.end();
  }

  void record(const std::filesystem::path& directory, bool force) {
    const auto turn = my_turn_to_change();
    scene_.output.directory = directory;
    const py::gil_scoped_release others;
    recorder_ = std::make_unique<Recorder>(built_->model(), scene_, force);
    recorded_ = built_;
    // As phyxel run: without a rate only the end is wanted.
    if (scene_.output.frames_per_second > 0) write_one();
  }

  void write_frame() {
    const auto turn = my_turn_to_change();
    const py::gil_scoped_release others;
    write_one();
  }

  Diagnostics energies() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return diagnose(built_->model(), *built_->backend, *built_->solver);
  }

  std::vector<Reaction> reactions() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return find_reactions(built_->model(), *built_->backend, *built_->solver);
  }

  std::vector<RigidReading> rigid_bodies() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return read_rigid_bodies(built_->model(), *built_->backend, *built_->solver);
  }

  std::vector<FragmentReading> fragments() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return read_fragments(built_->model(), *built_->backend);
  }

  std::vector<ContactReading> contacts() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return find_contacts(built_->model(), *built_->backend, *built_->solver);
  }

  /// The triangles of the surface that no crack crosses; nothing if none is crossed.
  std::optional<std::vector<Triangle>> uncut() const {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    if (!built_->model().fracture.acts()) return std::nullopt;
    return uncut_of(built_->solver->state());
  }

  State state() const {
    const auto turn = my_turn();
    return built_->solver->state();
  }

  void set_state(const py::object& displacement, const py::object& velocity,
                 const py::object& history) {
    const auto turn = my_turn_to_change();
    State state = built_->solver->state();
    const auto n = static_cast<py::ssize_t>(built_->model().size());
    if (!displacement.is_none()) {
      state.displacement = vectors_from(displacement, "displacement", n);
    }
    if (!velocity.is_none()) state.velocity = vectors_from(velocity, "velocity", n);
    if (!history.is_none()) {
      state.history = history_from(history, n);
      checked_history(state, history_columns(built_->model()), built_->model().size());
    }
    const py::gil_scoped_release others;
    start(state);
  }

  void set_external_forces(const py::object& forces) {
    const auto turn = my_turn_to_change();
    const auto n = static_cast<py::ssize_t>(built_->model().size());
    built_->backend->set_external_forces(
        forces.is_none() ? std::vector<Vec3d>{} : vectors_from(forces, "external_forces", n));
    built_->watch.reset();  // it knows nothing of their work
  }

  std::vector<Vec3d> internal_forces() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    std::vector<Vec3d> force;
    built_->backend->internal_forces(force);
    return force;
  }
  std::vector<Mat3d> gradients() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    std::vector<Mat3d> gradient;
    built_->backend->displacement_gradients(gradient);
    return gradient;
  }
  std::vector<double> field(Quantity quantity) {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return std::move(
        find_fields(built_->model(), *built_->backend, {&quantity, 1}, recovery()).at(quantity));
  }
  /// Values at points at rest [m] of a body; "": the only one.
  std::vector<ProbeReading> readings_at(const std::vector<Vec3d>& points, std::string body) {
    const auto turn = my_turn();
    if (body.empty()) {
      if (scene_.bodies.size() != 1) {
        throw InputError(fmt::format("body: none found; needed: the name of one of the {} bodies",
                                     scene_.bodies.size()));
      }
      body = scene_.bodies.front().name;
    }
    if (points.empty()) return {};
    const py::gil_scoped_release others;
    return Probes(built_->model(), {{.name = "points", .body = body, .points = points}})
        .read(*built_->backend, recovery());
  }
  std::vector<GasReading> gases() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return read_gases(built_->model(), *built_->backend, *built_->solver);
  }
  /// The readings of the scene's probes.
  std::vector<ProbeReading> readings() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return probes().read(*built_->backend, recovery());
  }
  SurfelState surfels() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    SurfelState surfels;
    if (!built_->model().surfels.position.empty()) built_->backend->advect_surfels(surfels);
    return surfels;
  }

  /// A field on the surfels.
  struct SurfaceField {
    std::string name;
    std::vector<double> values;
    py::ssize_t width;
  };
  /// Fields on the surfels, as frames of the surface have them. "history" is all of its columns.
  /// @throws InputError for a name that frames of the surface lack
  std::vector<SurfaceField> surface_fields(const std::vector<std::string>& names) {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    std::vector<std::pair<std::string, Quantity>> all{{"displacement", Quantity::displacement},
                                                      {"velocity", Quantity::velocity}};
    for (const PointField& field : point_fields()) all.emplace_back(field.name, field.quantity);
    const std::size_t computed = all.size();
    for (const std::string& name : history_columns(built_->model())) {
      all.emplace_back(name, history_quantity(all.size() - computed));
    }
    OutputRequest output;
    output.fields.clear();
    std::vector<std::pair<std::string, Quantity>> chosen;
    for (const std::string& name : names) {
      const bool is_history_name = name == "history";
      const std::size_t before = chosen.size();
      for (std::size_t k = 0; k < all.size(); ++k) {
        if (all[k].first == name || (is_history_name && k >= computed)) chosen.push_back(all[k]);
      }
      if (chosen.size() == before && !is_history_name) throw unknown_field(name, all);
      const bool is_column = chosen.size() > before && is_history(chosen.back().second);
      output.fields.push_back(is_column ? "history" : name);
    }
    if (built_->model().surfels.position.empty()) {
      throw InputError("surface_fields: the bodies have no surface; allowed: bodies with one");
    }
    if (!on_surface_ || on_surface_->first != output.fields) {
      on_surface_.emplace(output.fields,
                          std::make_unique<const OutputFields>(built_->model(), output));
    }
    SurfelState surfels;
    built_->backend->advect_surfels(surfels);
    const State state = built_->solver->state();
    FieldValues found = on_surface_->second->find(*built_->backend, state, &surfels, recovery());
    std::vector<SurfaceField> fields;
    for (const auto& [name, quantity] : chosen) {
      fields.push_back(
          {name, found.at(on_surface(quantity)), static_cast<py::ssize_t>(width_of(quantity))});
    }
    return fields;
  }

  Live live() const {
    const std::shared_ptr<const app::BuiltScene> kept = steps();
    const py::capsule self = keeper(kept);
    const auto view_now = kept->backend->view();
    if (!view_now) {
      throw InputError(
          fmt::format("live: the state is in the memory of {}; allowed: device = "
                      "\"cpu\", or the copies displacement and velocity",
                      kept->backend->name()));
    }
    const Shape shape{view_now->packs, 3, view_now->lanes};
    const auto array = [&](const void* data) {
      return view_now->single ? view(static_cast<const float*>(data), shape, self)
                              : view(static_cast<const double*>(data), shape, self);
    };
    std::vector<Index> pack, lane;
    for (const Index slot : view_now->slot) {
      pack.push_back(slot / view_now->lanes);
      lane.push_back(slot % view_now->lanes);
    }
    return {array(view_now->displacements), array(view_now->velocities), taken(std::move(pack)),
            taken(std::move(lane))};
  }

  /// Serves a page that shows this simulation and steps it, until `close_view`. Meanwhile others
  /// may read it, between turns of the view, but not change it.
  /// @param clouds as of the constructor @param out folder for what the page saves, or none
  /// @returns the page's address @throws InputError
  std::string open_view(const std::map<std::string, Cloud>& clouds, app::ViewOptions options,
                        const std::optional<std::filesystem::path>& out);
  /// Ends the view, if there is one; the simulation goes on from the time reached, with the values
  /// that users have set. @throws Error that has ended the view, or DivergedError
  void close_view();

  const Scene& scene() const { return scene_; }
  /// The model, and what steps it now; a view may replace it.
  std::shared_ptr<const app::BuiltScene> steps() const {
    std::unique_lock<FairMutex> turn;
    if (view_) turn = my_turn();
    return built_;
  }
  /// A value of what steps, between turns of a view. @param read called with it
  template <class Read>
  auto reading(Read read) const {
    std::unique_lock<FairMutex> turn;
    if (view_) turn = my_turn();
    return read(std::as_const(*built_));
  }

 private:
  static constexpr std::int64_t watch_interval = 250;

  static InputError unknown_field(const std::string& name,
                                  const std::vector<std::pair<std::string, Quantity>>& all) {
    std::vector<std::string> names;
    for (const auto& [known, quantity] : all) names.push_back(known);
    return InputError(fmt::format("surface_fields: \"{}\" found; allowed: {}, history", name,
                                  fmt::join(names, ", ")));
  }

  std::shared_ptr<app::BuiltScene> built(const Scene& scene,
                                         const std::map<std::string, Cloud>& clouds) const {
    return std::make_shared<app::BuiltScene>(
        std::make_unique<const SharedModel>(app::all_ranks(), scene,
                                            make_clouds(scene, clouds, device_), device_),
        scene, unsafe_step_);
  }

  /// Takes over what a view steps now.
  void follow_view();

  /// A turn in which the state or its course is changed.
  std::unique_lock<FairMutex> my_turn_to_change() const {
    if (view_) {
      throw InputError(
          "this simulation runs in a view; allowed: reading it, or close() of the view first");
    }
    return my_turn();
  }

  /// Stepping leaves Python's lock to other threads, which then must leave this alone. A view is
  /// waited for.
  std::unique_lock<FairMutex> my_turn() const {
    if (view_) {
      const py::gil_scoped_release others;
      return std::unique_lock(busy_);
    }
    std::unique_lock lock(busy_, std::try_to_lock);
    if (!lock) {
      throw InputError("this simulation is at work in another thread; allowed: one at a time");
    }
    return lock;
  }

  /// The recovery that the scene's output asks for, made when it is first needed; null: none.
  const Recovery* recovery() {
    if (scene_.output.recovery && !recovery_)
      recovery_ = std::make_unique<Recovery>(built_->model());
    return recovery_.get();
  }

  /// The probes of the scene.
  const Probes& probes() {
    if (!probes_) probes_.emplace(built_->model());
    return *probes_;
  }

  std::optional<std::vector<Triangle>> uncut_of(const State& state) const {
    return uncut_triangles(built_->model(), built_->model().surfels.triangle, state.broken);
  }

  void write_one() {
    if (!recorder_) throw InputError("write_frame: nothing is recorded yet; needed first: record");
    const State state = built_->solver->state();
    Frame frame;
    frame.state = &state;
    frame.diagnostics = look();
    frame.readings = {find_reactions(built_->model(), *built_->backend, *built_->solver),
                      probes().read(*built_->backend, recovery()),
                      read_gases(built_->model(), *built_->backend, *built_->solver),
                      find_contacts(built_->model(), *built_->backend, *built_->solver),
                      read_rigid_bodies(built_->model(), *built_->backend, *built_->solver),
                      read_fragments(built_->model(), *built_->backend)};
    SurfelState surfels;
    std::optional<std::vector<Triangle>> uncut;
    if (scene_.output.surface && !built_->model().surfels.position.empty()) {
      built_->backend->advect_surfels(surfels);
      frame.surfels = &surfels;
      uncut = uncut_of(state);
      if (uncut) frame.triangles = &*uncut;
    }
    if (!fields_) fields_.emplace(built_->model(), scene_.output);
    frame.fields = fields_->find(*built_->backend, state, frame.surfels, recovery());
    recorder_->write(frame);
  }

  void start(const State& state) {
    built_->begin(state, scene_.solver.method);
    looked_ = built_->solver->steps();
    observe();
  }

  /// Listens to searches for equilibrium.
  void observe() {
    built_->solver->observe(
        [this, last = std::chrono::steady_clock::now()](const NewtonProgress& newton) mutable {
          if (std::chrono::steady_clock::now() - last < std::chrono::milliseconds(100)) return true;
          last = std::chrono::steady_clock::now();
          const py::gil_scoped_acquire here;
          try {
            told_.reach_residual(newton.residual, newton.tolerance);
          } catch (py::error_already_set& error) {
            error.restore();  // for `take`
            return false;
          }
          return PyErr_CheckSignals() == 0;  // Ctrl-C
        });
  }

  /// A number of steps, counted anew after the step was halved so many times, or doubled where that
  /// is negative. A step of twice the size may go beyond: half of one is not taken.
  static std::int64_t in_present_steps(std::int64_t steps, int halvings) {
    return halvings >= 0 ? steps << halvings : -((-steps) >> -halvings);
  }

  /// So many steps of the present size: of twice as many, once they are halved.
  void take(std::int64_t count) {
    for (std::int64_t k = 0, taken = 1; k < count; k += taken) {
      const int made = built_->control->look(*built_->solver, built_->plan.halvings);
      built_->plan.halve(made);
      count = k + in_present_steps(count - k, made);
      looked_ = in_present_steps(looked_, made);
      try {
        const std::int64_t end = built_->solver->steps() + (count - k);
        taken = built_->solver->steps_to(
            std::min({end, looked_ + watch_interval, built_->control->next_look(*built_->solver)}));
        naming(scene_, [&] { built_->solver->step(static_cast<int>(taken)); });
      } catch (const InterruptedError&) {
        const py::gil_scoped_acquire here;
        throw py::error_already_set();
      }
      if (built_->solver->steps() - looked_ >= watch_interval) look();
      if (std::chrono::steady_clock::now() - listened_ > std::chrono::milliseconds(100)) {
        const py::gil_scoped_acquire here;
        listened_ = std::chrono::steady_clock::now();
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();  // Ctrl-C
        told_.reach_time(built_->solver->time());
      }
    }
    built_->backend->wait();
  }

  /// @throws DivergedError
  Diagnostics look() {
    looked_ = built_->solver->steps();
    return built_->look();
  }

  Scene scene_;
  ChosenDevice device_;
  bool unsafe_step_ = false;
  std::shared_ptr<app::BuiltScene> built_;
  std::unique_ptr<Recorder> recorder_;
  std::shared_ptr<const app::BuiltScene> recorded_;  // of the recorder
  std::unique_ptr<const Recovery> recovery_;
  std::optional<OutputFields> fields_;
  // Fields that were last asked for on the surface, and what finds them.
  std::optional<std::pair<std::vector<std::string>, std::unique_ptr<const OutputFields>>>
      on_surface_;
  std::optional<Probes> probes_;
  std::int64_t looked_ = 0;
  RunProgress told_;
  // When Python last heard of signals: across frames, which may be shorter than the interval.
  std::chrono::steady_clock::time_point listened_ = std::chrono::steady_clock::now();
  mutable FairMutex busy_;
  std::unique_ptr<SimulationView> view_;  // last: it uses the other members
};

}  // namespace phyxel::python
