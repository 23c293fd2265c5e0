/// Clouds: built-in shapes, filled meshes, and the caller's arrays.
#include <algorithm>

#include "arrays.hpp"
#include "mesh/filling_device.hpp"
#include "phyxel/body_file.hpp"
#include "phyxel/device.hpp"
#include "phyxel/mesh.hpp"
#include "phyxel/shapes.hpp"
#include "stages.hpp"

namespace phyxel::python {
namespace {

std::vector<Triangle> triangles_from(const py::handle& object, std::size_t corners) {
  using Array = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;
  const auto any = py::array::ensure(object);
  const char kind = any ? any.dtype().kind() : ' ';
  const bool whole = any && (any.size() == 0 || kind == 'i' || kind == 'u');
  const auto array = whole ? Array::ensure(object) : Array();
  if (!whole || array.ndim() != 2 || array.shape(1) != 3) {
    PyErr_Clear();
    throw InputError(fmt::format("triangles: {} found; allowed: shape (n, 3), integers",
                                 whole ? "shape " + shape_words(array) : "no array of integers"));
  }
  std::vector<Triangle> triangles(static_cast<std::size_t>(array.shape(0)));
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int c = 0; c < 3; ++c) {
      const std::int64_t corner = array.at(t, c);
      if (corner < 0 || corner >= static_cast<std::int64_t>(corners)) {
        throw InputError(fmt::format("triangles: {} found in row {}; allowed: 0 to {}", corner, t,
                                     static_cast<std::int64_t>(corners) - 1));
      }
      triangles[t][static_cast<std::size_t>(c)] = static_cast<Index>(corner);
    }
  }
  return triangles;
}

Surface surface_from(const py::handle& points, const py::handle& triangles) {
  Surface surface;
  surface.position = vectors_from(points, "points");
  surface.triangle = triangles_from(triangles, surface.position.size());
  surface.normal = vertex_normals(surface.position, surface.triangle);
  return surface;
}

/// The surface of a pair (points, triangles).
Surface surface_from(const py::handle& pair, const char* what) {
  if (!py::isinstance<py::sequence>(pair) || py::len(pair) != 2) {
    throw InputError(fmt::format("{}: {} found; allowed: a pair, points and triangles", what,
                                 py::repr(pair).cast<std::string>()));
  }
  const auto two = py::reinterpret_borrow<py::sequence>(pair);
  return surface_from(py::object(two[0]), py::object(two[1]));
}

/// One positive number for each of n phyxels.
std::vector<double> positive_from(const py::object& object, const char* what, const char* unit,
                                  py::ssize_t n) {
  std::vector<double> values = numbers_from(object, what, n);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double v = values[i];
    if (v > 0 && std::isfinite(v)) continue;
    throw InputError(fmt::format("{}: {} found in row {}; allowed: > 0 {}", what, v, i, unit));
  }
  return values;
}

Cloud cloud_from(const py::object& position, const py::object& volume, const py::object& surface,
                 const std::map<std::string, std::vector<Index>>& regions,
                 const py::object& spacing) {
  Cloud cloud;
  cloud.position = vectors_from(position, "position");
  const auto n = static_cast<py::ssize_t>(cloud.position.size());
  if (n == 0) throw InputError("position: no phyxel; allowed: at least one");
  if (!volume.is_none()) cloud.volume = positive_from(volume, "volume", "m^3", n);
  if (!spacing.is_none()) cloud.spacing = positive_from(spacing, "spacing", "m", n);
  if (!surface.is_none()) {
    cloud.surface = surface_from(surface, "surface");
  }
  for (const auto& [name, phyxels] : regions) {
    std::vector<Index> sorted = phyxels;
    std::sort(sorted.begin(), sorted.end());
    sorted.erase(std::unique(sorted.begin(), sorted.end()), sorted.end());
    if (sorted.empty() || sorted.front() < 0 || sorted.back() >= n) {
      throw InputError(fmt::format("regions: \"{}\" {}; allowed: indices from 0 to {}", name,
                                   sorted.empty() ? "is empty" : "has others", n - 1));
    }
    cloud.regions[name] = std::move(sorted);
  }
  return cloud;
}

/// The surface of a mesh file, or of a pair (points, triangles).
Surface surface_of(const py::object& mesh) {
  if (py::isinstance<py::str>(mesh) || py::hasattr(mesh, "__fspath__")) {
    return read_mesh(mesh.cast<std::filesystem::path>());
  }
  return surface_from(mesh, "mesh");
}

/// A box (low, high) or a ball (centre, radius) of a grading.
SpaceRegion region_from(const py::dict& finer) {
  SpaceRegion region;
  if (finer.contains("ball") == finer.contains("box")) {
    throw InputError(
        "grading: finer needs exactly one of \"ball\": (centre, radius) and \"box\": "
        "(low, high)");
  }
  if (finer.contains("ball")) {
    std::tie(region.centre, region.radius) = finer["ball"].cast<std::pair<Vec3d, double>>();
    region.is_ball = true;
  } else {
    std::tie(region.low, region.high) = finer["box"].cast<std::pair<Vec3d, Vec3d>>();
  }
  return region;
}

/// A grading from a dictionary with the keys of a scene's.
Grading grading_from(const py::dict& given) {
  Grading grading;
  if (given.contains("ratio")) grading.ratio = given["ratio"].cast<double>();
  for (const auto& [key, value] : given) {
    const auto name = key.cast<std::string>();
    if (name == "ratio") continue;
    if (name == "growth") {
      grading.growth = value.cast<double>();
    } else if (name == "per_radius") {
      grading.per_radius = value.cast<double>();
    } else if (name == "across") {
      grading.across = value.cast<double>();
    } else if (name == "finer") {
      for (const py::handle& one : value) {
        const auto finer = one.cast<py::dict>();
        grading.finer.push_back({region_from(finer), finer.contains("by")
                                                         ? finer["by"].cast<double>()
                                                         : grading.ratio});
      }
    } else {
      throw InputError(fmt::format(
          "grading: key \"{}\" found; allowed: ratio, growth, per_radius, across, finer", name));
    }
  }
  return grading;
}

Cloud make(const std::string& name, Vec3d size, double radius, double length, double spacing,
           Index phyxels, const std::string& lattice, double jitter, std::uint64_t seed,
           bool surfels, const std::optional<py::dict>& grading) {
  ShapeRequest request;
  request.name = name;
  request.size = size;
  request.radius = radius;
  request.length = length;
  request.spacing = spacing;
  request.jitter = jitter;
  request.seed = seed;
  request.surface = surfels;
  if (grading) request.grading = grading_from(*grading);
  if (lattice != "nodes" && lattice != "cells" && lattice != "fitted" && lattice != "auto") {
    throw InputError(
        fmt::format("lattice: \"{}\" found; allowed: auto, cells, nodes, fitted", lattice));
  }
  if (lattice == "nodes") request.placement = ShapeRequest::Placement::nodes;
  if (lattice == "fitted") request.placement = ShapeRequest::Placement::fitted;
  if (!is_paper_shape(name)) {
    if ((spacing > 0) == (phyxels > 0)) {
      throw InputError(
          fmt::format("shape \"{}\": exactly one of spacing and phyxels is needed", name));
    }
    if (phyxels > 0) request.spacing = spacing_for(request, phyxels);
    if (lattice == "auto") request.placement = best_placement(request);
    if (phyxels > 0) request.spacing = spacing_for(request, phyxels);
  }
  return make_shape(request);
}

Cloud sample(const py::object& mesh, Index phyxels, std::uint64_t seed, int relaxations,
             std::optional<bool> on_surface, const std::optional<py::dict>& grading,
             const py::object& progress, const std::string& device) {
  check_device_name(device, "device");
  if (phyxels < 1) throw InputError(fmt::format("phyxels: {} found; allowed: >= 1", phyxels));
  const ObserveStages observing = stages_for(progress);
  const Surface surface = surface_of(mesh);
  SampleRequest request{.phyxels = phyxels,
                        .seed = seed,
                        .relaxations = relaxations,
                        .on_surface = on_surface,
                        .cuts = {},
                        .grading = {}};
  if (grading) request.grading = grading_from(*grading);
  const py::gil_scoped_release others;
  SampleReport report;
  const bool alone = device == "auto" && !is_worth_device(request);
  Cloud cloud =
      sample_surface(surface, request, alone ? ChosenDevice{} : choose_device(device), &report);
  cloud.warnings = std::move(report.warnings);
  return cloud;
}

/// Adds what makes clouds and reads meshes.
void add_functions(py::module_& module) {
  using namespace py::literals;
  module.def("read_body", &read_body, "file"_a, "Reads a body file as `phyxel sample` writes it.");
  module.def(
      "sample", &sample, "mesh"_a, "phyxels"_a, "seed"_a = 1, "relaxations"_a = 30,
      "on_surface"_a = py::none(), "grading"_a = py::none(), "progress"_a = py::none(),
      "device"_a = "auto",
      "Fills a closed surface, a file (OBJ, PLY, STL) or a pair (points, triangles), with\n"
      "exactly so many phyxels. progress(stage, share) is called meanwhile. A GPU (`device`:\n"
      "auto, cpu, cuda, cuda:0, ...) helps with 20,000 phyxels and more; the cloud is the same.\n"
      "Programs that fork later should name \"cpu\", as CUDA does not survive a fork.\n\n"
      "grading: a dictionary with the keys of a scene's `[body.grading]`; finer regions are\n"
      "dictionaries, {\"ball\": (centre, radius), \"by\": 4} or {\"box\": (low, high)} [m].");
  module.def("shape", &make, "name"_a, py::kw_only(), "size"_a = Vec3d{}, "radius"_a = 0.0,
             "length"_a = 0.0, "spacing"_a = 0.0, "phyxels"_a = 0, "lattice"_a = "auto",
             "jitter"_a = 0.0, "seed"_a = 1, "surfels"_a = true, "grading"_a = py::none(),
             "A built-in shape, as scenes have it: beam, block (size), cylinder (radius, length),\n"
             "sphere (radius), each with `spacing` [m] or `phyxels`; alien_head, horn_bug, dino.\n"
             "`lattice` is \"cells\", \"nodes\", \"fitted\" or \"auto\", the most accurate;\n"
             "fitted shapes may have a grading, as meshes have in `sample`.");
  module.def(
      "read_mesh",
      [](const std::filesystem::path& file) {
        Surface surface = read_mesh(file);
        return py::make_tuple(taken(std::move(surface.position)),
                              taken(std::move(surface.triangle)));
      },
      "file"_a, "Reads points (n, 3) [m] and triangles (t, 3) of an OBJ, PLY or STL file.");
  module.def(
      "inspect",
      [](const py::object& mesh) { return inspect_surface(surface_of(mesh)).describe(); }, "mesh"_a,
      "Describes the defects of a surface in one line.");
}

}  // namespace

void add_clouds(py::module_& module) {
  using namespace py::literals;
  py::class_<Cloud, std::shared_ptr<Cloud>>(
      module, "Cloud",
      "Rest points of one body.\n\n"
      "Cloud(position, volume=None, surface=None, regions={}, spacing=None): `position` (n, 3) "
      "[m];\n"
      "`volume` (n,) [m^3], without which masses follow from the kernel; `surface`, a pair of\n"
      "surfels (m, 3) [m] and triangles (t, 3); `regions`, names for phyxels that scenes select;\n"
      "`spacing` (n,) [m] of a graded cloud, from which the supports of its phyxels follow.")
      .def(py::init(&cloud_from), "position"_a, "volume"_a = py::none(), "surface"_a = py::none(),
           "regions"_a = std::map<std::string, std::vector<Index>>{}, "spacing"_a = py::none())
      .def_property_readonly(
          "position", [](py::object self) { return view(self.cast<Cloud&>().position, self); },
          "Phyxels at rest [m], (n, 3).")
      .def_property_readonly(
          "volume", [](py::object self) { return view(self.cast<Cloud&>().volume, self); },
          "Volumes [m^3], (n,); empty if unknown.")
      .def_property_readonly(
          "spacing", [](py::object self) { return view(self.cast<Cloud&>().spacing, self); },
          "Distances between phyxels of a graded cloud [m], (n,); empty if unknown.")
      .def_property_readonly(
          "surfels",
          [](py::object self) { return view(self.cast<Cloud&>().surface.position, self); },
          "Surfels at rest [m], (m, 3).")
      .def_property_readonly(
          "normals", [](py::object self) { return view(self.cast<Cloud&>().surface.normal, self); },
          "Unit normals of the surfels, (m, 3).")
      .def_property_readonly(
          "triangles",
          [](py::object self) { return view(self.cast<Cloud&>().surface.triangle, self); },
          "Triangles of surfels, (t, 3).")
      .def_property_readonly(
          "regions",
          [](py::object self) {
            py::dict regions;
            for (const auto& [name, phyxels] : self.cast<Cloud&>().regions) {
              regions[py::str(name)] = view(phyxels, self);
            }
            return regions;
          },
          "Named phyxels: {name: indices}.")
      .def_readonly("warnings", &Cloud::warnings, "Warnings of the generator or sampler.")
      .def("__len__", [](const Cloud& cloud) { return cloud.position.size(); })
      .def("__repr__",
           [](const Cloud& cloud) {
             return fmt::format("<phyxel.Cloud: {} phyxels, {} surfels>", cloud.position.size(),
                                cloud.surface.position.size());
           })
      .def(
          "write",
          [](const Cloud& cloud, const std::filesystem::path& file, bool overwrite) {
            write_body(file, cloud, overwrite);
          },
          "file"_a, "overwrite"_a = false, "Writes a body file, which scenes name as `file`.");
  add_functions(module);
}

}  // namespace phyxel::python
