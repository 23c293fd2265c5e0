/// Python's view of a scene that steps.
#include "simulation.hpp"

namespace phyxel::python {
namespace {

std::unique_ptr<Simulation> simulate(const std::optional<std::filesystem::path>& file,
                                     const std::string& text,
                                     const std::map<std::string, Cloud>& clouds,
                                     SceneOverrides overrides, const py::object& progress) {
  const ObserveStages observing = stages_for(progress);
  const py::gil_scoped_release others;
  return std::make_unique<Simulation>(file ? read_scene(*file) : parse_scene(text, ""), clouds,
                                      overrides);
}

app::ViewOptions view_options(double pace, bool paused, int port, const std::string& host) {
  if (!(pace >= 1e-6 && pace <= 1e3)) {
    throw InputError(fmt::format("pace: {} found; allowed: 1e-06 to 1000", pace));
  }
  if (port < 0 || port > 65535) {
    throw InputError(fmt::format("port: {} found; allowed: 0 to 65535", port));
  }
  app::ViewOptions options;
  options.pace = pace;
  options.paused = paused;
  options.port = port;
  options.host = host;
  options.prints = false;
  options.farewell = "The view was closed; the simulation goes on in Python.";
  return options;
}

}  // namespace

std::string Simulation::open_view(const std::map<std::string, Cloud>& clouds,
                                  app::ViewOptions options,
                                  const std::optional<std::filesystem::path>& out) {
  if (view_) throw InputError("this simulation has a view; allowed: one, until its close()");
  const auto turn = my_turn();
  view_ = [&] {
    const py::gil_scoped_release others;
    Scene scene = scene_;
    if (out) scene.output.directory = *out;
    return std::make_unique<SimulationView>(
        std::move(options), std::move(scene), built_,
        [this, clouds](const Scene& changed) { return built(changed, clouds); });
  }();
  built_->solver->observe({});  // the view's thread knows nothing of Python
  view_->start([this](const std::function<void()>& work) {
    const std::lock_guard lock(busy_);
    work();
    follow_view();
  });
  return view_->address();
}

void Simulation::follow_view() {
  const app::LiveScene& live = view_->live();
  if (live.built() == built_) return;
  built_ = live.built();
  Scene changed = live.scene();
  changed.output = scene_.output;
  scene_ = std::move(changed);
  recovery_.reset();
  fields_.reset();
  on_surface_.reset();
  probes_.reset();
}

void Simulation::close_view() {
  if (!view_) return;
  {
    const py::gil_scoped_release others;
    view_->stop();
  }
  const auto turn = my_turn();
  const std::unique_ptr<SimulationView> ended = std::move(view_);
  looked_ = built_->solver->steps();
  observe();
  ended->finish();
}

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
    return [member](const Simulation& s) {
      const auto steps = s.steps();
      return view(steps->model().*member, keeper(steps));
    };
  };
  const auto reading = [](auto read) {
    return [read](const Simulation& s) { return s.reading(read); };
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
          "Reactions of supports, now: a list of dicts, one for each entry of fixed, motion\n"
          "and symmetry:\n"
          "body, set, force [N], torque [N m] about centre [m], work [J].")
      .def(
          "gases", [](Simulation& s) { return dicts_of(s.gases()); },
          "Gases in cavities, now: a list of dicts, one for each traction with gas:\n"
          "body, set, pressure [Pa], volume [m^3].")
      .def(
          "contacts", [](Simulation& s) { return dicts_of(s.contacts()); },
          "What obstacles do, now and since t = 0: a list of dicts, one for each obstacle:\n"
          "obstacle, force [N] on the bodies and torque [N m] about place [m], impulse [N s],\n"
          "angular_impulse [N m s], work [J], friction_heat [J], impact_loss [J],\n"
          "depth [m] of the phyxel that is deepest inside.")
      .def(
          "rigid_bodies", [](Simulation& s) { return dicts_of(s.rigid_bodies()); },
          "Obstacles that are free rigid bodies, now: a list of dicts, one for each:\n"
          "obstacle, place [m] of its centre of mass, rotation [rad] from its position at rest\n"
          "(axis times angle), velocity [m/s], spin [rad/s], kinetic_energy [J].")
      .def(
          "fragments", [](Simulation& s) { return dicts_of(s.fragments()); },
          "Fragments of broken bodies, now: a list of dicts, one for each, the heaviest first, "
          "and\n"
          "one for the dust of each body, phyxels without an unbroken pair: body, fragment (its\n"
          "number, from 1; 0: dust), first_phyxel, phyxels, mass [kg], centre [m] of mass, "
          "velocity\n"
          "[m/s] over the last step, angular_momentum [kg m^2/s] about the centre, spin [rad/s].\n"
          "Empty in scenes without fracture and notches.")
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
          "at",
          [](Simulation& s, const py::object& points, const std::string& body) {
            return arrays_of(s.readings_at(vectors_from(points, "points", -1), body));
          },
          "points"_a, "body"_a = "",
          "Values at points at rest [m], (m, 3), of a body: a dict of displacement [m] and\n"
          "velocity [m/s], (m, 3), Cauchy stress [Pa] and Green's strain, (m, 6): xx, yy, zz, xy,\n"
          "yz, xz, and von_mises [Pa], (m,). From a fit through phyxels within a support.")
      .def(
          "probes",
          [](Simulation& s) {
            py::dict of_probes;
            std::map<std::string, std::vector<ProbeReading>> sorted;
            std::vector<std::string> order;
            for (ProbeReading& reading : s.readings()) {
              if (sorted[reading.probe].empty()) order.push_back(reading.probe);
              sorted[reading.probe].push_back(std::move(reading));
            }
            for (const std::string& name : order) {
              of_probes[py::str(name)] = arrays_of(sorted[name]);
            }
            return of_probes;
          },
          "What the scene's probes read now: {name: dict}, each as of at().")
      .def(
          "surface",
          [](Simulation& s) {
            SurfelState surfels = s.surfels();
            return py::make_tuple(taken(std::move(surfels.position)),
                                  taken(std::move(surfels.normal)));
          },
          "Deformed surfels [m] and their normals, both (m, 3), copies.")
      .def(
          "surface_fields",
          [](Simulation& s, const std::vector<std::string>& names) {
            py::dict fields;
            for (Simulation::SurfaceField& field : s.surface_fields(names)) {
              py::array values = taken(std::move(field.values));
              if (field.width > 1) values = values.reshape({py::ssize_t{-1}, field.width});
              fields[py::str(field.name)] = values;
            }
            return fields;
          },
          "names"_a,
          "Fields on the deformed surfels by the names of output.fields, as frames of the surface\n"
          "have them: {name: array}, (m,), (m, 3) or (m, 6), copies; \"history\" is all that the\n"
          "materials remember.")
      .def("set_state", &Simulation::set_state, "displacement"_a = py::none(),
           "velocity"_a = py::none(), "history"_a = py::none(),
           "Replaces displacements [m], velocities [m/s], both (n, 3), or history, {name: (n,)};\n"
           "time goes on. An empty history is the virgin material.")
      .def_property_readonly(
          "live", [](const Simulation& s) { return s.live(); },
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
          [](const Simulation& s) {
            return taken(s.reading([](const app::BuiltScene& steps) {
              const auto force = steps.backend->external_forces();
              return std::vector<Vec3d>(force.begin(), force.end());
            }));
          },
          &Simulation::set_external_forces,
          "Forces of your own [N], (n, 3), copied when set; they act until set again. None: none.")
      .def_property_readonly("rest", of_model(&Model::position), "Positions at rest [m], (n, 3).")
      .def_property_readonly("mass", of_model(&Model::mass), "[kg], (n,)")
      .def_property_readonly("volume", of_model(&Model::volume), "At rest [m^3], (n,)")
      .def_property_readonly(
          "triangles",
          [](const Simulation& s) -> py::array {
            if (auto uncut = s.uncut()) return taken(std::move(*uncut));
            const auto steps = s.steps();
            return view(steps->model().surfels.triangle, keeper(steps));
          },
          "Of the surface, (t, 3): those that no crack crosses now.")
      .def_property_readonly(
          "neighbours",
          [](const Simulation& s) {
            const auto steps = s.steps();
            const Csr& lists = steps->model().with_lists().neighbourhood.neighbours;
            return py::make_tuple(view(lists.offsets, keeper(steps)),
                                  view(lists.indices, keeper(steps)));
          },
          "Lists of neighbours as (offsets, indices): those of i are\n"
          "indices[offsets[i]:offsets[i + 1]].")
      .def_property_readonly(
          "time", reading([](const app::BuiltScene& b) { return b.solver->time(); }), "[s]")
      .def_property_readonly("steps",
                             reading([](const app::BuiltScene& b) { return b.solver->steps(); }),
                             "Taken so far.")
      .def_property_readonly("dt", reading([](const app::BuiltScene& b) { return b.solver->dt(); }),
                             "Time step [s].")
      .def_property_readonly(
          "largest_step",
          reading([](const app::BuiltScene& b) { return b.plan.limit.largest_step; }),
          "Largest stable time step of Verlet's method [s]; 0 for other methods.")
      .def_property_readonly("end", reading([](const app::BuiltScene& b) {
                               return b.plan.dt * static_cast<double>(b.plan.steps);
                             }),
                             "Of the scene [s].")
      .def_property_readonly(
          "residual", reading([](const app::BuiltScene& b) { return b.solver->work().residual; }),
          "Largest force that Newton's method has left, of what acts.")
      .def_property_readonly("device",
                             reading([](const app::BuiltScene& b) { return b.backend->name(); }),
                             "What steps, in words.")
      .def_property_readonly(
          "directory", [](const Simulation& s) { return s.scene().output.directory; },
          "Output folder of the scene, as `phyxel run` takes it.")
      .def_property_readonly("warnings",
                             reading([](const app::BuiltScene& b) { return b.model().warnings; }))
      .def_property_readonly(
          "memory",
          [](const Simulation& s) {
            py::dict bytes;
            for (const ArrayBytes& array :
                 s.reading([](const app::BuiltScene& b) { return b.backend->memory(); })) {
              bytes[py::str(array.name)] = array.bytes;
            }
            return bytes;
          },
          "Bytes the device holds: {array: bytes}.")
      .def("__len__", reading([](const app::BuiltScene& b) { return b.model().size(); }))
      .def(
          "_open_view",
          [](Simulation& s, const std::map<std::string, Cloud>& clouds, double pace, bool paused,
             int port, const std::string& host, const std::optional<std::filesystem::path>& out) {
            return s.open_view(clouds, view_options(pace, paused, port, host), out);
          },
          "clouds"_a, "pace"_a, "paused"_a, "port"_a, "host"_a, "out"_a)
      .def("_close_view", &Simulation::close_view);
}

}  // namespace phyxel::python
