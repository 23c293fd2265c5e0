/// A scene that steps, under Python's control.
#pragma once

#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <mutex>
#include <optional>

#include "arrays.hpp"
#include "dicts.hpp"
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
#include "scene/scene_error.hpp"
#include "scene_overrides.hpp"
#include "stages.hpp"

namespace phyxel::python {

/// Columns of history from a dict of arrays. @throws InputError naming what is not so
inline std::vector<HistoryColumn> history_from(const py::object& history, py::ssize_t rows) {
  if (!py::isinstance<py::dict>(history)) {
    throw InputError(fmt::format("history: {} found; allowed: a dict of arrays",
                                 py::repr(history).cast<std::string>()));
  }
  std::vector<HistoryColumn> columns;
  for (const auto& [key, values] : history.cast<py::dict>()) {
    if (!py::isinstance<py::str>(key)) {
      throw InputError(fmt::format("history: the key {} found; allowed: names of columns",
                                   py::repr(key).cast<std::string>()));
    }
    const auto name = key.cast<std::string>();
    columns.push_back({name, numbers_from(values, "history, " + name, rows)});
  }
  return columns;
}

/// The live state of the CPU, as NumPy sees it.
struct Live {
  py::array displacement, velocity;  // (packs, 3, lanes)
  py::array pack, lane;              // of each phyxel, (n,)
};

class Simulation {
 public:
  Simulation(const Scene& scene, const std::map<std::string, Cloud>& clouds,
             const SceneOverrides& overrides)
      : scene_(with_overrides(scene, overrides)) {
    device_ = choose_device(scene_.solver.device, "device");
    model_ = build_model(scene_, make_clouds(scene_, clouds, device_), device_);
    backend_ = make_backend(model_, scene_.solver.precision, device_, scene_.solver.threads);
    plan_ = plan_steps(scene_, model_, *backend_, overrides.unsafe_step);
    start(initial_state(model_, scene_, plan_.dt));
  }

  void step(std::int64_t count) {
    if (count < 0) throw InputError(fmt::format("steps: {} found; allowed: >= 0", count));
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    take(count);
  }

  /// To the end of the scene, or until then.
  void run(std::optional<double> until, const py::object& progress) {
    if (until) check_positive("until", *until);
    const double wanted = until ? std::ceil(*until / plan_.dt - 1e-9) : 0;
    if (wanted > 1e15) {
      throw InputError(fmt::format("until: {} found, which is {:.3g} steps; allowed: at most 1e15",
                                   *until, wanted));
    }
    std::int64_t last = until ? static_cast<std::int64_t>(wanted) : plan_.steps;
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    const RunProgress::Scope telling(told_, progress, scene_.solver.method, solver_->time(),
                                     static_cast<double>(last) * plan_.dt);
    while (solver_->steps() < last) {
      const std::int64_t frame =
          (solver_->steps() / plan_.steps_per_frame + 1) * plan_.steps_per_frame;
      const int halvings = plan_.halvings;
      take(std::min(last, frame) - solver_->steps());
      last = in_present_steps(last, plan_.halvings - halvings);
      if (recorder_) write_one();
      told_.reach_time(solver_->time());
    }
    look();
    told_.end();
  }

  void record(const std::filesystem::path& directory, bool force) {
    const auto turn = my_turn();
    scene_.output.directory = directory;
    const py::gil_scoped_release others;
    recorder_ = std::make_unique<Recorder>(model_, scene_, force);
    // As phyxel run: without a rate only the end is wanted.
    if (scene_.output.frames_per_second > 0) write_one();
  }

  void write_frame() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    write_one();
  }

  Diagnostics energies() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return diagnose(model_, *backend_, *solver_);
  }

  std::vector<Reaction> reactions() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return find_reactions(model_, *backend_, *solver_);
  }

  std::vector<RigidReading> rigid_bodies() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return read_rigid_bodies(model_, *backend_, *solver_);
  }

  std::vector<FragmentReading> fragments() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return read_fragments(model_, *backend_);
  }

  std::vector<ContactReading> contacts() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return find_contacts(model_, *backend_, *solver_);
  }

  /// The triangles of the surface that no crack crosses; nothing if none is crossed.
  std::optional<std::vector<Triangle>> uncut() const {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    if (!model_.fracture.acts()) return std::nullopt;
    return uncut_of(solver_->state());
  }

  State state() const {
    const auto turn = my_turn();
    return solver_->state();
  }

  void set_state(const py::object& displacement, const py::object& velocity,
                 const py::object& history) {
    const auto turn = my_turn();
    State state = solver_->state();
    const auto n = static_cast<py::ssize_t>(model_.size());
    if (!displacement.is_none()) {
      state.displacement = vectors_from(displacement, "displacement", n);
    }
    if (!velocity.is_none()) state.velocity = vectors_from(velocity, "velocity", n);
    if (!history.is_none()) {
      state.history = history_from(history, n);
      checked_history(state, history_columns(model_), model_.size());
    }
    const py::gil_scoped_release others;
    start(state);
  }

  void set_external_forces(const py::object& forces) {
    const auto turn = my_turn();
    const auto n = static_cast<py::ssize_t>(model_.size());
    backend_->set_external_forces(forces.is_none() ? std::vector<Vec3d>{}
                                                   : vectors_from(forces, "external_forces", n));
    watch_.reset();  // it knows nothing of their work
  }

  std::vector<Vec3d> internal_forces() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    std::vector<Vec3d> force;
    backend_->internal_forces(force);
    return force;
  }
  std::vector<Mat3d> gradients() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    std::vector<Mat3d> gradient;
    backend_->displacement_gradients(gradient);
    return gradient;
  }
  std::vector<double> field(Quantity quantity) {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return std::move(find_fields(model_, *backend_, {&quantity, 1}, recovery()).at(quantity));
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
    return Probes(model_, {{.name = "points", .body = body, .points = points}})
        .read(*backend_, recovery());
  }
  std::vector<GasReading> gases() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return read_gases(model_, *backend_, *solver_);
  }
  /// The readings of the scene's probes.
  std::vector<ProbeReading> readings() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return probes().read(*backend_, recovery());
  }
  SurfelState surfels() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    SurfelState surfels;
    if (!model_.surfels.position.empty()) backend_->advect_surfels(surfels);
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
    for (const std::string& name : history_columns(model_)) {
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
    if (model_.surfels.position.empty()) {
      throw InputError("surface_fields: the bodies have no surface; allowed: bodies with one");
    }
    if (!on_surface_ || on_surface_->first != output.fields) {
      on_surface_.emplace(output.fields, std::make_unique<const OutputFields>(model_, output));
    }
    SurfelState surfels;
    backend_->advect_surfels(surfels);
    const State state = solver_->state();
    FieldValues found = on_surface_->second->find(*backend_, state, &surfels, recovery());
    std::vector<SurfaceField> fields;
    for (const auto& [name, quantity] : chosen) {
      fields.push_back(
          {name, found.at(on_surface(quantity)), static_cast<py::ssize_t>(width_of(quantity))});
    }
    return fields;
  }

  Live live(const py::handle& self) const {
    const auto view_now = backend_->view();
    if (!view_now) {
      throw InputError(
          fmt::format("live: the state is in the memory of {}; allowed: device = "
                      "\"cpu\", or the copies displacement and velocity",
                      backend_->name()));
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

  const Scene& scene() const { return scene_; }
  const Model& model() const { return model_; }
  const Backend& backend() const { return *backend_; }
  const StepPlan& plan() const { return plan_; }
  const Solver& solver() const { return *solver_; }

 private:
  static constexpr std::int64_t watch_interval = 250;

  static InputError unknown_field(const std::string& name,
                                  const std::vector<std::pair<std::string, Quantity>>& all) {
    std::vector<std::string> names;
    for (const auto& [known, quantity] : all) names.push_back(known);
    return InputError(fmt::format("surface_fields: \"{}\" found; allowed: {}, history", name,
                                  fmt::join(names, ", ")));
  }

  /// Stepping leaves Python's lock to other threads, which then must leave this alone.
  std::unique_lock<std::mutex> my_turn() const {
    std::unique_lock lock(*busy_, std::try_to_lock);
    if (!lock) {
      throw InputError("this simulation is at work in another thread; allowed: one at a time");
    }
    return lock;
  }

  /// The recovery that the scene's output asks for, made when it is first needed; null: none.
  const Recovery* recovery() {
    if (scene_.output.recovery && !recovery_) recovery_ = std::make_unique<Recovery>(model_);
    return recovery_.get();
  }

  /// The probes of the scene.
  const Probes& probes() {
    if (!probes_) probes_.emplace(model_);
    return *probes_;
  }

  std::optional<std::vector<Triangle>> uncut_of(const State& state) const {
    return uncut_triangles(model_, model_.surfels.triangle, state.broken);
  }

  void write_one() {
    if (!recorder_) throw InputError("write_frame: nothing is recorded yet; needed first: record");
    const State state = solver_->state();
    Frame frame;
    frame.state = &state;
    frame.diagnostics = look();
    frame.readings = {
        find_reactions(model_, *backend_, *solver_),    probes().read(*backend_, recovery()),
        read_gases(model_, *backend_, *solver_),        find_contacts(model_, *backend_, *solver_),
        read_rigid_bodies(model_, *backend_, *solver_), read_fragments(model_, *backend_)};
    SurfelState surfels;
    std::optional<std::vector<Triangle>> uncut;
    if (scene_.output.surface && !model_.surfels.position.empty()) {
      backend_->advect_surfels(surfels);
      frame.surfels = &surfels;
      uncut = uncut_of(state);
      if (uncut) frame.triangles = &*uncut;
    }
    if (!fields_) fields_.emplace(model_, scene_.output);
    frame.fields = fields_->find(*backend_, state, frame.surfels, recovery());
    recorder_->write(frame);
  }

  void start(const State& state) {
    solver_ = std::make_unique<Solver>(model_, *backend_, state, scene_.solver.method);
    control_.emplace(model_, *backend_, plan_);
    solver_->observe(
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
    looked_ = solver_->steps();
    const Diagnostics now = diagnose(model_, *backend_, *solver_);
    watch_.reset();
    if (backend_->external_forces().empty()) watch_.emplace(model_, now);
  }

  /// A number of steps, counted anew after the step was halved so many times, or doubled where that
  /// is negative. A step of twice the size may go beyond: half of one is not taken.
  static std::int64_t in_present_steps(std::int64_t steps, int halvings) {
    return halvings >= 0 ? steps << halvings : -((-steps) >> -halvings);
  }

  /// So many steps of the present size: of twice as many, once they are halved.
  void take(std::int64_t count) {
    for (std::int64_t k = 0, taken = 1; k < count; k += taken) {
      const int made = control_->look(*solver_, plan_.halvings);
      plan_.halve(made);
      count = k + in_present_steps(count - k, made);
      looked_ = in_present_steps(looked_, made);
      try {
        const std::int64_t end = solver_->steps() + (count - k);
        taken = solver_->steps_to(
            std::min({end, looked_ + watch_interval, control_->next_look(*solver_)}));
        naming(scene_, [&] { solver_->step(static_cast<int>(taken)); });
      } catch (const InterruptedError&) {
        const py::gil_scoped_acquire here;
        throw py::error_already_set();
      }
      if (solver_->steps() - looked_ >= watch_interval) look();
      if (std::chrono::steady_clock::now() - listened_ > std::chrono::milliseconds(100)) {
        const py::gil_scoped_acquire here;
        listened_ = std::chrono::steady_clock::now();
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();  // Ctrl-C
        told_.reach_time(solver_->time());
      }
    }
    backend_->wait();
  }

  /// @throws DivergedError
  Diagnostics look() {
    const Diagnostics now = diagnose(model_, *backend_, *solver_);
    looked_ = solver_->steps();
    if (watch_) {
      watch_->check(now, &*control_);
      control_->see(*solver_);
    } else if (now.bad_phyxel >= 0) {
      throw DivergedError(fmt::format("step {}, t = {:g} s: the state of phyxel {} is not finite",
                                      now.step, now.time, now.bad_phyxel));
    }
    return now;
  }

  Scene scene_;
  ChosenDevice device_;
  Model model_;
  std::unique_ptr<Backend> backend_;
  StepPlan plan_;
  std::unique_ptr<Solver> solver_;
  std::optional<StepControl> control_;
  std::optional<StabilityWatch> watch_;
  std::unique_ptr<Recorder> recorder_;
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
  std::unique_ptr<std::mutex> busy_ = std::make_unique<std::mutex>();
};

}  // namespace phyxel::python
