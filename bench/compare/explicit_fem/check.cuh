/// Comparison of all paths with the first.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

#include "body.cuh"

namespace fem {

/// The largest difference between paths over the largest displacement. Paths sum the forces at a
/// node in different orders, and floats of 24 bits add up these roundings over 200 steps.
constexpr double largest_difference = 1e-4;

/// Returns displacements in the order of the lattice [m], shape [nodes, 3].
inline std::vector<double> in_lattice_order(const Mesh& mesh, const std::vector<float4>& u) {
  std::vector<double> ordered(3 * mesh.nodes);
  const int row = mesh.across + 1;
  for (std::int64_t a = 0; a < mesh.nodes; ++a) {
    const double* position = &mesh.positions[3 * a];
    const std::int64_t i = std::llround(position[0] / mesh.cell),
                       j = std::llround(position[1] / mesh.cell + 0.5 * mesh.across),
                       k = std::llround(position[2] / mesh.cell + 0.5 * mesh.across);
    const std::int64_t number = (i * row + j) * row + k;
    ordered[3 * number] = u[a].x;
    ordered[3 * number + 1] = u[a].y;
    ordered[3 * number + 2] = u[a].z;
  }
  return ordered;
}

/// Returns the displacements of a path after 200 steps from rest.
template <class Element>
std::vector<double> displacements_of(const Mesh& mesh, Path path) {
  const Body<Element> body(mesh, path);
  const Graph graph = body.graph(make_step(time_step_of<Element>(mesh), gravity, 0), 200);
  graph.launch();
  return in_lattice_order(mesh, body.displacements());
}

/// Returns the largest difference of values over the largest value; infinite if one is not finite.
inline double relative_difference(const std::vector<double>& values,
                                  const std::vector<double>& expected) {
  double difference = 0, largest = 0;
  for (std::size_t a = 0; a < values.size(); ++a) {
    if (!std::isfinite(values[a]) || !std::isfinite(expected[a])) {
      return std::numeric_limits<double>::infinity();
    }
    difference = std::max(difference, std::fabs(values[a] - expected[a]));
    largest = std::max(largest, std::fabs(expected[a]));
  }
  return largest > 0 ? difference / largest : std::numeric_limits<double>::infinity();
}

/// Prints the difference of each path from the first, and returns whether all agree.
template <class Element>
bool check(int across) {
  const Mesh mesh = make_mesh<Element>(across, NodeOrder::morton);
  std::vector<double> first;
  bool agree = true;
  for (const Path path :
       {Path::atomics, Path::gather, Path::tiles, Path::lattice, Path::resident}) {
    if (path == Path::lattice && Element::nodes != 8) continue;
    if (path == Path::resident && !fits_one_block<Element>(mesh)) continue;
    const std::vector<double> found =
        path == Path::lattice
            ? displacements_of<Element>(make_mesh<Element>(across, NodeOrder::lattice), path)
            : displacements_of<Element>(mesh, path);
    if (first.empty()) first = found;
    const double difference = relative_difference(found, first);
    const bool agrees = difference < largest_difference;
    agree = agree && agrees;
    std::printf("%s,%s,%d,%.2e,%s\n", Element::name, name_of(path), across, difference,
                agrees ? "yes" : "no");
  }
  std::fflush(stdout);
  return agree;
}

inline bool check_all() {
  std::printf("element,path,across,relative_difference,agrees\n");
  bool agree = true;
  for (const int across : {4, 13}) {
    agree = check<Brick>(across) && agree;
    agree = check<Tetrahedron>(across) && agree;
  }
  return agree;
}

}  // namespace fem
