/// The compiled part of the Python module; `phyxel/__init__.py` is the other part.
#include <fmt/format.h>
#include <omp.h>
#include <pthread.h>

#include <cstdlib>
#include <string>

#include "arrays.hpp"
#include "version.hpp"

namespace phyxel::python {
namespace {

// Kept until the interpreter ends.
struct Exceptions {
  py::handle error, input, output, device, diverged;
  py::handle of(ExitCode code) const {
    switch (code) {
      case ExitCode::bad_input:
        return input;
      case ExitCode::output_failed:
        return output;
      case ExitCode::device_failed:
        return device;
      case ExitCode::diverged:
        return diverged;
      default:
        return error;
    }
  }
};

py::handle add_exception(py::module_& module, const char* name, const py::object& bases) {
  const std::string full = std::string("phyxel.") + name;
  const py::handle made = PyErr_NewException(full.c_str(), bases.ptr(), nullptr);
  if (!made) throw py::error_already_set();
  module.attr(name) = made;
  return made;
}

/// Defines the exceptions. InputError is also a ValueError.
const Exceptions& add_exceptions(py::module_& module) {
  static Exceptions e;
  const auto base = [](py::handle type) { return py::reinterpret_borrow<py::object>(type); };
  e.error = add_exception(module, "Error", base(PyExc_RuntimeError));
  e.input =
      add_exception(module, "InputError", py::make_tuple(base(e.error), base(PyExc_ValueError)));
  e.output = add_exception(module, "OutputError", base(e.error));
  e.device = add_exception(module, "DeviceError", base(e.error));
  e.diverged = add_exception(module, "DivergedError", base(e.error));
  return e;
}

/// Refuses to load where arrays would have wrong values: pybind11 before 2.12 reads the description
/// of an array's type as NumPy 1 lays it out.
void check_numpy() {
  if (PYBIND11_VERSION_HEX >= 0x020C0000) return;
  const auto version = py::module_::import("numpy").attr("__version__").cast<std::string>();
  if (std::atoi(version.c_str()) < 2) return;
  throw py::import_error(fmt::format(
      "NumPy {} is installed, but phyxel was built with pybind11 {}.{}, which knows NumPy 1 only: "
      "allowed are NumPy 1, or phyxel built with pybind11 2.12 or later",
      version, PYBIND11_VERSION_MAJOR, PYBIND11_VERSION_MINOR));
}

/// Ends the waiting OpenMP threads before a fork, which copies the calling thread only: the child
/// would wait for the other threads for ever. Parent and child start new threads when they need
/// them.
void end_waiting_threads() { omp_pause_resource_all(omp_pause_hard); }

}  // namespace
}  // namespace phyxel::python

PYBIND11_MODULE(_phyxel, module) {
  namespace py = pybind11;
  phyxel::python::check_numpy();
  static const phyxel::python::Exceptions& exceptions = phyxel::python::add_exceptions(module);
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const phyxel::Error& e) {
      PyErr_SetString(exceptions.of(e.code()).ptr(), e.what());
    }
  });
  pthread_atfork(phyxel::python::end_waiting_threads, nullptr, nullptr);
  module.attr("version") = phyxel::program_version();
  module.attr("pybind11_version") = py::make_tuple(PYBIND11_VERSION_MAJOR, PYBIND11_VERSION_MINOR);
  phyxel::python::add_clouds(module);
  phyxel::python::add_files(module);
  phyxel::python::add_simulation(module);
}
