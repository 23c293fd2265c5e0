/// Trajectories on disk.
#include "arrays.hpp"
#include "colour.hpp"
#include "draw_obstacles.hpp"
#include "export/obstacle_mesh.hpp"
#include "frame_scene.hpp"
#include "phyxel/recorder.hpp"
#include "rigid_paths.hpp"

namespace phyxel::python {
namespace {

/// The mesh of an obstacle in its own coordinates, and where it is at some times [s].
py::dict obstacle_dict(const Obstacle& obstacle, const app::RigidPaths& paths,
                       const std::vector<double>& times, Vec3d middle, double reach) {
  std::vector<Vec3d> place;
  std::vector<Mat3d> turn;
  for (const double time : times) {
    const ObstacleStep step = paths.at(obstacle, time);
    place.push_back(step.place);
    turn.push_back(step.turn);
  }
  Surface mesh =
      app::obstacle_mesh(obstacle, transpose(turn.front()) * (middle - place.front()), reach);
  const app::Colour colour = app::obstacle_colour(obstacle.is_bounded());
  py::dict found;
  found["name"] = obstacle.name;
  found["points"] = taken(std::move(mesh.position));
  found["normals"] = taken(std::move(mesh.normal));
  found["triangles"] = taken(std::move(mesh.triangle));
  found["place"] = taken(std::move(place));
  found["turn"] = taken(std::move(turn));
  found["colour"] = py::make_tuple(colour.x, colour.y, colour.z);
  return found;
}

}  // namespace

void add_files(py::module_& module) {
  using namespace py::literals;
  py::class_<FrameData, std::shared_ptr<FrameData>>(module, "Frame", "A frame of a trajectory.")
      .def_readonly("time", &FrameData::time, "[s]")
      .def_property_readonly(
          "points", [](py::object self) { return view(self.cast<FrameData&>().point, self); },
          "Deformed positions [m], (n, 3).")
      .def_property_readonly(
          "triangles", [](py::object self) { return view(self.cast<FrameData&>().triangle, self); },
          "Triangles of the surface, (t, 3); empty for phyxels.")
      .def_property_readonly(
          "normals", [](py::object self) { return view(self.cast<FrameData&>().normal, self); },
          "Normals of the surface, (n, 3); empty for phyxels.")
      .def_property_readonly(
          "body", [](py::object self) { return view(self.cast<FrameData&>().body, self); },
          "Index of the body of each point, (n,); empty if there is one body.")
      .def_property_readonly(
          "fields",
          [](py::object self) {
            const auto& frame = self.cast<FrameData&>();
            const auto n = static_cast<py::ssize_t>(frame.point.size());
            py::dict fields;
            for (const auto& [name, values] : frame.field) {
              const auto width = n > 0 ? static_cast<py::ssize_t>(values.size()) / n : 0;
              fields[py::str(name)] =
                  view(values.data(), width == 1 ? Shape{n} : Shape{n, width}, py::handle(self));
            }
            return fields;
          },
          "Fields of the scene's output.fields: {name: array}, (n,), (n, 3) or (n, 6).")
      .def("__len__", [](const FrameData& frame) { return frame.point.size(); })
      .def("__repr__", [](const FrameData& frame) {
        return fmt::format("<phyxel.Frame: t = {:g} s, {} points, {} triangles>", frame.time,
                           frame.point.size(), frame.triangle.size());
      });
  module.def(
      "body_colour",
      [](Index body) {
        const app::Colour colour = app::body_colour(body);
        return py::make_tuple(colour.x, colour.y, colour.z);
      },
      "body"_a, "The colour of a body in pictures: red, green and blue of linear light, 0 to 1.");
  module.def(
      "obstacles_of",
      [](const FrameData& frame, const std::filesystem::path& folder,
         const std::vector<double>& times, Vec3d middle, double reach) {
        const app::RigidPaths paths(folder);
        py::list found;
        for (const Obstacle& obstacle : app::obstacles_of_frames(frame.scene, {})) {
          found.append(obstacle_dict(obstacle, paths, times, middle, reach));
        }
        return found;
      },
      "frame"_a, "folder"_a, "times"_a, "middle"_a, "reach"_a,
      "Obstacles of a run, by a frame and the folder: a list of dicts, one for each: name, "
      "points,\n"
      "normals (empty for flat faces) and triangles of its surface in its own coordinates [m],\n"
      "place [m], (k, 3), and turn, (k, 3, 3), at times [s], and colour. A plane is a square of\n"
      "twice the reach [m] opposite the middle of the bodies [m].");
  module.def(
      "read_frame",
      [](const std::filesystem::path& file) {
        const py::gil_scoped_release others;
        return read_frame(file, true);
      },
      "file"_a, "Reads a frame with all its fields.");
  module.def(
      "read_series",
      [](const std::filesystem::path& file) {
        std::vector<std::pair<std::filesystem::path, double>> entries;
        for (const SeriesEntry& entry : read_series(file)) {
          entries.emplace_back(entry.file, entry.time);
        }
        return entries;
      },
      "file"_a, "Reads the files and times [s] of a series: [(file, time), ...].");
}

}  // namespace phyxel::python
