/// Measurement of the time of a step.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <vector>

#include "body.cuh"

namespace fem {

/// Prints the speed of a plain copy, for scale, as a comment.
inline void print_copy_speed() {
  constexpr std::size_t bytes = std::size_t(1) << 30;
  constexpr int copies = 20;
  const DeviceArray<char> from(bytes), to(bytes);
  const auto copy = [&] {
    FEM_CUDA(cudaMemcpyAsync(to.data(), from.data(), bytes, cudaMemcpyDeviceToDevice));
  };
  copy();
  Stopwatch stopwatch(nullptr);
  stopwatch.start();
  for (int i = 0; i < copies; ++i) copy();
  std::printf("# copy: %.4g bytes read and written in a second\n",
              2. * bytes * copies / stopwatch.stop());
}

/// Returns the median time of a step over five runs of about 0.15 s [s].
template <class Element>
double step_seconds(const Body<Element>& body) {
  const std::int64_t nodes = body.mesh().nodes;
  const int steps = body.path() == Path::resident ? 1000
                    : nodes > 1000000             ? 4
                    : nodes > 50000               ? 16
                                                  : 100;
  const Graph graph = body.graph(make_step(time_step_of<Element>(body.mesh()), gravity, 0), steps);
  Stopwatch stopwatch(body.stream().get());
  graph.launch(3);
  body.stream().wait();
  int launches = 5;
  const auto seconds_per_launch = [&] {
    stopwatch.start();
    graph.launch(launches);
    return stopwatch.stop() / launches;
  };
  launches = std::max(1, std::min(20000, int(0.15 / seconds_per_launch())));
  std::vector<double> seconds;
  for (int run = 0; run < 5; ++run) seconds.push_back(seconds_per_launch() / steps);
  std::sort(seconds.begin(), seconds.end());
  return seconds[seconds.size() / 2];
}

/// Prints the row of a path. @throws std::runtime_error if the body is not finite in the end
template <class Element>
void measure_speed(const Mesh& mesh, Path path, int tile = usual_tile) {
  const Body<Element> body(mesh, path, tile);
  const std::string name = name_of(path) + (tile == usual_tile ? "" : "_" + std::to_string(tile));
  const double seconds = step_seconds(body);
  if (!std::isfinite(deflection_of(mesh, body.displacements()))) {
    throw std::runtime_error(std::string("displacements of ") + Element::name + ", " + name +
                             ", are not finite");
  }
  std::printf("%s,%s,%d,%lld,%lld,%.6e,%.6e\n", Element::name, name.c_str(), mesh.across,
              static_cast<long long>(mesh.nodes), static_cast<long long>(mesh.elements), seconds,
              mesh.nodes / seconds);
  std::fflush(stdout);
}

/// Measures the paths that take any mesh of an element. The path tiles_128 has tiles of 128 nodes.
template <class Element>
void measure_speeds(int across) {
  const Mesh mesh = make_mesh<Element>(across, NodeOrder::morton);
  for (const Path path : {Path::tiles, Path::atomics, Path::gather}) {
    measure_speed<Element>(mesh, path);
  }
  measure_speed<Element>(mesh, Path::tiles, 128);
  if (fits_one_block<Element>(mesh)) measure_speed<Element>(mesh, Path::resident);
}

/// @param most cells across at most
inline void speed(int most) {
  print_copy_speed();
  std::printf("element,path,across,nodes,elements,step_seconds,node_steps_per_s\n");
  for (const int across : {4, 13, 26, 42, 73, 147}) {
    if (across > most) break;
    measure_speed<Brick>(make_mesh<Brick>(across, NodeOrder::lattice), Path::lattice);
    measure_speeds<Brick>(across);
    measure_speeds<Tetrahedron>(across);
  }
}

}  // namespace fem
