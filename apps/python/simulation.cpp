/// A scene that steps, under Python's control.
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
#include "phyxel/history.hpp"
#include "phyxel/model.hpp"
#include "phyxel/reactions.hpp"
#include "phyxel/recorder.hpp"
#include "phyxel/scene.hpp"
#include "phyxel/step_control.hpp"
#include "scene/scene_error.hpp"
#include "scene_overrides.hpp"
#include "stages.hpp"

namespace phyxel::python {
namespace {

/// Columns of history from a dict of arrays. @throws InputError naming what is not so
std::vector<HistoryColumn> history_from(const py::object& history, py::ssize_t rows) {
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
    model_ = build_model(scene_, make_clouds(scene_, clouds), device_);
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
    return diagnose(model_, *backend_, solver_->now());
  }

  std::vector<Reaction> reactions() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    return find_reactions(model_, *backend_, *solver_);
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
  SurfelState surfels() {
    const auto turn = my_turn();
    const py::gil_scoped_release others;
    SurfelState surfels;
    if (!model_.surfels.position.empty()) backend_->advect_surfels(surfels);
    return surfels;
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

  void write_one() {
    if (!recorder_) throw InputError("write_frame: nothing is recorded yet; needed first: record");
    const State state = solver_->state();
    Frame frame;
    frame.state = &state;
    frame.diagnostics = look();
    frame.reactions = find_reactions(model_, *backend_, *solver_);
    SurfelState surfels;
    if (scene_.output.surface && !model_.surfels.position.empty()) {
      backend_->advect_surfels(surfels);
      frame.surfels = &surfels;
    }
    frame.fields = find_fields(model_, *backend_, wanted_fields(scene_.output), recovery());
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
    const Diagnostics now = diagnose(model_, *backend_, solver_->now());
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
    const Diagnostics now = diagnose(model_, *backend_, solver_->now());
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
  std::int64_t looked_ = 0;
  RunProgress told_;
  // When Python last heard of signals: across frames, which may be shorter than the interval.
  std::chrono::steady_clock::time_point listened_ = std::chrono::steady_clock::now();
  std::unique_ptr<std::mutex> busy_ = std::make_unique<std::mutex>();
};

std::unique_ptr<Simulation> simulate(const std::optional<std::filesystem::path>& file,
                                     const std::string& text,
                                     const std::map<std::string, Cloud>& clouds,
                                     SceneOverrides overrides, const py::object& progress) {
  const ObserveStages observing = stages_for(progress);
  const py::gil_scoped_release others;
  return std::make_unique<Simulation>(file ? read_scene(*file) : parse_scene(text, ""), clouds,
                                      overrides);
}

}  // namespace

void add_simulation(py::module_& module) {
  using namespace py::literals;
  py::class_<Live>(
      module, "Live",
      "The state where the CPU steps it, without a copy and read-only: it changes with\n"
      "every step. Phyxel i is at [pack[i], :, lane[i]].")
      .def_readonly("displacement", &Live::displacement, "u [m], (packs, 3, lanes).")
      .def_readonly("velocity", &Live::velocity, "v half a step before [m/s], (packs, 3, lanes).")
      .def_readonly("pack", &Live::pack, "(n,)")
      .def_readonly("lane", &Live::lane, "(n,)");

  const auto of_model = [](auto member) {
    return
        [member](py::object self) { return view(self.cast<Simulation&>().model().*member, self); };
  };
  py::class_<Simulation>(module, "SimulationBase")
      .def(py::init([](const std::optional<std::filesystem::path>& file, const std::string& text,
                       const std::map<std::string, Cloud>& clouds,
                       const std::optional<std::string>& device,
                       const std::optional<std::string>& precision,
                       const std::optional<std::string>& method, std::optional<int> threads,
                       std::optional<double> step, std::optional<double> end, bool unsafe_step,
                       const py::object& progress) {
             return simulate(file, text, clouds,
                             {device, precision, method, threads, step, end, unsafe_step},
                             progress);
           }),
           "file"_a, "text"_a, "clouds"_a, "device"_a, "precision"_a, "method"_a, "threads"_a,
           "step"_a, "end"_a, "unsafe_step"_a, "progress"_a)
      .def("step", &Simulation::step, "steps"_a = 1, "Takes so many steps.")
      .def("run", &Simulation::run, "until"_a = py::none(), "progress"_a = py::none(),
           "Steps until then [s], or to the scene's end; writes frames if they are recorded.\n"
           "progress(stage, share) is called meanwhile.")
      .def("record", &Simulation::record, "directory"_a, "force"_a = false,
           "From now on frames go there, the present one first, as the scene's [output] asks.")
      .def("write_frame", &Simulation::write_frame, "Records the present state.")
      .def(
          "energies", [](Simulation& s) { return energies_of(s.energies()); },
          "Energies [J], momenta and the other columns of energy.csv, now: {name: value}.")
      .def(
          "reactions", [](Simulation& s) { return dicts_of(s.reactions()); },
          "Reactions of supports, now: a list of dicts, one for each entry of fixed and motion:\n"
          "body, set, force [N], torque [N m] about centre [m], work [J].")
      .def(
          "forces", [](Simulation& s) { return taken(s.internal_forces()); },
          "Internal forces [N], (n, 3), a copy.")
      .def(
          "gradients", [](Simulation& s) { return taken(s.gradients()); },
          "Displacement gradients, F - 1, (n, 3, 3), a copy.")
      .def(
          "von_mises", [](Simulation& s) { return taken(s.field(Quantity::von_mises)); },
          "Von Mises equivalent of the Cauchy stress [Pa], (n,), a copy.")
      .def(
          "volume_ratio", [](Simulation& s) { return taken(s.field(Quantity::volume_ratio)); },
          "det F, (n,), a copy.")
      .def(
          "stress",
          [](Simulation& s) {
            return taken(s.field(Quantity::stress)).reshape({-1, 6});
          },
          "Cauchy stress [Pa], (n, 6): xx, yy, zz, xy, yz, xz; a copy.")
      .def(
          "strain",
          [](Simulation& s) {
            return taken(s.field(Quantity::strain)).reshape({-1, 6});
          },
          "Green's strain, (n, 6): xx, yy, zz, xy, yz, xz; a copy.")
      .def(
          "surface",
          [](Simulation& s) {
            SurfelState surfels = s.surfels();
            return py::make_tuple(taken(std::move(surfels.position)),
                                  taken(std::move(surfels.normal)));
          },
          "Deformed surfels [m] and their normals, both (m, 3), copies.")
      .def("set_state", &Simulation::set_state, "displacement"_a = py::none(),
           "velocity"_a = py::none(), "history"_a = py::none(),
           "Replaces displacements [m], velocities [m/s], both (n, 3), or history, {name: (n,)};\n"
           "time goes on. An empty history is the virgin material.")
      .def_property_readonly(
          "live", [](py::object self) { return self.cast<Simulation&>().live(self); },
          "The state without a copy (on the CPU): see Live.")
      .def_property_readonly(
          "displacement", [](const Simulation& s) { return taken(s.state().displacement); },
          "u [m], (n, 3), a copy.")
      .def_property_readonly(
          "velocity", [](const Simulation& s) { return taken(s.state().velocity); },
          "v half a step before [m/s], (n, 3), a copy.")
      .def_property_readonly(
          "history",
          [](const Simulation& s) {
            py::dict columns;
            for (HistoryColumn& column : s.state().history) {
              columns[py::str(column.name)] = taken(std::move(column.values));
            }
            return columns;
          },
          "What the laws remember at the last step: {name: (n,)}, copies; e.g.\n"
          "equivalent_plastic_strain. Empty for elastic materials without viscosity.")
      .def_property(
          "external_forces",
          [](py::object self) {
            const auto force = self.cast<Simulation&>().backend().external_forces();
            std::vector<Vec3d> copy(force.begin(), force.end());
            return taken(std::move(copy));
          },
          &Simulation::set_external_forces,
          "Forces of your own [N], (n, 3), copied when set; they act until set again. None: none.")
      .def_property_readonly("rest", of_model(&Model::position), "Positions at rest [m], (n, 3).")
      .def_property_readonly("mass", of_model(&Model::mass), "[kg], (n,)")
      .def_property_readonly("volume", of_model(&Model::volume), "At rest [m^3], (n,)")
      .def_property_readonly(
          "triangles",
          [](py::object self) {
            return view(self.cast<Simulation&>().model().surfels.triangle, self);
          },
          "Of the surface, (t, 3).")
      .def_property_readonly(
          "neighbours",
          [](py::object self) {
            const Csr& lists =
                self.cast<Simulation&>().model().with_lists().neighbourhood.neighbours;
            return py::make_tuple(view(lists.offsets, self), view(lists.indices, self));
          },
          "Lists of neighbours as (offsets, indices): those of i are\n"
          "indices[offsets[i]:offsets[i + 1]].")
      .def_property_readonly(
          "time", [](const Simulation& s) { return s.solver().time(); }, "[s]")
      .def_property_readonly(
          "steps", [](const Simulation& s) { return s.solver().steps(); }, "Taken so far.")
      .def_property_readonly(
          "dt", [](const Simulation& s) { return s.solver().dt(); }, "Time step [s].")
      .def_property_readonly(
          "largest_step", [](const Simulation& s) { return s.plan().limit.largest_step; },
          "Largest stable time step of Verlet's method [s]; 0 for other methods.")
      .def_property_readonly(
          "end",
          [](const Simulation& s) { return s.plan().dt * static_cast<double>(s.plan().steps); },
          "Of the scene [s].")
      .def_property_readonly(
          "residual", [](const Simulation& s) { return s.solver().work().residual; },
          "Largest force that Newton's method has left, of what acts.")
      .def_property_readonly(
          "device", [](const Simulation& s) { return s.backend().name(); }, "What steps, in words.")
      .def_property_readonly("warnings", [](const Simulation& s) { return s.model().warnings; })
      .def_property_readonly(
          "memory",
          [](const Simulation& s) {
            py::dict bytes;
            for (const ArrayBytes& array : s.backend().memory()) {
              bytes[py::str(array.name)] = array.bytes;
            }
            return bytes;
          },
          "Bytes the device holds: {array: bytes}.")
      .def("__len__", [](const Simulation& s) { return s.model().size(); });
}

}  // namespace phyxel::python
